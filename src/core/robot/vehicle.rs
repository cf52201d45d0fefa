//! The nominal vehicle: convex parts, tags, lights, and the mount of the arm.

use crate::codes::Code;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{FileIssue, RobotError, read_text};
use super::light::{LightFile, VehicleLight};
use super::part::{Part, PartFile, check_parts, check_place};
use super::survey::{TagFile, TagSurvey, check_tags};
use crate::document::parse_file;
use crate::kind::Kind;
use crate::kinematics::Attachment;
use crate::schema::schema_of;
use crate::spatial::{Base, Pose, Vehicle as VehicleFrame};

/// The nominal vehicle.
#[derive(Clone, Debug)]
pub struct Vehicle {
    /// File that the vehicle was read from.
    pub file: PathBuf,
    /// Name of the vehicle in its file.
    pub name: String,
    /// Dry mass without the arm.
    pub mass_kg: f64,
    /// Mount of the arm.
    pub vehicle_from_base: Pose<VehicleFrame, Base>,
    /// Convex shapes in the vehicle's frame.
    pub parts: Vec<Part>,
    /// Tags that the vehicle carries; `None`: those of robot.toml are valid.
    pub survey: Option<TagSurvey>,
    /// Lights in the vehicle's frame; empty if the file has none.
    pub lights: Vec<VehicleLight>,
    /// Stowed configurations on this vehicle by the robot's name; they replace those of robot.toml.
    pub stowed_rad: BTreeMap<String, Vec<f64>>,
    /// Properties of a free vehicle; `None` if the file has none.
    pub dynamics: Option<VehicleDynamics>,
    /// Station-keeping errors; the defaults if the file has none.
    pub station_keeping: StationKeeping,
    /// The file's text for a recording, with meshes replaced by hulls.
    pub text: String,
}

/// Station-keeping errors, standard deviations: centre of mass along each axis, and roll, pitch and yaw.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StationKeeping {
    /// Standard deviation of the position, per axis.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub position_std_m: f64,
    /// Standard deviation of the attitude, per angle.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub attitude_std_rad: f64,
}

/// Assumed values: 3 cm and 0.5 deg.
impl Default for StationKeeping {
    fn default() -> Self {
        Self { position_std_m: 0.03, attitude_std_rad: 0.0087 }
    }
}

impl StationKeeping {
    fn check(self, file: &Path) -> Result<Self, FileIssue> {
        FileIssue::check_range(file, "station_keeping.position_std_m", self.position_std_m, 0.0..=10.0)?;
        FileIssue::check_range(file, "station_keeping.attitude_std_rad", self.attitude_std_rad, 0.0..=1.0)?;
        Ok(self)
    }
}

/// The vehicle as a body in water, about its origin (the centre of mass) in its own axes. Arrays of six hold x, y, z,
/// then about x, y, z.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VehicleDynamics {
    /// Moments of inertia about x, y, z, without the water.
    #[schemars(inner(range(min = 0.1, max = 1e8)))]
    pub inertia_kg_m2: [f64; 3],
    /// Mass of the water that moves along x, y, z with the vehicle.
    #[schemars(inner(range(min = 0.0, max = 1e7)))]
    pub added_mass_kg: [f64; 3],
    /// Inertia of the water that turns about x, y, z with the vehicle.
    #[schemars(inner(range(min = 0.0, max = 1e8)))]
    pub added_inertia_kg_m2: [f64; 3],
    /// Centre of buoyancy. Only its height matters: the vehicle is ballasted so that it floats level with the arm
    /// stowed.
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    pub center_of_buoyancy_m: [f64; 3],
    /// Linear drag, N s/m and N m s/rad.
    #[schemars(inner(range(min = 0.0, max = 1e7)))]
    pub drag_linear: [f64; 6],
    /// Quadratic drag, N s2/m2 and N m s2/rad2.
    #[schemars(inner(range(min = 0.0, max = 1e7)))]
    pub drag_quadratic: [f64; 6],
    /// Largest force of all thrusters together along x, y, z; 0 on axes without authority.
    #[schemars(inner(range(min = 0.0, max = 1e6)))]
    pub thrust_max_n: [f64; 3],
    /// Largest moment of all thrusters together about x, y, z; 0 on axes without authority.
    #[schemars(inner(range(min = 0.0, max = 1e6)))]
    pub moment_max_n_m: [f64; 3],
}

impl VehicleDynamics {
    fn check(&self, file: &Path) -> Result<(), FileIssue> {
        let each = |key: &str, values: &[f64], range: std::ops::RangeInclusive<f64>| {
            values.iter().enumerate().try_for_each(|(i, value)| {
                FileIssue::check_range(file, &format!("dynamics.{key}[{i}]"), *value, range.clone()).map(|_| ())
            })
        };
        each("inertia_kg_m2", &self.inertia_kg_m2, 0.1..=1e8)?;
        each("added_mass_kg", &self.added_mass_kg, 0.0..=1e7)?;
        each("added_inertia_kg_m2", &self.added_inertia_kg_m2, 0.0..=1e8)?;
        each("center_of_buoyancy_m", &self.center_of_buoyancy_m, -10.0..=10.0)?;
        each("drag_linear", &self.drag_linear, 0.0..=1e7)?;
        each("drag_quadratic", &self.drag_quadratic, 0.0..=1e7)?;
        each("thrust_max_n", &self.thrust_max_n, 0.0..=1e6)?;
        each("moment_max_n_m", &self.moment_max_n_m, 0.0..=1e6)
    }
}

#[derive(Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct VehicleFile {
    version: u32,
    #[serde(default = "Kind::vehicle")]
    kind: Kind,
    /// Name of the vehicle.
    name: String,
    /// Dry mass without the arm.
    #[schemars(range(min = 1.0, max = 1e7))]
    mass_kg: f64,
    /// Id of the tag that defines the frame of the tags.
    #[serde(skip_serializing_if = "Option::is_none")]
    base_tag: Option<u32>,
    /// Stowed joint angles on this vehicle, by the robot's name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(extend("additionalProperties" = {
        "type": "array", "items": { "type": "number", "minimum": -100.0, "maximum": 100.0 }
    }))]
    stowed_rad: BTreeMap<String, Vec<f64>>,
    /// Mount of the arm: pose of its base link in the vehicle's frame.
    mount: PlaceFile,
    /// Vehicle as a body in water; needed by a free vehicle.
    #[serde(skip_serializing_if = "Option::is_none")]
    dynamics: Option<VehicleDynamics>,
    /// Errors of station keeping; absent: 3 cm and 0.5 deg.
    #[serde(skip_serializing_if = "Option::is_none")]
    station_keeping: Option<StationKeeping>,
    /// Tags on the vehicle, in its frame; they are the survey for any arm on it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    tag: Vec<TagFile>,
    /// Lamps for rendered images.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    light: Vec<LightFile>,
    /// Convex parts around the arm, in the vehicle's frame; 256 at most.
    part: Vec<PartFile>,
}

#[derive(Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PlaceFile {
    /// Position.
    #[schemars(inner(range(min = -1e4, max = 1e4)))]
    position_m: [f64; 3],
    /// Attitude.
    quaternion_wxyz: [f64; 4],
}

/// Returns the schema of a vehicle.
#[must_use]
pub fn vehicle_schema() -> serde_json::Value {
    schema_of::<VehicleFile>(Kind::Vehicle)
}

/// Reads a vehicle file.
///
/// # Errors
/// [`RobotError`] naming file and key.
pub fn load_vehicle(file: &Path) -> Result<Vehicle, RobotError> {
    let mut text = read_text(file)?;
    let mut raw: VehicleFile = parse_file(Kind::Vehicle, file, &text)?;
    for (robot, angles) in &raw.stowed_rad {
        for angle in angles {
            FileIssue::check_range(file, &format!("stowed_rad.{robot}"), *angle, -100.0..=100.0)?;
        }
    }
    FileIssue::check_range(file, "mass_kg", raw.mass_kg, 1.0..=1e7)?;
    check_place(file, "mount.position_m", &raw.mount.position_m)?;
    let mount =
        Pose::from_position_quaternion_wxyz(raw.mount.position_m, raw.mount.quaternion_wxyz).ok_or_else(|| {
            FileIssue::new(
                Code::ValueInvalid,
                file,
                "mount",
                "position and quaternion must be finite and the quaternion not zero",
            )
        })?;
    if let Some(dynamics) = &raw.dynamics {
        dynamics.check(file)?;
    }
    let station_keeping = raw.station_keeping.unwrap_or_default().check(file)?;
    let survey = check_survey(file, &raw, &mount)?;
    let lights = raw.light.iter().enumerate().map(|(n, light)| light.check(file, n)).collect::<Result<_, _>>()?;
    let (parts, plain) = check_parts(&raw.part, file, "part")?;
    if raw.part.iter().any(PartFile::is_mesh) {
        raw.part = plain;
        text = toml::to_string(&raw)
            .map_err(|error| FileIssue::new(Code::Internal, file, "part", format!("has no TOML form: {error}")))?;
    }
    Ok(Vehicle {
        file: file.to_owned(),
        name: raw.name,
        mass_kg: raw.mass_kg,
        vehicle_from_base: mount,
        parts,
        survey,
        lights,
        stowed_rad: raw.stowed_rad,
        dynamics: raw.dynamics,
        station_keeping,
        text,
    })
}

fn check_survey(
    file: &Path,
    raw: &VehicleFile,
    vehicle_from_base: &Pose<VehicleFrame, Base>,
) -> Result<Option<TagSurvey>, RobotError> {
    match (raw.base_tag, raw.tag.is_empty()) {
        (None, true) => Ok(None),
        (None, false) => {
            Err(FileIssue::new(Code::KeyMissing, file, "base_tag", "is missing; it is required with [[tag]]s").into())
        }
        (Some(_), true) => {
            Err(FileIssue::new(Code::NameUnknown, file, "base_tag", "is not among the [[tag]]s: there are none").into())
        }
        (Some(base_tag), false) => {
            let base_tag = Some(base_tag);
            let (tags, family) = check_tags(file, &raw.tag, base_tag, &vehicle_from_base.inverse())?;
            Ok(Some(TagSurvey { base_tag, anchor_tag: None, frame: Attachment::base(), family, tags }))
        }
    }
}

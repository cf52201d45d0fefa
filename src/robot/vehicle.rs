//! The drawing of the vehicle that carries the arm: convex parts and where the arm is bolted on.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::error::{FileIssue, RobotError, parse_toml, read_text};
use super::shape::{PlacedShape, Shape};
use crate::spatial::{Base, Pose, Vehicle as VehicleFrame};

/// A vehicle as drawn.
#[derive(Clone, Debug)]
pub struct Vehicle {
    pub name: String,
    pub mass_kg: f64,
    pub vehicle_from_base: Pose<VehicleFrame, Base>,
    pub parts: Vec<Part>,
}

/// One convex part, placed in the vehicle frame.
#[derive(Clone, Debug)]
pub struct Part {
    pub name: String,
    pub placed: PlacedShape,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VehicleFile {
    version: u32,
    name: String,
    mass_kg: f64,
    mount: PlaceFile,
    part: Vec<PartFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaceFile {
    position_m: [f64; 3],
    quaternion_wxyz: [f64; 4],
}

/// A part or obstacle as files write it.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PartFile {
    name: String,
    shape: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    size_m: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    radius_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    length_m: Option<f64>,
    position_m: [f64; 3],
    #[serde(default = "no_rotation")]
    quaternion_wxyz: [f64; 4],
    #[serde(default = "grey")]
    color_rgb: [u8; 3],
}

fn no_rotation() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

fn grey() -> [u8; 3] {
    [140, 140, 140]
}

/// Reads a vehicle file.
///
/// # Errors
/// [`RobotError`] naming file and key.
pub fn load_vehicle(file: &Path) -> Result<Vehicle, RobotError> {
    let raw: VehicleFile = parse_toml(file, &read_text(file)?)?;
    FileIssue::check_range(file, "version", f64::from(raw.version), 1.0..=1.0)?;
    FileIssue::check_range(file, "mass_kg", raw.mass_kg, 1.0..=1e7)?;
    check_place(file, "mount.position_m", &raw.mount.position_m)?;
    let mount =
        Pose::from_position_quaternion_wxyz(raw.mount.position_m, raw.mount.quaternion_wxyz).ok_or_else(|| {
            FileIssue::new(file, "mount", "position and quaternion must be finite and the quaternion not zero")
        })?;
    let parts = raw.part.iter().map(|part| part.check(file, "part")).collect::<Result<_, _>>()?;
    Ok(Vehicle { name: raw.name, mass_kg: raw.mass_kg, vehicle_from_base: mount, parts })
}

/// Farther away than any site is wide is a slip of the pen.
pub(super) fn check_place(file: &Path, key: &str, position_m: &[f64; 3]) -> Result<(), FileIssue> {
    position_m.iter().try_for_each(|&value| FileIssue::check_range(file, key, value, -1e4..=1e4).map(|_| ()))
}

impl PartFile {
    /// Checks one part of `file`; `table` names the list that it stands in.
    pub(crate) fn check(&self, file: &Path, table: &str) -> Result<Part, RobotError> {
        let at = |key: &str| format!("{table} `{}`: {key}", self.name);
        let missing = |key: &str| FileIssue::new(file, at(key), format!("is needed by shape `{}`", self.shape));
        let size = || self.size_m.ok_or_else(|| missing("size_m"));
        let radius = || self.radius_m.ok_or_else(|| missing("radius_m"));
        let length = || self.length_m.ok_or_else(|| missing("length_m"));
        let shape = match self.shape.as_str() {
            "box" => Shape::Box { size_m: size()? },
            "cylinder" => Shape::Cylinder { radius_m: radius()?, length_m: length()? },
            "capsule" => Shape::Capsule { radius_m: radius()?, length_m: length()? },
            "sphere" => Shape::Sphere { radius_m: radius()? },
            other => {
                let problem = format!("`{other}` is none of box, cylinder, capsule, sphere");
                return Err(FileIssue::new(file, at("shape"), problem).into());
            }
        };
        for (key, value) in shape.lengths() {
            FileIssue::check_range(file, &at(key), value, 1e-4..=1e4)?;
        }
        let place: Pose<VehicleFrame, VehicleFrame> =
            Pose::from_position_quaternion_wxyz(self.position_m, self.quaternion_wxyz)
                .ok_or_else(|| FileIssue::new(file, at("position_m, quaternion_wxyz"), "must be finite, not zero"))?;
        check_place(file, &at("position_m"), &self.position_m)?;
        let placed = PlacedShape { owner_from_shape: *place.isometry(), shape, color_rgb: self.color_rgb };
        Ok(Part { name: self.name.clone(), placed })
    }
}

//! The routine's `[world]`: how far the truth differs from the drawings.
//!
//! Every key is optional; a missing one takes the figure of the standard world. Angles are rad, temperatures Celsius.

mod camera;
mod hydraulics;
mod image;
mod joint_sensors;
mod physics;
mod temperature;
mod vehicle;
mod water;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::SimError;
use super::fault::{self, ScheduledFault};
use super::recorded::RecordedMotion;
use armcal_core::robot::{FileIssue, PartFile, Robot, check_parts};
use armcal_core::routine::Scene;
pub use camera::{CameraWorldSpec, ClockSpec, CornerNoiseKind, PortKind, TagsSpec};
pub use hydraulics::HydraulicsSpec;
pub use image::{CameraMode, ImageSpec, WaterKind};
pub use joint_sensors::JointSensorsSpec;
pub use physics::PhysicsSpec;
pub use temperature::{Points, TemperatureSpec};
pub use vehicle::{MotionKind, VehicleMotionSpec};
pub use water::WaterSpec;

/// Length of a control period, s: the arm's own controller runs at 100 Hz.
pub(crate) const CONTROL_PERIOD_S: f64 = 0.01;

/// Defines one table of `[world]`: figures with defaults and allowed ranges (inclusive), then fields of other types.
macro_rules! table {
    (
        $(#[$doc:meta])* $name:ident {
            $($(#[$field_doc:meta])* $field:ident = $default:expr, in $range:expr;)+
        }
        $(and { $($(#[$other_doc:meta])* $other:ident: $kind:ty = $other_default:expr;)+ })?
    ) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $($(#[$field_doc])* pub $field: f64,)+
            $($($(#[$other_doc])* pub $other: $kind,)+)?
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)+ $($($other: $other_default,)+)? }
            }
        }

        impl CheckedTable for $name {
            fn check(&self, file: &Path, table: &str) -> Result<(), FileIssue> {
                $({
                    let range: RangeInclusive<f64> = $range;
                    FileIssue::check_range(file, &format!("{table}.{}", stringify!($field)), self.$field, range)?;
                })+
                Ok(())
            }
        }
    };
}
use table;

trait CheckedTable: DeserializeOwned + Default {
    fn check(&self, file: &Path, table: &str) -> Result<(), FileIssue>;
}

/// One degree, rad.
const DEG: f64 = std::f64::consts::PI / 180.0;

/// `[world]`, checked.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WorldSpec {
    pub physics: PhysicsSpec,
    pub joint_sensors: JointSensorsSpec,
    pub temperature: TemperatureSpec,
    pub clock: ClockSpec,
    pub camera: CameraWorldSpec,
    pub tags: TagsSpec,
    /// Written out where images are rendered or it was set.
    #[serde(skip_serializing_if = "ImageSpec::is_default")]
    pub image: ImageSpec,
    pub vehicle: VehicleMotionSpec,
    pub hydraulics: HydraulicsSpec,
    pub water: WaterSpec,
    /// By joint: counts per radian over the datasheet's. Negative: they run the other way. The arm's own controller knows.
    pub gear_ratio: BTreeMap<String, f64>,
    /// The motion that `vehicle.motion_file` names, read with the routine.
    #[serde(skip)]
    pub recorded: Option<Arc<RecordedMotion>>,
    /// What stands in the water and nobody has drawn: `[[world.obstacle]]`, as `[[obstacle]]`.
    #[serde(skip_serializing_if = "UnmodelledObstacles::is_none")]
    pub obstacle: UnmodelledObstacles,
    /// What breaks: in the order of the routine's `fault` steps, then what has a time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fault: Vec<ScheduledFault>,
}

/// What stands in the water and is in no drawing: shapes in the world frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct UnmodelledObstacles(Vec<PartFile>);

impl UnmodelledObstacles {
    fn is_none(&self) -> bool {
        self.0.is_empty()
    }
}

impl WorldSpec {
    /// Reads `[world]` of the routine `file`. Each sub-table is named as the field here.
    ///
    /// # Errors
    /// [`SimError::Spec`] naming file, key and the allowed range; NaN is in no range.
    pub fn from_table(table: &toml::Table, file: &Path) -> Result<Self, SimError> {
        const TABLES: [&str; 13] = [
            "physics",
            "joint_sensors",
            "temperature",
            "clock",
            "camera",
            "tags",
            "image",
            "vehicle",
            "hydraulics",
            "water",
            "gear_ratio",
            "obstacle",
            "fault",
        ];
        if let Some(key) = table.keys().find(|key| !TABLES.contains(&key.as_str())) {
            let problem = format!("is unknown; [world] has the tables {}", TABLES.join(", "));
            return Err(FileIssue::new(file, format!("world.{key}"), problem).into());
        }
        let reader = Reader { table, file };
        let spec = Self {
            physics: reader.read("physics")?,
            joint_sensors: reader.read("joint_sensors")?,
            temperature: reader.read("temperature")?,
            clock: reader.read("clock")?,
            camera: reader.read("camera")?,
            tags: reader.read("tags")?,
            image: reader.read("image")?,
            vehicle: reader.read("vehicle")?,
            hydraulics: reader.read("hydraulics")?,
            water: reader.read("water")?,
            gear_ratio: reader.parse("gear_ratio")?,
            recorded: None,
            obstacle: UnmodelledObstacles(
                check_parts(&reader.parse::<Vec<PartFile>>("obstacle")?, file, "world.obstacle")?.1,
            ),
            fault: fault::read_list(table, file)?,
        };
        for (joint, ratio) in &spec.gear_ratio {
            let key = format!("world.gear_ratio.{joint} (size)");
            FileIssue::check_range(file, &key, ratio.abs(), 0.01..=100.0)?;
        }
        spec.check_relations(file)?;
        Ok(spec)
    }

    /// Reads the recorded motion that the vehicle shall follow, if any; its file's place counts from `folder`.
    ///
    /// # Errors
    /// [`SimError`] naming that file, line and column.
    pub(crate) fn read_motion(&mut self, folder: &Path) -> Result<(), SimError> {
        if let Some(file) = &self.vehicle.motion_file {
            self.recorded = Some(Arc::new(RecordedMotion::read(&folder.join(file))?));
        }
        Ok(())
    }

    /// As TOML, every key written out.
    ///
    /// # Errors
    /// [`SimError::SpecText`], which no checked spec causes.
    pub fn to_toml(&self) -> Result<String, SimError> {
        let mut text = toml::to_string(self)?;
        if self.camera.mode == CameraMode::Rendered && self.image.is_default() {
            text = format!("{text}\n[image]\n{}", toml::to_string(&self.image)?);
        }
        Ok(text)
    }

    /// The scene as it truly is: as drawn, and what nobody has drawn.
    ///
    /// # Errors
    /// None for a checked spec.
    pub(crate) fn true_scene(&self, drawn: &Scene) -> Result<Scene, SimError> {
        let (undrawn, _) = check_parts(&self.obstacle.0, Path::new("[world]"), "obstacle")?;
        let obstacles = drawn.obstacles.iter().cloned().chain(undrawn).collect();
        Ok(Scene { obstacles, ..*drawn })
    }

    /// With what only the robot says filled in.
    #[must_use]
    pub fn completed(mut self, robot: &Robot) -> Self {
        self.water.buoyancy_fraction.get_or_insert(robot.buoyancy_fraction);
        self
    }

    /// Physics steps in a control period.
    #[must_use]
    pub fn steps_per_period(&self) -> u64 {
        (CONTROL_PERIOD_S / self.physics.step_s).round() as u64
    }

    /// Images are rendered for rays through one point.
    fn check_view_point(&self, file: &Path) -> Result<(), FileIssue> {
        let camera = &self.camera;
        let has_one = match camera.port {
            PortKind::None => true,
            PortKind::Dome => camera.dome_decentre_std_m == 0.0,
            PortKind::Flat => false,
        };
        if camera.mode == CameraMode::Geometric || has_one {
            return Ok(());
        }
        let problem = "a flat port or a dome beside the pupil sees from no single point: with mode = \"rendered\" only \
                       \"none\", or \"dome\" with dome_decentre_std_m = 0, are allowed";
        Err(FileIssue::new(file, "world.camera.port", problem))
    }

    fn check_relations(&self, file: &Path) -> Result<(), FileIssue> {
        let (min, max) = (self.vehicle.period_min_s, self.vehicle.period_max_s);
        if min > max {
            let problem = format!("{max} is below period_min_s, {min}");
            return Err(FileIssue::new(file, "world.vehicle.period_max_s", problem));
        }
        let is_recorded = self.vehicle.motion == MotionKind::Recorded;
        if is_recorded != self.vehicle.motion_file.is_some() {
            let problem = "goes with motion = \"recorded\", and that with it";
            return Err(FileIssue::new(file, "world.vehicle.motion_file", problem));
        }
        let step_s = self.physics.step_s;
        if (self.steps_per_period() as f64 * step_s - CONTROL_PERIOD_S).abs() > 1e-9 {
            let problem = format!("{step_s} does not divide the control period of {CONTROL_PERIOD_S} s");
            return Err(FileIssue::new(file, "world.physics.step_s", problem));
        }
        self.image.check_relations(file)?;
        self.check_view_point(file)?;
        self.tags.check_options(file)?;
        self.temperature.check_relations(file)?;
        self.joint_sensors.check_relations(file)
    }
}

struct Reader<'a> {
    table: &'a toml::Table,
    file: &'a Path,
}

impl Reader<'_> {
    fn read<T: CheckedTable>(&self, name: &str) -> Result<T, FileIssue> {
        let parsed: T = self.parse(name)?;
        parsed.check(self.file, &format!("world.{name}"))?;
        Ok(parsed)
    }

    fn parse<T: DeserializeOwned + Default>(&self, name: &str) -> Result<T, FileIssue> {
        match self.table.get(name) {
            None => Ok(T::default()),
            Some(value) => value.clone().try_into().map_err(|error: toml::de::Error| {
                FileIssue::new(self.file, format!("world.{name}"), error.message().trim_end().to_owned())
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<WorldSpec, SimError> {
        WorldSpec::from_table(&text.parse().expect("valid TOML"), Path::new("r.toml"))
    }

    fn problem(text: &str) -> String {
        read(text).expect_err("refused").to_string()
    }

    #[test]
    fn an_empty_world_is_the_standard_one() {
        assert_eq!(read("").expect("valid"), WorldSpec::default());
        assert_eq!(WorldSpec::default().steps_per_period(), 5);
    }

    #[test]
    fn errors_name_file_key_and_range() {
        let text = problem("[camera]\nrate_hz = 1000.0");
        assert!(
            text.contains("r.toml") && text.contains("world.camera.rate_hz") && text.contains("0.1 .. 100"),
            "{text}"
        );
        assert!(problem("[clock]\ncamera_jitter_s = nan").contains("camera_jitter_s"));
        assert!(problem("[clock]\ncamera_jiter_s = 0.1").contains("camera_jiter_s"));
        assert!(problem("[clocks]").contains("world.clocks"));
        assert!(problem("[vehicle]\nperiod_min_s = 20.0").contains("period_max_s"));
        assert!(problem("[physics]\nstep_s = 0.003").contains("step_s"));
        assert!(problem("[camera]\nrate_hz = \"fast\"").contains("world.camera"));
    }

    #[test]
    fn what_the_water_carries_is_the_arms_own_figure_unless_the_world_has_one() {
        for (arm, fraction) in [("titan4", 0.22), ("kraft-predator", 0.3625)] {
            let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots").join(arm);
            let robot = armcal_core::robot::load(&folder).expect("the robot reads");
            let spec = |text: &str| read(text).expect("valid").completed(&robot);
            assert_eq!(spec("").water.buoyancy(), fraction);
            assert_eq!(spec("[water]\nbuoyancy_fraction = 0.5").water.buoyancy(), 0.5);
            assert!(spec("").to_toml().expect("text").contains(&format!("buoyancy_fraction = {fraction}")));
        }
        assert!(problem("[water]\nbuoyancy_fraction = 1.0").contains("world.water.buoyancy_fraction"));
        assert!(problem("[water]\ndrag = 1.0").contains("drag"));
    }

    #[test]
    fn images_have_their_keys_and_limits() {
        let spec =
            read("[camera]\nmode = \"rendered\"\n[image]\nwater = \"coastal\"\nsnow_per_m3 = 10.0").expect("valid");
        assert_eq!((spec.camera.mode, spec.image.water), (CameraMode::Rendered, WaterKind::Coastal));
        assert!(problem("[image]\nblur_px = 11.0").contains("world.image.blur_px"));
        assert!(problem("[image]\nwater = \"muddy\"").contains("world.image"));
        assert!(problem("[image]\ndirect_per_m = [0.1, -0.1, 0.1]").contains("world.image.direct_per_m"));
        for port in ["port = \"flat\"", "port = \"dome\"\ndome_decentre_std_m = 0.001"] {
            let text = problem(&format!("[camera]\nmode = \"rendered\"\n{port}"));
            assert!(text.contains("world.camera.port") && text.contains("no single point"), "{text}");
        }
        assert!(read("[camera]\nmode = \"rendered\"\nport = \"dome\"").is_ok());
        // Worlds without images are written as ever.
        let text = WorldSpec::default().to_toml().expect("text");
        assert!(!text.contains("image") && !text.contains("mode"), "{text}");
        let rendered = read("[camera]\nmode = \"rendered\"").expect("valid").to_toml().expect("text");
        assert!(rendered.contains("turbidity = 1.0") && rendered.contains("mode = \"rendered\""), "{rendered}");
        assert_eq!(read(&rendered).expect("valid").to_toml().expect("text"), rendered);
    }

    #[test]
    fn the_text_of_a_spec_reads_back() {
        let spec = read("[camera]\nrate_hz = 10.0").expect("valid");
        assert_eq!(read(&spec.to_toml().expect("text")).expect("valid"), spec);
    }
}

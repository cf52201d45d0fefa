//! Whole table `[world]`: its sub-tables, and the checks that concern more than one of them.

use armcal_core::codes::Code;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::SimError;
use crate::fault::{self, ScheduledFault};
use crate::recorded_motion::RecordedMotion;
use crate::spec::camera::{CameraWorldSpec, ClockSpec, PortKind, TagsSpec};
use crate::spec::geometry::GeometrySpec;
use crate::spec::ground::GroundSpec;
use crate::spec::hydraulics::HydraulicsSpec;
use crate::spec::image::{CameraMode, ImageSpec};
use crate::spec::joint_sensors::JointSensorsSpec;
use crate::spec::obstacles::UnmodelledObstacles;
use crate::spec::physics::{CONTROL_PERIOD_S, EngineKind, PhysicsSpec};
use crate::spec::structure::StructureSpec;
use crate::spec::table::{CheckedTable, Figure};
use crate::spec::temperature::TemperatureSpec;
use crate::spec::vehicle::{MotionKind, VehicleMotionSpec};
use crate::spec::water::WaterSpec;
use armcal_core::robot::{FileIssue, JointSensorSpec, PartFile, Robot, check_parts, toml_problem};
use armcal_core::routine::Scene;

/// Table `[world]`, checked.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields, default)]
pub struct WorldSpec {
    /// Integrator and rates of the truth's record.
    pub physics: PhysicsSpec,
    /// Errors of the joint sensors.
    pub joint_sensors: JointSensorsSpec,
    /// Oil and water temperature, and their thermometers.
    pub temperature: TemperatureSpec,
    /// Errors of the camera's clock.
    pub clock: ClockSpec,
    /// Lens, mount and detections of the camera.
    pub camera: CameraWorldSpec,
    /// Errors of the tag survey.
    pub tags: TagsSpec,
    /// Rendered images; written if images are rendered or it was set.
    #[serde(skip_serializing_if = "ImageSpec::is_default")]
    pub image: ImageSpec,
    /// Motion of the vehicle, and its attitude sensor.
    pub vehicle: VehicleMotionSpec,
    /// Valves, oil, pump, friction, stops and controller.
    pub hydraulics: HydraulicsSpec,
    /// Density, current, waves and depth gauge.
    pub water: WaterSpec,
    /// Compliance, payload and hose; written if any is set.
    #[serde(skip_serializing_if = "StructureSpec::is_default")]
    pub structure: StructureSpec,
    /// Soft ground under the vehicle; written if it differs from the standard.
    #[serde(skip_serializing_if = "GroundSpec::is_default")]
    pub ground: GroundSpec,
    /// Errors of the arm's geometry; written if it is not as in the URDF.
    #[serde(skip_serializing_if = "GeometrySpec::is_default")]
    pub geometry: GeometrySpec,
    /// Counts per radian over the datasheet's, by joint; negative values reverse the sense. The arm's own controller
    /// knows them.
    #[schemars(extend("additionalProperties" = { "type": "number", "minimum": -100.0, "maximum": 100.0 }))]
    pub gear_ratio: BTreeMap<String, f64>,
    /// Motion that `vehicle.motion_file` names, read with the routine.
    #[serde(skip)]
    pub recorded: Option<Arc<RecordedMotion>>,
    /// True if each joint's own bounds in robot.toml limit the largest gain and offset errors: the case if a routine
    /// does not state them.
    #[serde(skip)]
    pub by_datasheet: [bool; 2],
    /// Obstacles that only the simulated world has, not the planner; with the keys of `[[obstacle]]`.
    #[serde(skip_serializing_if = "UnmodelledObstacles::is_none")]
    pub obstacle: UnmodelledObstacles,
    /// Faults in the order of the routine's `fault` steps, then the timed ones.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fault: Vec<ScheduledFault>,
}

impl WorldSpec {
    /// Reads `[world]` of the routine `file`. Each sub-table is named as the field here.
    ///
    /// # Errors
    /// [`SimError::Spec`] naming file, key and the allowed range; NaN is in no range.
    pub fn from_table(table: &toml::Table, file: &Path) -> Result<Self, SimError> {
        const TABLES: [&str; 16] = [
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
            "structure",
            "ground",
            "geometry",
            "gear_ratio",
            "obstacle",
            "fault",
        ];
        if let Some(key) = table.keys().find(|key| !TABLES.contains(&key.as_str())) {
            let problem = format!("is unknown; [world] has the tables {}", TABLES.join(", "));
            return Err(FileIssue::new(Code::KeyUnknown, file, format!("world.{key}"), problem).into());
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
            structure: reader.read("structure")?,
            ground: reader.read("ground")?,
            geometry: reader.read("geometry")?,
            gear_ratio: reader.parse("gear_ratio")?,
            recorded: None,
            by_datasheet: [false; 2],
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

    /// Reads the recorded motion that the vehicle shall follow, if any; its file is relative to `folder`.
    ///
    /// # Errors
    /// [`SimError`] naming that file, line and column.
    pub(crate) fn read_motion(&mut self, folder: &Path) -> Result<(), SimError> {
        if let Some(file) = &self.vehicle.motion_file {
            self.recorded = Some(Arc::new(RecordedMotion::read(&folder.join(file))?));
        }
        Ok(())
    }

    /// Returns the keys of the purely numeric tables with their defaults and allowed ranges.
    #[must_use]
    pub fn figures() -> Vec<Figure> {
        [
            PhysicsSpec::figures("physics"),
            JointSensorsSpec::figures("joint_sensors"),
            TemperatureSpec::figures("temperature"),
            ClockSpec::figures("clock"),
            CameraWorldSpec::figures("camera"),
            TagsSpec::figures("tags"),
            ImageSpec::figures("image"),
            VehicleMotionSpec::figures("vehicle"),
            HydraulicsSpec::figures("hydraulics"),
            GroundSpec::figures("ground"),
            GeometrySpec::figures("geometry"),
        ]
        .concat()
    }

    /// Returns the spec as TOML, every key written out.
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

    /// Returns the true scene: the nominal one and the unmodelled obstacles.
    ///
    /// # Errors
    /// None for a checked spec.
    pub(crate) fn true_scene(&self, drawn: &Scene) -> Result<Scene, SimError> {
        let (undrawn, _) = check_parts(&self.obstacle.0, Path::new("[world]"), "obstacle")?;
        let obstacles = drawn.obstacles.iter().cloned().chain(undrawn).collect();
        Ok(Scene { obstacles, ..*drawn })
    }

    /// Fills in values that only the robot has.
    #[must_use]
    pub fn completed(mut self, robot: &Robot) -> Self {
        self.water.buoyancy_fraction.get_or_insert(robot.buoyancy_fraction);
        self
    }

    /// Returns the engine that moves the arm: the named one, else rapier's multibody unless the vehicle floats.
    #[must_use]
    pub fn engine(&self) -> EngineKind {
        let by_default = if self.vehicle_floats() { EngineKind::Featherstone } else { EngineKind::Rapier };
        self.physics.engine.unwrap_or(by_default)
    }

    /// Returns true if the vehicle is a body of the equations of motion: it floats free or is parked.
    #[must_use]
    pub fn vehicle_floats(&self) -> bool {
        matches!(self.vehicle.motion, MotionKind::Free | MotionKind::Parked)
    }

    /// Refuses keys that rapier cannot simulate.
    fn check_engine(&self, file: &Path) -> Result<(), FileIssue> {
        if self.engine() != EngineKind::Rapier {
            return Ok(());
        }
        if self.vehicle_floats() {
            let problem = "\"rapier\" has no vehicle that floats (motion = \"free\", \"parked\"): use \"featherstone\"";
            return Err(FileIssue::new(Code::KeysConflict, file, "world.physics.engine", problem));
        }
        let (physics, usual) = (&self.physics, PhysicsSpec::default());
        let softness = [
            ("contact_stiffness_n_m", physics.contact_stiffness_n_m, usual.contact_stiffness_n_m),
            ("contact_damping_s", physics.contact_damping_s, usual.contact_damping_s),
        ];
        match softness.iter().find(|(_, asked, usual)| asked != usual) {
            None => Ok(()),
            Some((key, ..)) => {
                let problem =
                    "contacts of \"rapier\" have a softness of their own: set engine = \"featherstone\" beside it";
                Err(FileIssue::new(Code::KeysConflict, file, format!("world.physics.{key}"), problem))
            }
        }
    }

    /// Returns the largest gain error (relative) and offset error (rad) with which a joint's sensor may be built.
    #[must_use]
    pub fn sensor_errors_max(&self, sensor: &JointSensorSpec) -> [f64; 2] {
        let asked = [self.joint_sensors.gain_error_max, self.joint_sensors.offset_error_max_rad];
        let bounds = [sensor.gain_bound, sensor.offset_bound_rad];
        std::array::from_fn(|k| if self.by_datasheet[k] { asked[k].min(bounds[k]) } else { asked[k] })
    }

    /// Returns a warning for each error limit that exceeds a joint's bound in robot.toml, so that no margin covers it.
    #[must_use]
    pub fn beyond_datasheet(&self, robot: &Robot) -> Vec<String> {
        let keys = [("gain_error_max", "gain_bound"), ("offset_error_max_rad", "offset_bound_rad")];
        let beyond = |(k, (key, bound)): (usize, (&str, &str))| {
            let bounds = robot.sensors.iter().map(|sensor| ([sensor.gain_bound, sensor.offset_bound_rad][k], sensor));
            let (least, sensor) = bounds.min_by(|a, b| a.0.total_cmp(&b.0))?;
            let asked = self.sensor_errors_max(sensor)[k];
            (asked > least).then(|| {
                format!(
                    "world.joint_sensors.{key} = {asked} is beyond {bound} = {least} of `{}` in robot.toml: margins do \
                     not hold what the world draws",
                    sensor.joint
                )
            })
        };
        keys.into_iter().enumerate().filter_map(beyond).collect()
    }

    /// Returns the number of physics steps in a control period.
    #[must_use]
    pub fn steps_per_period(&self) -> u64 {
        (CONTROL_PERIOD_S / self.physics.step_s).round() as u64
    }

    /// Returns the time of a physics step, s.
    pub(crate) fn time_s(&self, step: u64) -> f64 {
        // Multiplied, not summed, so that whole periods have whole stamps.
        step as f64 / self.steps_per_period() as f64 * CONTROL_PERIOD_S
    }

    /// Refuses rendered images through a port without a single viewpoint: their rays pass through one point.
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
        Err(FileIssue::new(Code::KeysConflict, file, "world.camera.port", problem))
    }

    fn check_relations(&self, file: &Path) -> Result<(), FileIssue> {
        let (min, max) = (self.vehicle.period_min_s, self.vehicle.period_max_s);
        if min > max {
            let problem = format!("{max} is below period_min_s, {min}");
            return Err(FileIssue::new(Code::ValueOutOfRange, file, "world.vehicle.period_max_s", problem));
        }
        let is_recorded = self.vehicle.motion == MotionKind::Recorded;
        if is_recorded != self.vehicle.motion_file.is_some() {
            let problem = "goes with motion = \"recorded\", and that with it";
            return Err(FileIssue::new(Code::KeysConflict, file, "world.vehicle.motion_file", problem));
        }
        self.check_engine(file)?;
        if self.vehicle.motion == MotionKind::Parked && self.ground.vehicle_weight_n <= 0.0 {
            let problem = "must be above 0 for [world.vehicle] motion = \"parked\"";
            return Err(FileIssue::new(Code::ValueOutOfRange, file, "world.ground.vehicle_weight_n", problem));
        }
        let step_s = self.physics.step_s;
        if (self.steps_per_period() as f64 * step_s - CONTROL_PERIOD_S).abs() > 1e-9 {
            let problem = format!("{step_s} does not divide the control period of {CONTROL_PERIOD_S} s");
            return Err(FileIssue::new(Code::ValueInvalid, file, "world.physics.step_s", problem));
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
                FileIssue::syntax(self.file, format!("world.{name}"), toml_problem(&error))
            }),
        }
    }
}

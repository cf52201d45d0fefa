//! The routine's `[world]`: how far the truth differs from the drawings.
//!
//! Every key is optional; a missing one takes the figure of the standard world. Angles are rad, temperatures Celsius.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::error::SimError;
use super::fault::Fault;
use crate::robot::{FileIssue, Robot};

/// Length of a control period, s: the arm's own controller runs at 100 Hz.
pub(super) const CONTROL_PERIOD_S: f64 = 0.01;

/// Defines one table of `[world]`: fields, defaults, allowed ranges (inclusive).
macro_rules! table {
    ($(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident = $default:expr, in $range:expr;)+ }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $($(#[$field_doc])* pub $field: f64,)+
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)+ }
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

trait CheckedTable: DeserializeOwned + Default {
    fn check(&self, file: &Path, table: &str) -> Result<(), FileIssue>;
}

const DEG: f64 = std::f64::consts::PI / 180.0;

table!(
    /// Errors of the joint sensors; see `sensors::pot` for the equation.
    JointSensorsSpec {
        /// Relative gain error, uniform in +- this, about the middle of the joint's range.
        gain_error_max = 0.05, in 0.0..=0.5;
        /// Offset error, uniform in +- this.
        offset_error_max_rad = 5.0 * DEG, in 0.0..=1.0;
        /// Peak of the smooth nonlinearity, as a fraction of the joint's range.
        nonlinearity_peak = 0.001, in 0.0..=0.2;
        /// Standard deviation over joints.
        temperature_offset_std_rad_per_k = 0.02 * DEG, in 0.0..=0.1;
        /// Standard deviation over joints, relative gain per K.
        temperature_gain_std_per_k = 20e-6, in 0.0..=0.01;
        /// Oil temperature at which the temperature terms vanish.
        reference_c = 10.0, in -10.0..=80.0;
        /// Random walk of the offset.
        drift_rad_per_sqrt_h = 0.02 * DEG, in 0.0..=0.1;
        /// Full width of the play between joint and sensor shaft.
        backlash_rad = 0.02 * DEG, in 0.0..=0.1;
        noise_rms_counts = 1.5, in 0.0..=1000.0;
        /// Step of the converter; 0 for none.
        resolution_counts = 1.0, in 0.0..=1000.0;
    }
);

table!(
    /// Oil and water. The oil warms as `start + rise * (1 - exp(-t / time constant))`.
    TemperatureSpec {
        water_c = 4.0, in -3.0..=40.0;
        oil_start_c = 10.0, in -3.0..=80.0;
        oil_rise_k = 8.0, in 0.0..=60.0;
        /// 300 s: 6.9 K of the 8 K within 10 minutes.
        oil_time_constant_s = 300.0, in 1.0..=1e5;
        /// Noise of both thermometers.
        thermometer_noise_k = 0.05, in 0.0..=5.0;
        /// The water changes by this much in the long run (a dive into colder water); the oil follows with its own time
        /// constant.
        water_change_k = 0.0, in -60.0..=60.0;
        water_time_constant_s = 1800.0, in 1.0..=1e6;
    }
);

table!(
    /// The camera's clock against the joint sensors'.
    ClockSpec {
        /// Its stamps are late by this, on average.
        camera_latency_s = 0.020, in 0.0..=1.0;
        /// Standard deviation of the lateness.
        camera_jitter_s = 0.005, in 0.0..=0.2;
    }
);

table!(
    /// The wrist camera and its detector.
    CameraWorldSpec {
        /// Standard deviation per corner coordinate at 1 m, seen head-on; see `sensors::camera` for how it grows.
        corner_noise_px = 0.3, in 0.0..=20.0;
        /// Share of visible tags that the detector misses.
        miss_probability = 0.02, in 0.0..=1.0;
        /// Standard deviation per axis of the mount's error.
        mount_std_rad = 0.2 * DEG, in 0.0..=0.5;
        mount_std_m = 0.002, in 0.0..=0.2;
        rate_hz = 5.0, in 0.1..=100.0;
        max_range_m = 2.5, in 0.1..=50.0;
        /// Angle between the tag's normal and the line of sight.
        max_incidence_rad = 70.0 * DEG, in 0.1..=1.55;
        /// Shortest side in the image that the detector still decodes.
        min_side_px = 16.0, in 1.0..=1000.0;
    }
);

table!(
    /// How well the tags were surveyed.
    TagsSpec {
        survey_std_m = 0.001, in 0.0..=0.2;
        survey_std_rad = 0.2 * DEG, in 0.0..=0.5;
    }
);

table!(
    /// The vehicle's motion about its station, and its attitude sensor.
    VehicleMotionSpec {
        /// Of roll, pitch and yaw each.
        rotation_rms_rad = 0.5 * DEG, in 0.0..=0.3;
        /// In each direction.
        translation_rms_m = 0.03, in 0.0..=2.0;
        period_min_s = 5.0, in 0.5..=600.0;
        period_max_s = 15.0, in 0.5..=600.0;
        /// The motion swells over this time at the start.
        ramp_s = 5.0, in 0.0..=600.0;
        attitude_noise_rad = 0.05 * DEG, in 0.0..=0.2;
        gyro_noise_rad_s = 5e-4, in 0.0..=1.0;
        accelerometer_noise_m_s2 = 0.02, in 0.0..=10.0;
    }
);

table!(
    /// Valves, oil, pump, and the arm's own controller. Torque limits come from the URDF's effort.
    HydraulicsSpec {
        /// Share of the spool's travel that passes no oil; the controller compensates it.
        deadband = 0.03, in 0.0..=0.5;
        valve_lag_s = 0.05, in 1e-3..=1.0;
        pump_flow_l_min = 12.0, in 0.1..=1000.0;
        supply_pressure_pa = 2.07e7, in 1e5..=1e8;
        /// Effective bulk modulus of oil, hoses and entrained air.
        bulk_modulus_pa = 1.0e9, in 1e7..=1e11;
        /// Oil between valve and actuator over the actuator's own.
        dead_volume_ratio = 2.0, in 0.0..=100.0;
        /// Damping of the oil column over its stiffness.
        damping_s = 0.01, in 0.0..=1.0;
        /// Creep of a closed valve under the full torque.
        leakage_rad_s = 0.0, in 0.0..=1.0;
        /// Relief valves open at this multiple of the full torque.
        relief_ratio = 1.2, in 1.0..=10.0;
        /// Rate of a fully open valve without load, over the controller's rate limit.
        rate_margin = 1.3, in 1.0..=10.0;
        controller_gain_per_s = 4.0, in 0.1..=50.0;
        /// Low-pass filter of the controller's readings.
        controller_filter_s = 0.05, in 0.0..=1.0;
        /// Below this error the controller closes the valve; it opens it again at twice the error.
        rest_band_rad = 0.02 * DEG, in 1e-6..=0.1;
        /// The controller drives each sensor to its set-point plus this, by the datasheet's scale.
        controller_bias_rad = 0.0, in -0.5..=0.5;
    }
);

/// Sea water about the arm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WaterSpec {
    pub density_kg_m3: f64,
    /// Of every link, per axis of its shapes.
    pub drag_coefficient: f64,
    /// Weight of the displaced water over the arm's own; the robot's own figure where there is none.
    pub buoyancy_fraction: Option<f64>,
    /// Linear friction of each joint, for slow motion.
    pub joint_friction_n_m_s_rad: f64,
    /// Of the vehicle's station below the surface.
    pub depth_m: f64,
    pub pressure_noise_pa: f64,
}

impl Default for WaterSpec {
    fn default() -> Self {
        Self {
            density_kg_m3: 1025.0,
            drag_coefficient: 1.2,
            buoyancy_fraction: None,
            joint_friction_n_m_s_rad: 5.0,
            depth_m: 500.0,
            pressure_noise_pa: 200.0,
        }
    }
}

impl WaterSpec {
    /// Weight of the displaced water over the arm's own: as set here, else none at all.
    pub(super) fn buoyancy(&self) -> f64 {
        self.buoyancy_fraction.unwrap_or(0.0)
    }
}

impl CheckedTable for WaterSpec {
    fn check(&self, file: &Path, table: &str) -> Result<(), FileIssue> {
        let check =
            |key: &str, value: f64, range| FileIssue::check_range(file, &format!("{table}.{key}"), value, range);
        check("density_kg_m3", self.density_kg_m3, 0.0..=2000.0)?;
        check("drag_coefficient", self.drag_coefficient, 0.0..=10.0)?;
        check("buoyancy_fraction", self.buoyancy(), 0.0..=0.95)?;
        check("joint_friction_n_m_s_rad", self.joint_friction_n_m_s_rad, 0.0..=1e4)?;
        check("depth_m", self.depth_m, 0.0..=12000.0)?;
        check("pressure_noise_pa", self.pressure_noise_pa, 0.0..=1e6)?;
        Ok(())
    }
}

/// `[world]`, checked.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WorldSpec {
    pub physics: PhysicsSpec,
    pub joint_sensors: JointSensorsSpec,
    pub temperature: TemperatureSpec,
    pub clock: ClockSpec,
    pub camera: CameraWorldSpec,
    pub tags: TagsSpec,
    pub vehicle: VehicleMotionSpec,
    pub hydraulics: HydraulicsSpec,
    pub water: WaterSpec,
    /// By joint: counts per radian over the datasheet's. Negative: they run the other way. The arm's own controller knows.
    pub gear_ratio: BTreeMap<String, f64>,
    /// What breaks, in the order of the routine's `fault` steps.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fault: Vec<Fault>,
}

table!(
    /// The integrator and the rate of the truth's record.
    PhysicsSpec {
        /// Step of the rigid-body integration; a control period (10 ms) must be a whole number of steps.
        step_s = 0.002, in 5e-5..=0.005;
        /// Rate of the truth's states, at most that of the controller.
        truth_rate_hz = 50.0, in 0.1..=100.0;
        /// Rate at which the clearance is measured.
        clearance_rate_hz = 5.0, in 0.1..=100.0;
    }
);

impl WorldSpec {
    /// Reads `[world]` of the routine `file`. Each sub-table is named as the field here.
    ///
    /// # Errors
    /// [`SimError::Spec`] naming file, key and the allowed range; NaN is in no range.
    pub fn from_table(table: &toml::Table, file: &Path) -> Result<Self, SimError> {
        const TABLES: [&str; 10] = [
            "physics",
            "joint_sensors",
            "temperature",
            "clock",
            "camera",
            "tags",
            "vehicle",
            "hydraulics",
            "water",
            "gear_ratio",
        ];
        // Faults come with a routine's steps; in a spec's own text they stand beside the tables.
        if let Some(key) = table.keys().find(|key| !TABLES.contains(&key.as_str()) && *key != "fault") {
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
            vehicle: reader.read("vehicle")?,
            hydraulics: reader.read("hydraulics")?,
            water: reader.read("water")?,
            gear_ratio: reader.parse("gear_ratio")?,
            fault: reader.parse("fault")?,
        };
        for (joint, ratio) in &spec.gear_ratio {
            let key = format!("world.gear_ratio.{joint} (size)");
            FileIssue::check_range(file, &key, ratio.abs(), 0.01..=100.0)?;
        }
        spec.check_relations(file)?;
        Ok(spec)
    }

    /// As TOML, every key written out.
    ///
    /// # Errors
    /// [`SimError::SpecText`], which no checked spec causes.
    pub fn to_toml(&self) -> Result<String, SimError> {
        Ok(toml::to_string(self)?)
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

    fn check_relations(&self, file: &Path) -> Result<(), FileIssue> {
        let (min, max) = (self.vehicle.period_min_s, self.vehicle.period_max_s);
        if min > max {
            let problem = format!("{max} is below period_min_s, {min}");
            return Err(FileIssue::new(file, "world.vehicle.period_max_s", problem));
        }
        let step_s = self.physics.step_s;
        if (self.steps_per_period() as f64 * step_s - CONTROL_PERIOD_S).abs() > 1e-9 {
            let problem = format!("{step_s} does not divide the control period of {CONTROL_PERIOD_S} s");
            return Err(FileIssue::new(file, "world.physics.step_s", problem));
        }
        Ok(())
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
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots").join(arm);
            let robot = crate::robot::load(&folder).expect("the robot reads");
            let spec = |text: &str| read(text).expect("valid").completed(&robot);
            assert_eq!(spec("").water.buoyancy(), fraction);
            assert_eq!(spec("[water]\nbuoyancy_fraction = 0.5").water.buoyancy(), 0.5);
            assert!(spec("").to_toml().expect("text").contains(&format!("buoyancy_fraction = {fraction}")));
        }
        assert!(problem("[water]\nbuoyancy_fraction = 1.0").contains("world.water.buoyancy_fraction"));
        assert!(problem("[water]\ndrag = 1.0").contains("drag"));
    }

    #[test]
    fn the_text_of_a_spec_reads_back() {
        let spec = read("[camera]\nrate_hz = 10.0").expect("valid");
        assert_eq!(read(&spec.to_toml().expect("text")).expect("valid"), spec);
    }
}

//! Expected oil consumption and tracking errors of the arm's drives.
//!
//! `[hydraulics]` and `[motion]` of robot.toml, both optional. The estimator uses them; the simulator reads neither.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use super::error::FileIssue;
use super::urdf::UrdfModel;

/// Properties of the drives by their datasheets.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveSpec {
    /// Oil flow shared by all joints, L/min; `None`: unlimited.
    pub pump_l_per_min: Option<f64>,
    /// Oil per radian of each joint, L/rad.
    pub displacement_l_per_rad: Vec<f64>,
    /// Tracking error of all joints.
    pub motion: MotionSpec,
}

/// Tracking error of a moving joint: its own sensor against its set-point.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSpec {
    /// Largest time by which a joint lags or leads its set-points, s.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub lag_spread_s: f64,
    /// Overshoot at the end of a motion at the joint's full rate, rad; in proportion to the rate.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub overshoot_rad: f64,
    /// Error under load at the joint's full rate, rad; in proportion to the rate.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub droop_rad: f64,
}

/// Values of a loop with rate feed-forward through valves of 20 to 80 ms: assumed, except the overshoot, which was
/// measured on simulated arms (`armcal inspect --robot`).
impl Default for MotionSpec {
    fn default() -> Self {
        Self { lag_spread_s: 0.05, overshoot_rad: 0.06, droop_rad: 0.005 }
    }
}

#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct HydraulicsFile {
    /// Flow of the pump.
    #[schemars(range(min = 0.01, max = 1e4))]
    pump_l_per_min: f64,
}

/// Supply pressure: 3000 psi, the upper end of the datasheets, at which a joint gives the URDF's effort.
const SUPPLY_PRESSURE_PA: f64 = 2.07e7;
const L_PER_M3: f64 = 1e3;

/// Oil per radian of a joint, L/rad: its largest torque (force of a slide, L/m) divided by the supply pressure.
pub(super) fn usual_displacement(urdf: &UrdfModel, joint: &str) -> f64 {
    L_PER_M3 * urdf.effort_n_m(joint) / SUPPLY_PRESSURE_PA
}

impl HydraulicsFile {
    pub fn check(self, file: &Path) -> Result<f64, FileIssue> {
        FileIssue::check_range(file, "hydraulics.pump_l_per_min", self.pump_l_per_min, 0.01..=1e4)
    }
}

impl MotionSpec {
    pub(super) fn check(self, file: &Path) -> Result<Self, FileIssue> {
        FileIssue::check_range(file, "motion.lag_spread_s", self.lag_spread_s, 0.0..=5.0)?;
        FileIssue::check_range(file, "motion.overshoot_rad", self.overshoot_rad, 0.0..=0.5)?;
        FileIssue::check_range(file, "motion.droop_rad", self.droop_rad, 0.0..=0.5)?;
        Ok(self)
    }
}

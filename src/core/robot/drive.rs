//! What belief expects of the arm's hydraulics: oil for the joints' motion, and how far they stray from their set-points.
//!
//! `[hydraulics]` and `[motion]` of robot.toml, both optional. The simulator reads neither.

use std::path::Path;

use serde::Deserialize;

use super::error::FileIssue;
use super::urdf::UrdfModel;

/// The drives as the datasheets have them.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveSpec {
    /// Oil that all joints share, L/min; `None`: no limit is known.
    pub pump_l_per_min: Option<f64>,
    /// Oil that each joint takes a radian, L/rad.
    pub displacement_l_per_rad: Vec<f64>,
    pub motion: MotionSpec,
}

/// How far a joint strays from its set-point while it moves, by its own sensor.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSpec {
    /// Largest time by which a joint is behind, or ahead of, its set-points, s.
    pub lag_spread_s: f64,
    /// Beyond the end of a motion at the joint's full rate, rad; in proportion to the rate.
    pub overshoot_rad: f64,
    /// What the load takes from a joint that moves at its full rate, rad; in proportion to the rate.
    pub droop_rad: f64,
}

/// For a loop with feed-forward of the rate through valves of 20 to 80 ms: assumed, and the overshoot measured on simulated arms
/// (`armcal study stray`).
impl Default for MotionSpec {
    fn default() -> Self {
        Self { lag_spread_s: 0.05, overshoot_rad: 0.06, droop_rad: 0.005 }
    }
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HydraulicsFile {
    pump_l_per_min: f64,
}

/// 3000 psi, the datasheets' upper end: at it a joint gives the URDF's effort.
const SUPPLY_PRESSURE_PA: f64 = 2.07e7;
const L_PER_M3: f64 = 1e3;

/// Of each sensor's joint, L/rad: as the file says, else its torque at the full supply pressure over that pressure.
pub(super) fn check_displacements<'a>(
    file: &Path,
    joints: impl Iterator<Item = (&'a str, Option<f64>)>,
    urdf: &UrdfModel,
) -> Result<Vec<f64>, FileIssue> {
    let check = |(joint, given): (&str, Option<f64>)| match given {
        None => Ok(L_PER_M3 * urdf.effort_n_m(joint) / SUPPLY_PRESSURE_PA),
        Some(value) => {
            let key = format!("joint_sensor `{joint}`: displacement_l_per_rad");
            FileIssue::check_range(file, &key, value, 0.0..=100.0)
        }
    };
    joints.map(check).collect()
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

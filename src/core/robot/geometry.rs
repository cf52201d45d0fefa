//! How well the drawing is known: standard deviations of link geometry, tool point and compliances.

use std::path::Path;

use nalgebra::Vector3;
use serde::Deserialize;

use super::error::FileIssue;

/// One sigma of each axis, about the drawing. `[geometry]` of robot.toml; the defaults are those of a machined arm that
/// was never bent (assumed).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GeometryPriors {
    /// Of each joint's place in its parent link, m.
    pub link_position_std_m: f64,
    /// Of each joint's attitude in its parent link, rad.
    pub link_rotation_std_rad: f64,
    /// Of the tool point in its link, m.
    pub tool_position_std_m: f64,
    /// Of how much each joint turns behind its sensor under a torque, rad/(N m).
    pub joint_compliance_std_rad_per_nm: f64,
    /// Of how much the base turns on what carries it, about each of its axes, rad/(N m).
    pub mount_compliance_std_rad_per_nm: f64,
    /// Of a load in the gripper, weight less buoyancy, N.
    pub tool_load_std_n: f64,
    /// Against gravity, in the base frame; of any length.
    pub up: [f64; 3],
}

impl Default for GeometryPriors {
    fn default() -> Self {
        Self {
            link_position_std_m: 5e-4,
            link_rotation_std_rad: 5e-4,
            tool_position_std_m: 5e-4,
            joint_compliance_std_rad_per_nm: 1e-6,
            mount_compliance_std_rad_per_nm: 1e-6,
            tool_load_std_n: 200.0,
            up: [0.0, 0.0, 1.0],
        }
    }
}

impl GeometryPriors {
    pub(super) fn check(self, file: &Path) -> Result<Self, FileIssue> {
        for (key, value, most) in [
            ("link_position_std_m", self.link_position_std_m, 1.0),
            ("link_rotation_std_rad", self.link_rotation_std_rad, 1.0),
            ("tool_position_std_m", self.tool_position_std_m, 1.0),
            ("joint_compliance_std_rad_per_nm", self.joint_compliance_std_rad_per_nm, 1e-2),
            ("mount_compliance_std_rad_per_nm", self.mount_compliance_std_rad_per_nm, 1e-2),
            ("tool_load_std_n", self.tool_load_std_n, 1e5),
            ("up (length)", Vector3::from(self.up).norm() - 1e-6, 1e3),
        ] {
            FileIssue::check_range(file, &format!("geometry.{key}"), value, 0.0..=most)?;
        }
        Ok(self)
    }
}

//! `[sag]` of calibration.toml: compliance of the arm under its weight.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::solve::covariance::ParameterCovariance;
use armcal_core::kinematics::Sag;
use armcal_core::robot::{FileIssue, Robot};

/// Compliances under the torques of weight minus buoyancy, from the URDF's masses at the measured angles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SagTable {
    /// Rotation of the base on its mounting about the base's axes, rad/(N m).
    pub mount_rad_per_nm: [f64; 3],
    /// Standard deviation of `mount_rad_per_nm`.
    pub mount_std_rad_per_nm: [f64; 3],
    /// Weight minus buoyancy at the tool point beyond the URDF's, N.
    pub tool_load_n: f64,
    /// Standard deviation of the tool load, N.
    pub tool_load_std_n: f64,
    /// Compliance of each joint that the views determine.
    pub joint: Vec<JointCompliance>,
}

/// Compliance of a joint: its rotation behind the sensor per torque.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointCompliance {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// Compliance, rad/(N m).
    pub rad_per_nm: f64,
    /// Standard deviation of the compliance.
    pub std_rad_per_nm: f64,
}

impl SagTable {
    /// Returns the table; `None` if `covariance` has no compliances.
    pub(crate) fn of(robot: &Robot, at: &JointParameters, covariance: &ParameterCovariance) -> Option<Self> {
        let std = |joint, kind| covariance.std(Parameter { joint, kind });
        let tool_load_std_n = std(0, ParameterKind::ToolLoad)?;
        let sag = &at.links.sag;
        let joint = robot.sensors.iter().enumerate().filter_map(|(joint, spec)| {
            let std_rad_per_nm = std(joint, ParameterKind::Compliance)?;
            Some(JointCompliance { joint: spec.joint.clone(), rad_per_nm: sag.joint_rad_per_nm[joint], std_rad_per_nm })
        });
        Some(Self {
            mount_rad_per_nm: sag.mount_rad_per_nm,
            mount_std_rad_per_nm: [0, 1, 2].map(|axis| std(0, ParameterKind::MountCompliance(axis)).unwrap_or(0.0)),
            tool_load_n: sag.tool_load_n,
            tool_load_std_n,
            joint: joint.collect(),
        })
    }

    /// Returns the compliance of the arm whose joints have these names, base first.
    pub(crate) fn sag<'a>(&self, joints: impl Iterator<Item = &'a str>) -> Sag {
        let (mount_rad_per_nm, tool_load_n) = (self.mount_rad_per_nm, self.tool_load_n);
        let mut sag = Sag { mount_rad_per_nm, tool_load_n, ..Sag::default() };
        for (rad_per_nm, joint) in sag.joint_rad_per_nm.iter_mut().zip(joints) {
            let known = self.joint.iter().find(|known| known.joint == joint);
            *rad_per_nm = known.map_or(0.0, |known| known.rad_per_nm);
        }
        sag
    }

    pub(crate) fn check(&self, file: &Path) -> Result<(), FileIssue> {
        for (key, value) in self
            .joint
            .iter()
            .map(|joint| ("sag.joint.rad_per_nm", joint.rad_per_nm))
            .chain(self.mount_rad_per_nm.map(|value| ("sag.mount_rad_per_nm", value)))
        {
            FileIssue::check_range(file, key, value, -1.0..=1.0)?;
        }
        FileIssue::check_range(file, "sag.tool_load_n", self.tool_load_n, -1e6..=1e6).map(|_| ())
    }
}

//! `[[link]]` of calibration.toml: link geometry that was estimated.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::solve::covariance::ParameterCovariance;
use armcal_core::kinematics::LinkCorrection;
use armcal_core::robot::Robot;

/// Correction of a joint's pose on its parent link, beyond the URDF's `origin`, in the parent link's frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinkResult {
    /// Name of the joint.
    pub joint: String,
    /// Shift of the joint's origin, m.
    pub shift_m: [f64; 3],
    /// Rotation of the joint's frame, applied before the URDF's: a rotation vector, rad.
    pub turn_rad: [f64; 3],
    /// Standard deviation of the shift, m.
    pub shift_std_m: [f64; 3],
    /// Standard deviation of the rotation, rad.
    pub turn_std_rad: [f64; 3],
}

impl LinkResult {
    /// Returns the correction of each joint whose link geometry is in `covariance`.
    pub(crate) fn all(robot: &Robot, at: &JointParameters, covariance: &ParameterCovariance) -> Vec<Self> {
        let one = |(joint, spec): (usize, &armcal_core::robot::JointSensorSpec)| {
            let std = |kind| covariance.std(Parameter { joint, kind });
            std(ParameterKind::LinkShift(0))?;
            let LinkCorrection { shift_m, turn_rad } = at.links[joint];
            Some(Self {
                joint: spec.joint.clone(),
                shift_m: shift_m.into(),
                turn_rad: turn_rad.into(),
                shift_std_m: [0, 1, 2].map(|axis| std(ParameterKind::LinkShift(axis)).unwrap_or(0.0)),
                turn_std_rad: [0, 1, 2].map(|axis| std(ParameterKind::LinkTurn(axis)).unwrap_or(0.0)),
            })
        };
        robot.sensors.iter().enumerate().filter_map(one).collect()
    }

    pub(crate) fn correction(&self) -> LinkCorrection {
        LinkCorrection { shift_m: self.shift_m.into(), turn_rad: self.turn_rad.into() }
    }
}

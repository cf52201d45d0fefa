//! Motion of frames on the arm by parameters of its body: link geometry, and bending under its weight.

use std::ops::Range;

use nalgebra::Vector3;

use crate::model::parameters::{Parameter, ParameterKind};
use armcal_core::kinematics::{AboutAxes, ArmLoads, Chain, LinkPoses, Sag};

/// A bending arm at one configuration.
pub(crate) struct SagPoint {
    sag: Sag,
    /// Torque of all weights about the joint axes, N m.
    torques: AboutAxes,
    /// Torque of one newton at the tool about the joint axes, N m.
    by_tool: AboutAxes,
}

impl SagPoint {
    pub(crate) fn new(loads: &ArmLoads, sag: &Sag, poses: &LinkPoses) -> Self {
        let (torques, by_tool) = (loads.torques(poses, sag.tool_load_n), loads.torques_by_tool(poses));
        Self { sag: *sag, torques, by_tool }
    }

    /// Turns about the axes by a parameter of sag, rad per unit; none for others.
    pub(crate) fn turns(&self, Parameter { joint, kind }: Parameter) -> AboutAxes {
        let mut turns = AboutAxes::default();
        match kind {
            ParameterKind::Compliance => turns.joints[joint] = self.torques.joints[joint],
            ParameterKind::MountCompliance(axis) => {
                turns.base[usize::from(axis)] = self.torques.base[usize::from(axis)];
            }
            ParameterKind::ToolLoad => turns = self.sag.bend(&self.by_tool),
            _ => {}
        }
        turns
    }
}

impl Parameter {
    /// Motion of a frame at `point_m` (base frame) behind `joints` of `chain`, per unit: its point m, itself about the
    /// base's axes rad; `None` for parameters of sensors.
    pub(crate) fn body_motion(
        self,
        chain: &Chain,
        poses: &LinkPoses,
        joints: Range<usize>,
        point_m: &Vector3<f64>,
    ) -> Option<[Vector3<f64>; 2]> {
        let along = |axis: u8| poses.link(self.joint).rotation * Vector3::ith(usize::from(axis), 1.0);
        match self.kind {
            kind if kind.is_of_sag() => {
                let at = SagPoint::new(chain.loads(), chain.sag(), poses);
                Some(at.turns(self).motion(poses, joints, point_m))
            }
            _ if !joints.contains(&self.joint) => None,
            ParameterKind::LinkShift(axis) => Some([along(axis), Vector3::zeros()]),
            ParameterKind::LinkTurn(axis) => {
                let turned = along(axis);
                Some([turned.cross(&(point_m - poses.joint_origin(self.joint))), turned])
            }
            _ => None,
        }
    }
}

//! Joints that are declared to have failed, in a plan before any motion.
//!
//! A locked joint does not move, and a joint without a sensor must not: the plan holds each at one angle, as a session
//! holds a joint that it has found failed. Joints whose sensor slips are moved.

use crate::file::calibration::Calibration;
use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::constants::bounds_estimate_bounds::{AT_REST_RAD, SIGMAS};
use armcal_core::codes::{Code, Warning};
use armcal_core::robot::{FailedJoint, FailedKind, Robot};
use armcal_core::streams::JointAngles;

/// The arm with its failed joints held.
pub(crate) struct HeldArm {
    /// Arm whose failed joints have a range of one angle.
    pub robot: Robot,
    /// Error bounds with those of the held joints.
    pub bounds: JointErrorBounds,
    /// Assumptions about the held joints.
    pub warnings: Vec<Warning>,
}

impl HeldArm {
    /// Returns the arm with each failed joint at its angle in `calibration`, else at its stowed one.
    pub fn new(robot: &Robot, bounds: &JointErrorBounds, calibration: Option<&Calibration>) -> Self {
        let mut held = Self { robot: robot.clone(), bounds: bounds.clone(), warnings: Vec::new() };
        for failed in robot.failed.iter().filter(|failed| failed.kind != FailedKind::Jumps) {
            let stowed_rad = robot.stowed[failed.joint];
            let stowed = (stowed_rad, bounds.error_rad(failed.joint, stowed_rad));
            let located = calibration.and_then(|calibration| located(calibration, robot, failed.joint));
            held.hold(failed, located.unwrap_or(stowed));
        }
        held
    }

    fn hold(&mut self, failed: &FailedJoint, (angle_rad, bound_rad): (f64, f64)) {
        self.robot.chain = self.robot.chain.locked(failed.joint, angle_rad);
        self.robot.stowed[failed.joint] = angle_rad;
        self.bounds.hold(failed.joint, angle_rad, bound_rad);
        let text = format!(
            "{} {}: the plan holds it at {:.1} deg, within {:.1} deg; see that it stands there, and keep its reading \
             as its set-point",
            self.robot.sensors[failed.joint].joint,
            failed.kind.predicate(),
            angle_rad.to_degrees(),
            bound_rad.to_degrees()
        );
        self.warnings.push(Warning::new(Code::JointAssumed, text));
    }

    /// Returns `angles` with the held joints where they are held.
    pub fn with_held(&self, angles: &JointAngles) -> JointAngles {
        let joints = self.robot.chain.joints();
        JointAngles::from_fn(angles.len(), |j| match joints[j].limits {
            Some(limits) if limits.are_locked() => limits.lower_rad,
            _ => angles[j],
        })
    }
}

/// Returns the angle of a locked joint and its bound, rad, where a calibration has found them.
fn located(calibration: &Calibration, robot: &Robot, joint: usize) -> Option<(f64, f64)> {
    let name = &robot.sensors[joint].joint;
    let table = calibration.failed_joint.iter().find(|table| table.joint == *name)?;
    let (angle_rad, std_rad) = table.angle_rad.zip(table.angle_std_rad)?;
    Some((angle_rad, SIGMAS * std_rad + AT_REST_RAD))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn joints_without_a_sensor_are_held_and_slipping_ones_move() {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
        let kinds = [FailedKind::Locked, FailedKind::Dead, FailedKind::Stuck, FailedKind::Jumps];
        let failed: Vec<FailedJoint> = (0..).zip(kinds).map(|(joint, kind)| FailedJoint { joint, kind }).collect();
        let robot = armcal_core::robot::load(&folder).expect("the robot reads").with_failed(&failed);
        let bounds = JointErrorBounds::datasheet(&robot);
        let held = HeldArm::new(&robot, &bounds, None);
        let elsewhere = JointAngles::from_fn(robot.n_joints(), |joint| robot.stowed[joint] + 0.1);
        let put = held.with_held(&elsewhere);
        for joint in 0..robot.n_joints() {
            let is_held = joint < 3;
            let to_rad = if is_held { robot.stowed[joint] } else { elsewhere[joint] };
            assert_eq!(put[joint], to_rad, "joint {joint}");
            let at_stowed_rad = bounds.error_rad(joint, robot.stowed[joint]);
            assert_eq!(held.bounds.error_rad(joint, robot.stowed[joint]), at_stowed_rad, "joint {joint}");
            let limits = held.bounds.safe_limits(&held.robot)[joint];
            assert_eq!(limits.are_locked(), is_held, "joint {joint}");
        }
        let codes: Vec<Code> = held.warnings.iter().map(|warning| warning.code).collect();
        assert_eq!(codes, [Code::JointAssumed; 3]);
    }
}

//! A joint that is held in place because it does not follow its set-points, or because its sensor has failed.
//!
//! Its reading is kept as its set-point, so that the arm's controller does not move it. Its angle is the last one
//! believed until a view shows it. Plans treat it as a joint with a range of that one angle, and keep clear for all
//! angles that it may have.

use crate::plan::JointErrorBounds;
use crate::plan::constants::bounds_estimate_bounds::SIGMAS;
use crate::session::constants::held_joint::{CREEP_RAD_PER_S, OLD_S};
use armcal_core::robot::{FailedKind, Robot};
use armcal_core::sensor::{ArmSensors, Correction, Terms};
use armcal_core::streams::{JointAngles, JointCounts};
use armcal_core::time::Stamp;

/// A joint that no plan uses any more.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldJoint {
    /// Index, base first.
    pub joint: usize,
    /// Observed kind of failure.
    pub kind: FailedKind,
    /// Time at which it was declared failed, by the arm's clock.
    pub since: Stamp,
    /// Set-point that holds it, its reading, counts.
    pub counts: f64,
    /// Believed angle, rad.
    pub angle_rad: f64,
    /// Bound on the difference of true and believed angle, rad.
    pub bound_rad: f64,
    /// True if views have shown its angle, or its sensor still works.
    pub is_located: bool,
}

impl HeldJoint {
    /// Returns the std of the angle of a locked joint whose sensor still works, rad.
    pub(crate) fn locked_std_rad(&self) -> Option<f64> {
        (self.kind == FailedKind::Locked && self.is_located).then_some(self.bound_rad / SIGMAS)
    }
}

/// Returns the time that a joint may run before a failure is noticed, s.
fn unnoticed_s(kind: FailedKind) -> f64 {
    match kind {
        FailedKind::Locked | FailedKind::NotMoved | FailedKind::Jumps => 0.0,
        FailedKind::Stuck => 0.6,
        FailedKind::Dead => 0.8,
    }
}

impl HeldJoint {
    /// Returns the largest travel of the joint from its believed angle before a failure is noticed, rad.
    pub(crate) fn astray_rad(robot: &Robot, joint: usize, kind: FailedKind) -> f64 {
        unnoticed_s(kind) * robot.sensors[joint].max_rate_rad_s
    }
}

/// Returns `angles` with the held joints at their held angles.
pub(crate) fn with_held(held: &[HeldJoint], angles: &JointAngles) -> JointAngles {
    let mut angles = *angles;
    held.iter().for_each(|held| angles[held.joint] = held.angle_rad);
    angles
}

/// Returns `counts` with the set-points that hold the held joints.
pub(crate) fn holding_counts(held: &[HeldJoint], mut counts: JointCounts) -> JointCounts {
    held.iter().for_each(|held| counts[held.joint] = held.counts);
    counts
}

/// Returns sensors that put held joints at their held angles, regardless of their readings.
pub(crate) fn holding_sensors(held: &[HeldJoint], mut sensors: ArmSensors) -> ArmSensors {
    for held in held {
        let model = &mut sensors.models[held.joint];
        let offset_rad = held.angle_rad - model.spec.center_rad;
        model.correction = Correction { gain: 0.0, offset_rad, terms: Terms::default() };
    }
    sensors
}

/// Locks the held joints in the robot's chain.
pub(crate) fn hold_in(held: &[HeldJoint], robot: &mut Robot) {
    for held in held {
        robot.chain = robot.chain.locked(held.joint, held.angle_rad);
        robot.stowed[held.joint] = held.angle_rad;
    }
}

/// Returns the bounds with those of the held joints.
pub(crate) fn holding_bounds(held: &[HeldJoint], mut bounds: JointErrorBounds) -> JointErrorBounds {
    held.iter().for_each(|held| bounds.hold(held.joint, held.angle_rad, held.bound_rad));
    bounds
}

/// A held joint that was found standing still.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StandingJoint {
    /// Index, base first.
    pub joint: usize,
    found_std_rad: f64,
    since: Stamp,
}

impl StandingJoint {
    pub(crate) fn new(held: &HeldJoint, since: Stamp) -> Self {
        Self { joint: held.joint, found_std_rad: held.bound_rad / SIGMAS, since }
    }

    /// True if it was located long ago.
    pub(crate) fn is_old(&self, now: Stamp) -> bool {
        now.since_s(self.since) > OLD_S
    }

    /// Returns the std of its angle at `now`, rad: a shut valve leaks.
    pub(crate) fn std_rad(&self, now: Stamp) -> f64 {
        self.found_std_rad + CREEP_RAD_PER_S * now.since_s(self.since).max(0.0)
    }
}

//! A joint that is held where it is, because it does not follow its set-points or its sensor tells nothing.
//!
//! Its reading is kept as its set-point, so that the arm's controller leaves it alone. Its angle is the last one
//! believed until a view shows it; plans have it as a joint with the range of that one angle, and keep clear of
//! everything for all angles that it may have.

use crate::plan::JointErrorBounds;
use crate::plan::constants::bounds_estimate_bounds::SIGMAS;
use crate::session::constants::held_joint::{CREEP_RAD_PER_S, OLD_S};
use armcal_core::robot::{FailedKind, Robot};
use armcal_core::sensor::{ArmSensors, Correction, Terms};
use armcal_core::streams::{JointAngles, JointCounts};
use armcal_core::time::Stamp;

/// A joint of which no plan makes use any more.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldJoint {
    /// Index, base first.
    pub joint: usize,
    /// What was seen of it.
    pub kind: FailedKind,
    /// When it was given up, by the arm's clock.
    pub since: Stamp,
    /// Set-point that holds it: its reading.
    pub counts: f64,
    /// Where it is believed to stand.
    pub angle_rad: f64,
    /// It stands within this of it.
    pub bound_rad: f64,
    /// Whether views have shown where it stands, or its sensor tells.
    pub is_located: bool,
}

impl HeldJoint {
    /// One sigma of where a joint stands whose sensor still tells, rad.
    pub(crate) fn locked_std_rad(&self) -> Option<f64> {
        (self.kind == FailedKind::Locked && self.is_located).then_some(self.bound_rad / SIGMAS)
    }
}

/// How long a joint may have run before a failure is noticed, s.
fn unnoticed_s(kind: FailedKind) -> f64 {
    match kind {
        FailedKind::Locked | FailedKind::NotMoved | FailedKind::Jumps => 0.0,
        FailedKind::Stuck => 0.6,
        FailedKind::Dead => 0.8,
    }
}

impl HeldJoint {
    /// How far it may have run from where it was believed to be, rad.
    pub(crate) fn astray_rad(robot: &Robot, joint: usize, kind: FailedKind) -> f64 {
        unnoticed_s(kind) * robot.sensors[joint].max_rate_rad_s
    }
}

/// `angles` with the held joints where they stand.
pub(crate) fn with_held(held: &[HeldJoint], angles: &JointAngles) -> JointAngles {
    let mut angles = *angles;
    held.iter().for_each(|held| angles[held.joint] = held.angle_rad);
    angles
}

/// `counts` with those that hold the held joints.
pub(crate) fn holding_counts(held: &[HeldJoint], mut counts: JointCounts) -> JointCounts {
    held.iter().for_each(|held| counts[held.joint] = held.counts);
    counts
}

/// Sensors by which held joints stand where they do, whatever they read.
pub(crate) fn holding_sensors(held: &[HeldJoint], mut sensors: ArmSensors) -> ArmSensors {
    for held in held {
        let model = &mut sensors.models[held.joint];
        let offset_rad = held.angle_rad - model.spec.center_rad;
        model.correction = Correction { gain: 0.0, offset_rad, terms: Terms::default() };
    }
    sensors
}

/// The arm without the held joints' freedom.
pub(crate) fn hold_in(held: &[HeldJoint], robot: &mut Robot) {
    for held in held {
        robot.chain = robot.chain.locked(held.joint, held.angle_rad);
        robot.stowed[held.joint] = held.angle_rad;
    }
}

/// Bounds that are the held joints' own.
pub(crate) fn holding_bounds(held: &[HeldJoint], mut bounds: JointErrorBounds) -> JointErrorBounds {
    held.iter().for_each(|held| bounds.hold(held.joint, held.angle_rad, held.bound_rad));
    bounds
}

/// A joint that was given up and was found standing still.
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

    /// Whether it was found long ago.
    pub(crate) fn is_old(&self, now: Stamp) -> bool {
        now.since_s(self.since) > OLD_S
    }

    /// One sigma of where it stands by `now`: a valve that is shut leaks.
    pub(crate) fn std_rad(&self, now: Stamp) -> f64 {
        self.found_std_rad + CREEP_RAD_PER_S * now.since_s(self.since).max(0.0)
    }
}

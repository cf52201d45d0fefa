//! Rules that stop a live arm, from readings, set-points and clocks only.

use armcal_core::codes::{Code, Coded};
use std::time::Duration;

use crate::leaps::{Leaps, Leapt};
use crate::{Deadman, GuardLimits};
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointCounts, JointSensorSample};
use armcal_core::time::Stamp;

/// Allowance beyond the sensors' bounds for angles that count as inside a joint's range, rad.
const RANGE_SLACK_RAD: f64 = 0.035;
/// Smallest motion of a set-point that readings should show, rad.
const ASKED_RAD: f64 = 0.02;
/// Share of `frozen_s` that must have passed since a set-point moved. An arm whose sensors have no noise repeats its
/// readings at rest, and follows late.
const ASKED_SHARE: f64 = 0.5;
/// Largest rate of a simulator's clock over ours; a clock that runs faster has jumped.
const MAX_PACE: f64 = 100.0;
/// Largest rate of a real arm's clock over ours. A clock that was slower before the first motion is a real arm's and
/// never runs faster.
const REAL_PACE: f64 = 2.0;

/// Reason for which the guard stopped the arm.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum StopReason {
    #[error("no joint readings for {silent_s:.2} s (guard.stale_s = {limit_s}): is the driver still there?")]
    Stale { silent_s: f64, limit_s: f64 },
    #[error("the dead man's switch was let go, or is silent (deadman.timeout_s = {limit_s})")]
    Deadman { limit_s: f64 },
    #[error(
        "{joint} has been {off_deg:.1} deg from its set-point for {for_s:.1} s \
         (guard.tracking_deg = {limit_deg}): it does not follow, or something is in its way"
    )]
    Tracking { joint: String, off_deg: f64, for_s: f64, limit_deg: f64 },
    #[error(
        "{joint} has read {off_deg:.1} deg from where it was for {for_s:.1} s, and no joint goes there from one \
         reading to the next (guard.tracking_deg = {limit_deg}): its sensor, plug or driver is at fault"
    )]
    Leapt { joint: String, off_deg: f64, for_s: f64, limit_deg: f64 },
    #[error("all joint readings have stayed the same to the count for {for_s:.1} s while set-points moved")]
    Frozen { for_s: f64 },
    #[error("the stamps of the joint readings leapt by {step_s:.3} s (guard.clock_step_s = {limit_s})")]
    ClockStep { step_s: f64, limit_s: f64 },
    #[error("{joint} would be sent to {angle_deg:.1} deg, beyond its range even for the worst sensor")]
    Range { joint: String, angle_deg: f64 },
    #[error("{0}")]
    Asked(String),
}

/// Returns the way from one reading to another, the short way round, rad.
fn way_rad(wrap_counts: f64, counts_per_rad: f64, from: f64, to: f64) -> f64 {
    let way = (to - from + wrap_counts / 2.0).rem_euclid(wrap_counts) - wrap_counts / 2.0;
    way / counts_per_rad
}

/// Guard of one arm.
pub(crate) struct Guard {
    limits: GuardLimits,
    deadman_s: Option<f64>,
    joints: Vec<String>,
    nominal: ArmSensors,
    counts_per_rad: Vec<f64>,
    /// 1 if counts rise with the angle, -1 if they fall.
    senses: Vec<f64>,
    wrap_counts: Vec<f64>,
    /// Least and greatest angle of a set-point by the nominal sensor, rad.
    range_rad: Vec<[f64; 2]>,
    last: Option<(JointSensorSample, Duration)>,
    /// Largest rate of the arm's clock over ours.
    max_pace: f64,
    /// Time by our clock from which silence counts.
    listening_since: Duration,
    held_at: Option<Duration>,
    /// Time from which each joint has been too far from its set-point.
    astray_since: Vec<Option<Stamp>>,
    leaps: Leaps,
    unchanged: Option<Unchanged>,
}

/// Readings that repeat themselves to the count.
struct Unchanged {
    counts: JointCounts,
    since: Stamp,
    /// Set-point at the time `since`.
    sent: JointCounts,
    /// Time at which a set-point was first far enough from `sent` for the readings to show it.
    asked_since: Option<Stamp>,
}

impl Unchanged {
    fn new(sample: &JointSensorSample, sent: &JointCounts) -> Self {
        Self { counts: sample.counts, since: sample.stamp, sent: *sent, asked_since: None }
    }
}

impl Guard {
    pub fn new(robot: &Robot, limits: GuardLimits, deadman: Option<&Deadman>) -> Self {
        let range = |sensor: &armcal_core::robot::JointSensorSpec| {
            let slack = sensor.offset_bound_rad + sensor.gain_bound * sensor.half_range_rad + RANGE_SLACK_RAD;
            let half = sensor.half_range_rad + slack;
            [sensor.center_rad - half, sensor.center_rad + half]
        };
        Self {
            limits,
            deadman_s: deadman.map(|deadman| deadman.timeout_s),
            joints: robot.joint_names(),
            nominal: ArmSensors::nominal(robot),
            counts_per_rad: robot.sensors.iter().map(|sensor| sensor.counts_per_rad.abs()).collect(),
            senses: robot.sensors.iter().map(|sensor| sensor.counts_per_rad.signum()).collect(),
            wrap_counts: robot.sensors.iter().map(|sensor| sensor.wrap_counts).collect(),
            range_rad: robot.sensors.iter().map(range).collect(),
            last: None,
            max_pace: MAX_PACE,
            listening_since: Duration::ZERO,
            held_at: None,
            astray_since: vec![None; robot.sensors.len()],
            leaps: Leaps::new(robot, limits.tracking_deg.to_radians()),
            unchanged: None,
        }
    }

    /// Returns the newest reading.
    pub fn latest(&self) -> Option<&JointSensorSample> {
        self.last.as_ref().map(|(sample, _)| sample)
    }

    /// Returns the way from one reading of a joint to another, rad; the short way round.
    pub fn way_rad(&self, joint: usize, from: f64, to: f64) -> f64 {
        way_rad(self.wrap_counts[joint], self.counts_per_rad[joint], from, to)
    }

    /// Returns the reading of a joint that is `way_rad` from another reading.
    pub fn moved(&self, joint: usize, from: f64, way_rad: f64) -> f64 {
        (from + way_rad * self.counts_per_rad[joint]).rem_euclid(self.wrap_counts[joint])
    }

    /// Returns the turn of a joint from one reading to another, rad, in the sense of the nominal model (URDF).
    pub fn turn_rad(&self, joint: usize, from: f64, to: f64) -> f64 {
        self.senses[joint] * self.way_rad(joint, from, to)
    }

    /// Returns the reading of a joint that is turned by `turn_rad` from another reading.
    pub fn turned(&self, joint: usize, from: f64, turn_rad: f64) -> f64 {
        self.moved(joint, from, self.senses[joint] * turn_rad)
    }

    /// Returns the sense, 1 or -1, in which a joint turns towards the middle of its range.
    pub fn inward(&self, joint: usize, counts: &JointCounts) -> f64 {
        let [low, high] = self.range_rad[joint];
        (0.5 * (low + high) - self.nominal.angles(counts)[joint]).signum()
    }

    /// Checks a set-point before it is sent.
    pub fn check_set_point(&self, counts: &JointCounts) -> Result<(), StopReason> {
        let angles = self.nominal.angles(counts);
        for (joint, (angle, [low, high])) in angles.iter().zip(&self.range_rad).enumerate() {
            if !(low..=high).contains(&angle) {
                return Err(StopReason::Range { joint: self.joints[joint].clone(), angle_deg: angle.to_degrees() });
            }
        }
        Ok(())
    }

    /// Takes the time, by our clock, at which the dead man's switch was held; `None` if it was let go.
    pub fn hear_deadman(&mut self, held_at: Option<Duration>) {
        self.held_at = held_at;
    }

    /// Checks a reading that came at `at` by our clock, while `sent` was the last set-point. Returns false if it is
    /// older than the newest reading.
    pub fn hear(&mut self, sample: &JointSensorSample, sent: &JointCounts, at: Duration) -> Result<bool, StopReason> {
        if let Some((last, last_at)) = &self.last {
            let (step_s, ours_s) = (sample.stamp.since_s(last.stamp), (at.saturating_sub(*last_at)).as_secs_f64());
            let limit_s = self.limits.clock_step_s;
            if step_s < -limit_s || (step_s > limit_s && step_s > self.max_pace * ours_s) {
                return Err(StopReason::ClockStep { step_s, limit_s });
            }
            if step_s <= 0.0 {
                return Ok(false);
            }
        }
        let last = self.last.replace((sample.clone(), at));
        self.check_leaps(last.as_ref().map(|(last, _)| last), sample)?;
        self.check_following(sample, sent)?;
        self.check_frozen(sample, sent)?;
        Ok(true)
    }

    fn check_following(&mut self, sample: &JointSensorSample, sent: &JointCounts) -> Result<(), StopReason> {
        for joint in 0..self.joints.len() {
            let off_deg = self.way_rad(joint, sent[joint], sample.counts[joint]).to_degrees().abs();
            if off_deg <= self.limits.tracking_deg {
                self.astray_since[joint] = None;
                continue;
            }
            let since = *self.astray_since[joint].get_or_insert(sample.stamp);
            let for_s = sample.stamp.since_s(since);
            if for_s > self.limits.tracking_s {
                let (joint, limit_deg) = (self.joints[joint].clone(), self.limits.tracking_deg);
                return Err(StopReason::Tracking { joint, off_deg, for_s, limit_deg });
            }
        }
        Ok(())
    }

    fn check_leaps(&mut self, last: Option<&JointSensorSample>, sample: &JointSensorSample) -> Result<(), StopReason> {
        let Some(last) = last else { return Ok(()) };
        let Self { leaps, wrap_counts, counts_per_rad, .. } = self;
        let way = |joint: usize, from, to| way_rad(wrap_counts[joint], counts_per_rad[joint], from, to);
        let Some(Leapt { joint, off_rad, for_s }) = leaps.hear(last, sample, way) else { return Ok(()) };
        if for_s <= self.limits.tracking_s {
            return Ok(());
        }
        let (joint, limit_deg) = (self.joints[joint].clone(), self.limits.tracking_deg);
        Err(StopReason::Leapt { joint, off_deg: off_rad.to_degrees(), for_s, limit_deg })
    }

    /// Forgets the leaps of earlier readings. They do not count before the first set-point.
    pub fn forget_leaps(&mut self) {
        self.leaps.forget();
    }

    /// Returns true if the reading of a joint is in doubt: it leapt, and has not come back.
    pub fn has_leapt(&self, joint: usize) -> bool {
        self.leaps.has_leapt(joint)
    }

    /// Checks that readings are not frozen. A set-point counts even if it was taken back, because a session that sees
    /// no joint move may hold it.
    fn check_frozen(&mut self, sample: &JointSensorSample, sent: &JointCounts) -> Result<(), StopReason> {
        let asks = |u: &Unchanged| (0..sent.len()).any(|j| self.way_rad(j, u.sent[j], sent[j]).abs() > ASKED_RAD);
        let is_asked = self.unchanged.as_ref().is_some_and(asks);
        match &mut self.unchanged {
            Some(unchanged) if unchanged.counts == sample.counts => {
                let asked_at = unchanged.asked_since.or_else(|| is_asked.then_some(sample.stamp));
                let (for_s, frozen_s) = (sample.stamp.since_s(unchanged.since), self.limits.frozen_s);
                unchanged.asked_since = asked_at;
                let is_late = asked_at.is_some_and(|at| sample.stamp.since_s(at) > ASKED_SHARE * frozen_s);
                if for_s > frozen_s && is_late {
                    return Err(StopReason::Frozen { for_s });
                }
            }
            _ => self.unchanged = Some(Unchanged::new(sample, sent)),
        }
        Ok(())
    }

    /// Checks the time since the last reading at `now` by our clock, and the dead man's switch.
    pub fn check_silence(&self, now: Duration) -> Result<(), StopReason> {
        let Some((_, heard_at)) = &self.last else { return Ok(()) };
        let silent_s = now.saturating_sub(self.listening_since.max(*heard_at)).as_secs_f64();
        if silent_s > self.limits.stale_s {
            return Err(StopReason::Stale { silent_s, limit_s: self.limits.stale_s });
        }
        self.check_deadman(now)
    }

    /// Checks that somebody holds the dead man's switch, if there is one.
    pub fn check_deadman(&self, now: Duration) -> Result<(), StopReason> {
        let Some(limit_s) = self.deadman_s else { return Ok(()) };
        let is_held = self.held_at.is_some_and(|at| now.saturating_sub(at).as_secs_f64() <= limit_s);
        if is_held { Ok(()) } else { Err(StopReason::Deadman { limit_s }) }
    }

    /// Learns the rate of the arm's clock, which advanced by `arm_s` in `ours_s` of our time.
    pub fn learn_pace(&mut self, arm_s: f64, ours_s: f64) {
        self.max_pace = if arm_s < REAL_PACE * ours_s { REAL_PACE } else { MAX_PACE };
    }

    /// Restarts the time without readings, after a pause without set-points in which nobody listened.
    pub fn resume(&mut self, now: Duration) {
        self.listening_since = now;
        if self.held_at.is_some() {
            self.held_at = Some(now);
        }
    }
}

impl Coded for StopReason {
    fn code(&self) -> Code {
        match self {
            Self::Stale { .. } => Code::ReadingsStale,
            Self::Deadman { .. } => Code::DeadmanReleased,
            Self::Tracking { .. } => Code::JointNotFollowing,
            Self::Leapt { .. } => Code::ReadingJumped,
            Self::Frozen { .. } => Code::ReadingsFrozen,
            Self::ClockStep { .. } => Code::ClockJumped,
            Self::Range { .. } => Code::JointLimit,
            Self::Asked(_) => Code::Interrupted,
        }
    }
}

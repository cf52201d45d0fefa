//! The first set-points of an arm: one joint by one degree out and back, to see that it follows.

use armcal_core::codes::{Code, Coded};
use std::f64::consts::PI;

use crate::{LiveArm, Wire};
use armcal_core::streams::{Arm, ArmError, JointCounts, Message, Sink, SinkError};
use armcal_core::time::Stamp;

/// Displacement of the nudged joint, rad.
const NUDGE_RAD: f64 = PI / 180.0;
/// Duration of the way out, s.
const WAY_S: f64 = 1.0;
/// Duration of the rest at each end, s; readings of its last `MEAN_S` are averaged.
const REST_S: f64 = 1.5;
const MEAN_S: f64 = 0.4;
/// Motion in the wrong direction, or without a command, beyond which the arm stops, rad.
const ASTRAY_RAD: f64 = 0.5 * PI / 180.0;
/// Smallest and largest share of the commanded displacement with which a joint follows: valves have deadbands.
const SHARES: [f64; 2] = [0.5, 1.5];

/// Commanded and measured displacement of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Nudge {
    /// Name of the joint.
    pub joint: String,
    /// Commanded displacement, rad.
    pub asked_rad: f64,
    /// Displacement by the joint's reading, rad.
    pub moved_rad: f64,
    /// Distance from the start after the way back, rad.
    pub left_rad: f64,
}

/// Reason for which an arm must not be moved further.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum NudgeProblem {
    #[error(
        "{joint} reads to move by {moved_deg:+.2} deg while it is told to stay: are sign and zero of set-points and \
             readings the same?"
    )]
    Astray { joint: String, moved_deg: f64 },
    #[error(
        "{joint} was told to move by {asked_deg:+.2} deg and reads to move by {moved_deg:+.2} deg, the wrong way: \
             its set-points and its readings have opposite signs"
    )]
    Reversed { joint: String, asked_deg: f64, moved_deg: f64 },
    #[error(
        "{moved} reads to move by {moved_deg:+.2} deg while only {joint} was told to: are `names` in arm.toml right?"
    )]
    Another { joint: String, moved: String, moved_deg: f64 },
    #[error(
        "{joint} was told to move by {asked_deg:+.2} deg and reads to move by {moved_deg:+.2} deg: it does not \
             follow, or the scales of its set-points and its readings differ"
    )]
    Scale { joint: String, asked_deg: f64, moved_deg: f64 },
    #[error("{joint} came back {left_deg:+.2} deg from where it was")]
    NotBack { joint: String, left_deg: f64 },
    #[error("stopped on request")]
    Stopped,
    #[error("the operator did not say yes")]
    Declined,
    #[error(transparent)]
    Arm(#[from] ArmError),
}

/// Sink that discards all messages.
struct Forget;

impl Sink for Forget {
    fn record(&mut self, _: Stamp, _: &Message) -> Result<(), SinkError> {
        Ok(())
    }
}

impl<W: Wire> LiveArm<W> {
    /// Moves one joint by one degree towards the middle of its range, and back. The arm is stopped for good if a joint
    /// goes astray, or as soon as `is_over` returns true.
    ///
    /// # Errors
    /// [`NudgeProblem`].
    pub fn nudge(&mut self, joint: usize, is_over: &dyn Fn() -> bool) -> Result<Nudge, NudgeProblem> {
        let result = self.nudge_unstopped(joint, is_over);
        if let Err(problem) = &result {
            self.stop(&format!("nudge: {problem}"));
        }
        result
    }

    fn nudge_unstopped(&mut self, joint: usize, is_over: &dyn Fn() -> bool) -> Result<Nudge, NudgeProblem> {
        let Some(start) = self.reading() else { return Err(NudgeProblem::Stopped) };
        let mut out = Way { joint, start, from_rad: 0.0, to_rad: 0.0 };
        self.go(&out, is_over)?;
        out.to_rad = NUDGE_RAD * self.guard().inward(joint, &start);
        let moved_rad = self.go(&out, is_over)?;
        let back = Way { from_rad: out.to_rad, to_rad: 0.0, ..out };
        let left_rad = self.go(&back, is_over)?;
        let (joint, asked_deg, moved_deg) = (self.joint_name(joint), out.to_rad.to_degrees(), moved_rad.to_degrees());
        let share = moved_rad / out.to_rad;
        if share < -SHARES[0] {
            return Err(NudgeProblem::Reversed { joint, asked_deg, moved_deg });
        }
        if !(SHARES[0]..=SHARES[1]).contains(&share) {
            return Err(NudgeProblem::Scale { joint, asked_deg, moved_deg });
        }
        if left_rad.abs() > ASTRAY_RAD {
            return Err(NudgeProblem::NotBack { joint, left_deg: left_rad.to_degrees() });
        }
        Ok(Nudge { joint, asked_rad: out.to_rad, moved_rad, left_rad })
    }

    /// Leads the joint along a way and lets it rest. Returns its distance from the start by the reading, rad.
    fn go(&mut self, way: &Way, is_over: &dyn Fn() -> bool) -> Result<f64, NudgeProblem> {
        let n = |seconds: f64, period_s: f64| (seconds / period_s).ceil() as u32;
        let period_s = self.period_s();
        let (n_way, n_rest, n_mean) = (n(WAY_S, period_s), n(REST_S, period_s), n(MEAN_S, period_s));
        let mut sum_rad = 0.0;
        for step in 1..=n_way + n_rest {
            if is_over() {
                return Err(NudgeProblem::Stopped);
            }
            let share = f64::from(step.min(n_way)) / f64::from(n_way);
            let at_rad = way.from_rad + share * (way.to_rad - way.from_rad);
            self.command(&self.set_point(way, at_rad))?;
            self.step(&mut Forget)?;
            let moved_rad = self.check(way)?;
            sum_rad += if step + n_mean > n_way + n_rest { moved_rad } else { 0.0 };
        }
        Ok(sum_rad / f64::from(n_mean))
    }

    /// Returns the joint's distance from the start by its reading, rad. Refuses a wrong motion of this joint or of
    /// another.
    fn check(&self, way: &Way) -> Result<f64, NudgeProblem> {
        let reading = self.reading().unwrap_or(way.start);
        let moved_rad = |joint: usize| self.guard().turn_rad(joint, way.start[joint], reading[joint]);
        let others = (0..reading.len()).filter(|other| *other != way.joint);
        let farthest = others.max_by(|a, b| moved_rad(*a).abs().total_cmp(&moved_rad(*b).abs()));
        let (joint, own_rad) = (self.joint_name(way.joint), moved_rad(way.joint));
        let furthest_rad = if way.to_rad == 0.0 { way.from_rad } else { way.to_rad };
        let (along_rad, moved_deg) = (own_rad * furthest_rad.signum(), own_rad.to_degrees());
        if let Some(other) = farthest.filter(|other| moved_rad(*other).abs() > ASTRAY_RAD) {
            let (moved, moved_deg) = (self.joint_name(other), moved_rad(other).to_degrees());
            return Err(if furthest_rad == 0.0 {
                NudgeProblem::Astray { joint: moved, moved_deg }
            } else {
                NudgeProblem::Another { joint, moved, moved_deg }
            });
        }
        if furthest_rad == 0.0 && own_rad.abs() > ASTRAY_RAD {
            return Err(NudgeProblem::Astray { joint, moved_deg });
        }
        let asked_deg = furthest_rad.to_degrees();
        if furthest_rad != 0.0 && along_rad < -ASTRAY_RAD {
            return Err(NudgeProblem::Reversed { joint, asked_deg, moved_deg });
        }
        if furthest_rad != 0.0 && along_rad > 2.0 * furthest_rad.abs() + ASTRAY_RAD {
            return Err(NudgeProblem::Scale { joint, asked_deg, moved_deg });
        }
        Ok(own_rad)
    }

    fn set_point(&self, way: &Way, at_rad: f64) -> JointCounts {
        let mut counts = way.start;
        counts[way.joint] = self.guard().turned(way.joint, way.start[way.joint], at_rad);
        counts
    }
}

/// Way of one joint from one distance from its start to another.
#[derive(Clone, Copy)]
struct Way {
    joint: usize,
    start: JointCounts,
    from_rad: f64,
    to_rad: f64,
}

impl Coded for NudgeProblem {
    fn code(&self) -> Code {
        match self {
            Self::Astray { .. } | Self::Reversed { .. } => Code::SetPointsReversed,
            Self::Another { .. } => Code::SetPointsExchanged,
            Self::Scale { .. } => Code::SetPointsScaled,
            Self::NotBack { .. } => Code::JointNotFollowing,
            Self::Stopped | Self::Declined => Code::Interrupted,
            Self::Arm(error) => error.code(),
        }
    }
}

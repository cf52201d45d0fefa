//! Progress of a run and approval of its motions by an operator.

use armcal_core::streams::{JointAngles, Phase};

/// Interface to the caller of a run: progress, clock, stop requests and approval of motions.
pub trait Progress {
    /// Reports that `done` of `total` steps of `phase` are over; `simulated_s` is the arm time since the start.
    fn update(&mut self, phase: Phase, done: usize, total: usize, simulated_s: f64);

    /// Returns the seconds on the caller's clock since any fixed time; the session itself has only the arm's clock.
    fn wall_s(&self) -> f64;

    /// True if the run must end; asked in every control period.
    fn stop_requested(&self) -> bool {
        false
    }

    /// True if [`Self::approve`] is to be asked before each motion.
    fn wants_to_approve(&self) -> bool {
        false
    }

    /// Returns the operator's answer to the next motion; asked again after each [`Approval::Hold`].
    fn approve(&mut self, ahead: &MotionAhead) -> Approval {
        let _ = ahead;
        Approval::Approve
    }
}

/// A planned motion before its start.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionAhead {
    /// Names of the joints, base first.
    pub joints: Vec<String>,
    /// Believed angles at the start, rad.
    pub from: JointAngles,
    /// Believed angles at the end, rad.
    pub to: JointAngles,
    /// Number of straight edges of the path.
    pub edges: usize,
    /// Planned time from rest to rest, without settling, s.
    pub duration_s: f64,
    /// Certified clearance of every arm within the error bounds, m, less the bound of the vehicle's motion; `None` for
    /// motions with another proof (scale identification, end stops).
    pub clearance_m: Option<f64>,
}

/// An operator's answer to a motion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Approval {
    /// The motion begins.
    Approve,
    /// The arm waits at its pose, and asks again.
    Hold,
    /// The session ends here, with its recording kept; the text says why.
    Abort(String),
}

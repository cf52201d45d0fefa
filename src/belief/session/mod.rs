//! BELIEF: the closed loop, a routine's script carried out on any [`Arm`].
//!
//! It knows the arm only through its messages. `script` goes through the steps after `prepare` planned what can be planned; `reach`
//! and `capture` plan and move for them, `running` renews the belief between views, `grip` moves the jaws, `identify` measures a
//! sensor's unknown scale, `stops` presses joints against their end stops. `motion` drives, waits until `stillness` says that the
//! arm stands, and backs out when `bump` says that it has met something; `approval` asks an operator before a motion. `recorder`
//! keeps every message,
//! `outcome` is what is left when it is over; `Progress` tells whoever watches.

mod approval;
mod belief_update;
mod capture;
mod contact;
mod end_stops;
mod grip;
mod motion;
mod outcome;
mod prepare;
mod reach;
mod recorder;
mod scale_identification;
mod script;
mod settling;
mod unwatched;

pub use outcome::{AssertResult, Epoch, EstimateUpdate, Outcome, ReachStep, Visit};
pub use recorder::Recorder;
pub use unwatched::Unwatched;

use crate::calib::CalibError;
use crate::plan::PlanError;
use armcal_core::log::LogError;
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Routine;
use armcal_core::streams::{Arm, ArmError, JointAngles, Phase};

/// Why a run broke off.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error(transparent)]
    Arm(#[from] ArmError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Calib(#[from] CalibError),
    #[error("the arm sends no joint readings")]
    NoReadings,
    #[error(
        "none of the {planned} planned poses was captured: to {blocked} no path led, at {restless} the arm did not come to \
         rest by its own sensors (too noisy, or it oscillates?)"
    )]
    NothingCaptured { planned: usize, blocked: usize, restless: usize },
    #[error("step {step}: the arm has no joint `{joint}`; it has {joints:?}")]
    UnknownJoint { step: usize, joint: String, joints: Vec<String> },
    #[error("step {step}: {problem}")]
    Step { step: usize, problem: String },
    /// The watcher asked for it; the arm was told to stay where it was last sent.
    #[error("stopped on request at {at_s:.1} s of the arm's time")]
    Interrupted { at_s: f64 },
}

/// Told how far the run is.
pub trait Progress {
    /// `done` of `total` steps of `phase` are over; `simulated_s` since the start by the arm's clock.
    fn update(&mut self, phase: Phase, done: usize, total: usize, simulated_s: f64);

    /// Seconds on the watcher's clock since any fixed moment; the loop itself has no clock but the arm's.
    fn wall_s(&self) -> f64;

    /// Whether the run shall break off; asked in every control period.
    fn stop_requested(&self) -> bool {
        false
    }

    /// Whether [`Self::approve`] is to be asked before each motion.
    fn wants_to_approve(&self) -> bool {
        false
    }

    /// What the operator says to the motion that comes next; asked again after each [`Approval::Hold`].
    fn approve(&mut self, ahead: &MotionAhead) -> Approval {
        let _ = ahead;
        Approval::Approve
    }
}

/// A motion that is planned and not begun.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionAhead {
    pub joints: Vec<String>,
    /// Believed.
    pub from: JointAngles,
    pub to: JointAngles,
    /// Straight edges on the way.
    pub edges: usize,
    pub duration_s: f64,
    /// Of every arm within the error bounds, proven, beyond what the vehicle's motion takes; `None` where it was proven in
    /// another way (a sensor's scale is measured, a stop is driven to).
    pub clearance_m: Option<f64>,
}

/// What an operator says to a motion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Approval {
    Approve,
    /// The arm waits where it is, and asks again.
    Hold,
    /// The session ends here, with its recording kept; the text says why.
    Abort(String),
}

/// All that a run needs to know beforehand.
pub struct SessionInputs<'a> {
    pub robot: &'a Robot,
    pub vehicle: &'a Vehicle,
    pub routine: &'a Routine,
    /// For planning only; the arm has its own.
    pub seed: u64,
}

/// Carries out the routine's script.
///
/// # Errors
/// [`SessionError`]; what was recorded until then stays readable.
pub fn run(
    setup: &SessionInputs<'_>,
    arm: &mut dyn Arm,
    recorder: &mut Recorder,
    progress: &mut dyn Progress,
) -> Result<Outcome, SessionError> {
    script::run(setup, arm, recorder, progress)
}

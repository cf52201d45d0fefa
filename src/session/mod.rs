//! BELIEF: the closed loop, a routine's script carried out on any [`Arm`].
//!
//! It knows the arm only through its messages. `script` goes through the steps, `reach` and `capture` plan and move for
//! them, `grip` moves the jaws, `identify` measures a sensor's unknown scale, `stops` presses joints against their end stops, `motion` drives and waits until `stillness` says that the arm stands, `recorder` keeps every message,
//! `outcome` is what is left when it is over; `Progress` tells whoever watches.

mod capture;
mod grip;
mod identify;
mod motion;
mod outcome;
mod reach;
mod recorder;
mod script;
mod stillness;
mod stops;

pub use outcome::{AssertResult, Epoch, Outcome, ReachStep};
pub use recorder::Recorder;

use crate::calib::CalibError;
use crate::log::LogError;
use crate::plan::PlanError;
use crate::robot::{Robot, Vehicle};
use crate::routine::Routine;
use crate::streams::{Arm, ArmError, Phase};

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
}

/// All that a run needs to know beforehand.
pub struct Setup<'a> {
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
    setup: &Setup<'_>,
    arm: &mut dyn Arm,
    recorder: &mut Recorder,
    progress: &mut dyn Progress,
) -> Result<Outcome, SessionError> {
    script::run(setup, arm, recorder, progress)
}

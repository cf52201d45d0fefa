//! Errors of a session.

use crate::plan::PlanError;
use crate::views::error::CalibError;
use armcal_core::codes::{Code, Coded};
use armcal_core::log::LogError;
use armcal_core::streams::ArmError;

/// The reason why a run ended early.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
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
        "{captured} of the {tried} poses that were tried were captured, fewer than a calibration needs: to {blocked} \
         no path led, on the way to {met} the arm met something, at {restless} it did \
         not come to rest by its own sensors (too noisy, or it oscillates?); {why}"
    )]
    TooFewViews { captured: usize, tried: usize, blocked: usize, met: usize, restless: usize, why: String },
    #[error(
        "the camera saw no tag at the last {poses} poses, where it should have: check camera, light, water, and what \
         may hide the tags, and run again; {why}"
    )]
    NothingSeen { poses: usize, why: String },
    #[error("step {step}: the arm has no joint `{joint}`; it has {joints:?}")]
    UnknownJoint { step: usize, joint: String, joints: Vec<String> },
    #[error("step {step}: {problem}")]
    Step { step: usize, problem: String },
    /// Stopped by the caller; the arm holds its last set-point.
    #[error("stopped on request at {at_s:.1} s of the arm's time")]
    Interrupted { at_s: f64 },
}

impl Coded for SessionError {
    fn code(&self) -> Code {
        match self {
            Self::Plan(error) => error.code(),
            Self::Arm(error) => error.code(),
            Self::Log(error) => error.code(),
            Self::Calib(error) => error.code(),
            Self::NoReadings => Code::ReadingsMissing,
            Self::TooFewViews { .. } => Code::CaptureFailed,
            Self::NothingSeen { .. } => Code::TagsNotSeen,
            Self::UnknownJoint { .. } => Code::NameUnknown,
            Self::Step { .. } => Code::StepImpossible,
            Self::Interrupted { .. } => Code::Interrupted,
        }
    }
}

//! Where a run failed, and of what.

use armcal_core::codes::{Code, Coded};
use std::path::PathBuf;

use crate::output::OutputError;
use armcal_belief::session::SessionError;
use armcal_core::log::LogError;
use armcal_core::robot::RobotError;
use armcal_core::routine::RoutineError;
#[cfg(feature = "sim")]
use armcal_sim::SimError;

/// How far a run came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reading routine, robot, vehicle, world.
    Input,
    /// Building the world and opening the streams.
    World,
    Plan,
    /// The arm was on its way.
    Motion,
    Calibrate,
    /// The recording is whole; it is compared with the truth and written out.
    Results,
}

impl Stage {
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Input => "input",
            Self::World => "world",
            Self::Plan => "plan",
            Self::Motion => "motion",
            Self::Calibrate => "calibrate",
            Self::Results => "results",
        }
    }
}

/// Why a run gave no result. Sources stand behind the message, not in its place: the exit code depends on their type.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    #[error("{0}")]
    Routine(#[from] RoutineError),
    #[error("{0}")]
    Robot(#[from] RobotError),
    #[cfg(feature = "sim")]
    #[error("{0}")]
    Sim(#[from] SimError),
    #[error("{0}")]
    Log(#[from] LogError),
    #[error("{0}")]
    Session(#[from] SessionError),
    #[error("{0}")]
    Output(#[from] OutputError),
    #[error("summary.json: {0}")]
    Json(#[from] serde_json::Error),
}

impl RunError {
    /// Whether the machine is at fault, such as a full disk or a folder that was removed: the next try may go well.
    #[must_use]
    pub fn is_of_machine(&self) -> bool {
        let mut causes =
            std::iter::successors(Some(self as &(dyn std::error::Error + 'static)), |error| error.source());
        matches!(self, Self::Output(_)) || causes.any(|cause| cause.is::<std::io::Error>())
    }
}

/// A run that failed.
#[derive(Debug)]
pub struct Failure {
    pub stage: Stage,
    /// Boxed: results are handed on by value.
    pub error: Box<RunError>,
    /// The recording up to the failure, where one is worth a look.
    pub kept: Option<PathBuf>,
}

impl Failure {
    /// For errors at `stage`.
    pub(super) fn at<E: Into<RunError>>(stage: Stage) -> impl FnOnce(E) -> Self {
        move |error| Self { stage, error: Box::new(error.into()), kept: None }
    }

    /// A folder for the run that could not be made.
    #[cfg(feature = "sim")]
    #[must_use]
    pub fn of_output(error: OutputError) -> Self {
        Self { stage: Stage::World, error: Box::new(error.into()), kept: None }
    }

    /// A loop that broke off.
    pub(super) fn of_session(error: SessionError) -> Self {
        let stage = match error {
            SessionError::Plan(_) => Stage::Plan,
            SessionError::Calib(_) => Stage::Calibrate,
            _ => Stage::Motion,
        };
        Self { stage, error: Box::new(error.into()), kept: None }
    }
}

impl Coded for RunError {
    fn code(&self) -> Code {
        match self {
            Self::Routine(error) => error.code(),
            Self::Robot(error) => error.code(),
            #[cfg(feature = "sim")]
            Self::Sim(error) => error.code(),
            Self::Log(error) => error.code(),
            Self::Session(error) => error.code(),
            Self::Output(error) => error.code(),
            Self::Json(_) => Code::Internal,
        }
    }
}

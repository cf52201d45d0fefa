//! Failure of a run: its stage and its error.

use armcal_core::codes::{Code, Coded};
use std::path::PathBuf;

use crate::output::OutputError;
use armcal_belief::session::SessionError;
use armcal_core::log::LogError;
use armcal_core::robot::RobotError;
use armcal_core::routine::RoutineError;
#[cfg(feature = "sim")]
use armcal_sim::SimError;

/// Stage that a run reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Reading routine, robot, vehicle, world.
    Input,
    /// Building the world and opening the streams.
    World,
    Plan,
    /// Moving the arm.
    Motion,
    Calibrate,
    /// Comparing the finished recording with the truth, and writing the results.
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

/// Reason that a run gave no result. Sources are kept as sources, not only as text: the exit code depends on their
/// type.
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
    /// True if the machine is at fault, such as a full disk or a folder that was removed: the next try may succeed.
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
    /// The error, boxed because results are passed by value.
    pub error: Box<RunError>,
    /// The recording up to the failure, where one is worth keeping.
    pub kept: Option<PathBuf>,
}

impl Failure {
    /// Returns a conversion of errors at `stage`.
    pub(super) fn at<E: Into<RunError>>(stage: Stage) -> impl FnOnce(E) -> Self {
        move |error| Self { stage, error: Box::new(error.into()), kept: None }
    }

    /// Failure of making the run's folder.
    #[cfg(feature = "sim")]
    #[must_use]
    pub fn of_output(error: OutputError) -> Self {
        Self { stage: Stage::World, error: Box::new(error.into()), kept: None }
    }

    /// Failure of an interrupted loop.
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

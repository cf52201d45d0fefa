//! Exit codes, as scripts rely on them.

use std::process::ExitCode;

use crate::calib::{CalibError, CalibrationFileError};
use crate::log::LogError;
use crate::plan::PlanError;
use crate::robot::RobotError;
use crate::routine::RoutineError;
use crate::session::SessionError;

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    Ok,
    Failure,
    /// Usage or invalid input.
    InvalidInput,
    /// Done, but data was lost or rejected beyond limits.
    DataLost,
    /// Verification failed or calibration refused.
    Refused,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(match exit {
            Exit::Ok => 0,
            Exit::Failure => 1,
            Exit::InvalidInput => 2,
            Exit::DataLost => 3,
            Exit::Refused => 4,
        })
    }
}

/// Something is missing on the command line.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct UsageError(pub String);

/// Input that cannot be used gives 2, recordings with nothing to fit too; all else 1.
pub(super) fn of_error(error: &anyhow::Error) -> Exit {
    let invalid = error.chain().any(|cause| {
        cause.is::<UsageError>()
            || cause.is::<RobotError>()
            || cause.is::<RoutineError>()
            || cause.is::<CalibrationFileError>()
            || cause.is::<CalibError>()
            || cause.is::<PlanError>()
            || cause.downcast_ref::<LogError>().is_some_and(|e| !is_write_failure(e))
            || matches!(cause.downcast_ref::<SessionError>(), Some(SessionError::Plan(_) | SessionError::Calib(_)))
            || is_invalid_world(cause)
    });
    if invalid { Exit::InvalidInput } else { Exit::Failure }
}

#[cfg(feature = "sim")]
fn is_invalid_world(cause: &(dyn std::error::Error + 'static)) -> bool {
    use crate::sim::SimError;
    cause.downcast_ref::<SimError>().is_some_and(|e| !matches!(e, SimError::Truth(_)))
}

#[cfg(not(feature = "sim"))]
fn is_invalid_world(_: &(dyn std::error::Error + 'static)) -> bool {
    false
}

fn is_write_failure(error: &LogError) -> bool {
    matches!(error, LogError::Write { .. } | LogError::Create { .. })
}

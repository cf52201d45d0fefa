//! Exit codes, as scripts rely on them.

use std::process::ExitCode;

#[cfg(feature = "sim")]
use crate::report::RunSummary;
use crate::report::proposed_map::ProposalError;
use armcal_belief::calib::{CalibError, CalibrationFileError, CompactError};
use armcal_belief::plan::{ItineraryError, PlanError};
use armcal_belief::session::SessionError;
use armcal_belief::tagmap::TagMapError;
use armcal_belief::tagmap::recording::ViewsError;
use armcal_core::input::InputError;
use armcal_core::log::LogError;
use armcal_core::robot::{FileIssue, RobotError};
use armcal_core::routine::RoutineError;
use armcal_core::text::printable;

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

impl Exit {
    /// As the system gets it.
    #[must_use]
    pub fn code(self) -> u8 {
        match self {
            Self::Ok => 0,
            Self::Failure => 1,
            Self::InvalidInput => 2,
            Self::DataLost => 3,
            Self::Refused => 4,
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.code())
    }
}

/// A run that came to its end: accepted and every limit held, or not.
#[cfg(feature = "sim")]
pub(super) fn of_summary(summary: &RunSummary) -> Exit {
    if summary.is_good() { Exit::Ok } else { Exit::Refused }
}

/// Something is missing on the command line.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct UsageError(pub String);

/// Input that cannot be used gives 2, recordings with nothing to fit too; all else 1.
pub(super) fn of_error(error: &anyhow::Error) -> Exit {
    of_cause(error.as_ref())
}

/// The same for an error as the library gives it.
pub(super) fn of_cause(error: &(dyn std::error::Error + 'static)) -> Exit {
    let invalid = std::iter::successors(Some(error), |error| error.source()).any(|cause| {
        cause.is::<UsageError>()
            || cause.is::<RobotError>()
            || cause.is::<FileIssue>()
            || cause.is::<InputError>()
            || cause.is::<ProposalError>()
            || cause.is::<RoutineError>()
            || cause.is::<CalibrationFileError>()
            || cause.is::<CalibError>()
            || cause.is::<CompactError>()
            || cause.is::<PlanError>()
            || cause.is::<ItineraryError>()
            || cause.is::<TagMapError>()
            || cause.is::<ViewsError>()
            || cause.downcast_ref::<LogError>().is_some_and(|e| !is_write_failure(e))
            || matches!(cause.downcast_ref::<SessionError>(), Some(SessionError::Plan(_) | SessionError::Calib(_)))
            || is_invalid_world(cause)
            || is_invalid_campaign(cause)
            || is_invalid_connection(cause)
    });
    if invalid { Exit::InvalidInput } else { Exit::Failure }
}

#[cfg(feature = "sim")]
fn is_invalid_world(cause: &(dyn std::error::Error + 'static)) -> bool {
    use armcal_sim::SimError;
    cause.downcast_ref::<SimError>().is_some_and(|e| !matches!(e, SimError::Truth(_)))
}

#[cfg(not(feature = "sim"))]
fn is_invalid_world(_: &(dyn std::error::Error + 'static)) -> bool {
    false
}

#[cfg(feature = "sim")]
fn is_invalid_campaign(cause: &(dyn std::error::Error + 'static)) -> bool {
    use crate::campaign::CampaignError;
    cause.downcast_ref::<CampaignError>().is_some_and(CampaignError::is_invalid_input)
}

#[cfg(not(feature = "sim"))]
fn is_invalid_campaign(_: &(dyn std::error::Error + 'static)) -> bool {
    false
}

/// A connection map; an arm that is not there is no fault of the files.
#[cfg(feature = "live")]
fn is_invalid_connection(cause: &(dyn std::error::Error + 'static)) -> bool {
    matches!(cause.downcast_ref::<armcal_live::LiveError>(), Some(armcal_live::LiveError::File(_)))
}

#[cfg(not(feature = "live"))]
fn is_invalid_connection(_: &(dyn std::error::Error + 'static)) -> bool {
    false
}

fn is_write_failure(error: &LogError) -> bool {
    matches!(error, LogError::Write { .. } | LogError::Create { .. })
}

/// The chain of causes, printable, each said once: many messages already hold that of their source.
pub(super) fn explain(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1) {
        let cause = cause.to_string();
        if !text.contains(&cause) {
            text.push_str(": ");
            text.push_str(&cause);
        }
    }
    printable(&text).into_owned()
}

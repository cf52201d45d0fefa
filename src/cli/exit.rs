//! Exit codes, on which scripts depend.

use std::process::ExitCode;

use crate::front::CalibrateError;
use crate::output::OutputError;
#[cfg(feature = "closed-loop")]
use crate::report::RunSummary;
use crate::report::proposed_map::ProposalError;
use armcal_belief::calib::{CalibError, CalibrationFileError, CompactError};
use armcal_belief::plan::{ItineraryError, PathError, PlanError};
use armcal_belief::session::SessionError;
use armcal_belief::tagmap::TagMapError;
use armcal_belief::tagmap::recording::ViewsError;
use armcal_core::codes::{Code, Coded};
use armcal_core::input::InputError;
use armcal_core::log::LogError;
use armcal_core::robot::{FileIssue, RobotError};
use armcal_core::routine::RoutineError;
use armcal_core::streams::ArmError;
use armcal_core::text::printable;

/// Ending of a command.
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
    /// Exit code for the system.
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

/// Exit of a finished run: `Ok` if it is accepted and every limit holds.
#[cfg(feature = "closed-loop")]
pub(super) fn of_summary(summary: &RunSummary) -> Exit {
    if summary.is_good() { Exit::Ok } else { Exit::Refused }
}

/// An error of the command line, or of a file that it names.
#[derive(Debug, thiserror::Error)]
#[error("{text}")]
pub struct UsageError {
    code: Code,
    text: String,
}

impl UsageError {
    /// An error with its code.
    pub fn new(code: Code, text: impl Into<String>) -> Self {
        Self { code, text: text.into() }
    }
}

impl Coded for UsageError {
    fn code(&self) -> Code {
        self.code
    }
}

/// Error for a command whose part this build lacks.
#[cfg(all(feature = "closed-loop", not(feature = "live")))]
pub(super) fn not_built(command: &str) -> anyhow::Error {
    let problem = "this build of armcal knows no live arms; build it with `--features live`";
    UsageError::new(Code::BuildFeatureMissing, format!("{command}: {problem}")).into()
}

/// Exit for an error: 2 for unusable input, and for recordings with nothing to fit; 4 for a refused map; otherwise 1.
pub(super) fn of_error(error: &anyhow::Error) -> Exit {
    of_cause(error.as_ref())
}

/// Exit for an error in the form that the library returns.
pub(super) fn of_cause(error: &(dyn std::error::Error + 'static)) -> Exit {
    let causes = || std::iter::successors(Some(error), |error| error.source());
    if causes().any(|cause| matches!(cause.downcast_ref(), Some(TagMapError::Refused(_)))) {
        return Exit::Refused;
    }
    let invalid = causes().any(|cause| {
        cause.is::<UsageError>()
            || cause.is::<RobotError>()
            || cause.is::<FileIssue>()
            || cause.is::<InputError>()
            || cause.is::<ProposalError>()
            || cause.is::<RoutineError>()
            || cause.is::<CalibrationFileError>()
            || cause.is::<CalibError>()
            || cause.is::<CalibrateError>()
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

/// True for an invalid connection map; a missing arm is no error of the files.
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

/// Returns the chain of causes and the code, printable, as the last line of a command that failed.
pub(super) fn explain(error: &anyhow::Error) -> String {
    format!("{} [{}]", message_of(error), code_of(error))
}

/// The chain of causes, printable, without repetitions: many messages already include that of their source.
#[must_use]
pub fn message_of(error: &anyhow::Error) -> String {
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

/// Returns the code of the outermost cause that has one.
#[must_use]
pub fn code_of(error: &anyhow::Error) -> Code {
    error.chain().find_map(code_of_cause).unwrap_or(Code::Internal)
}

fn code_of_cause(cause: &(dyn std::error::Error + 'static)) -> Option<Code> {
    fn of<E: std::error::Error + Coded + 'static>(cause: &(dyn std::error::Error + 'static)) -> Option<Code> {
        cause.downcast_ref::<E>().map(Coded::code)
    }
    let of_input = of::<UsageError>(cause)
        .or_else(|| of::<RobotError>(cause))
        .or_else(|| of::<FileIssue>(cause))
        .or_else(|| of::<InputError>(cause))
        .or_else(|| of::<LogError>(cause))
        .or_else(|| of::<ProposalError>(cause))
        .or_else(|| of::<RoutineError>(cause))
        .or_else(|| of::<OutputError>(cause));
    let of_belief = || {
        of::<CalibrationFileError>(cause)
            .or_else(|| of::<CalibError>(cause))
            .or_else(|| of::<CalibrateError>(cause))
            .or_else(|| of::<CompactError>(cause))
            .or_else(|| of::<PlanError>(cause))
            .or_else(|| of::<PathError>(cause))
            .or_else(|| of::<ItineraryError>(cause))
            .or_else(|| of::<TagMapError>(cause))
            .or_else(|| of::<ViewsError>(cause))
            .or_else(|| of::<SessionError>(cause))
            .or_else(|| of::<ArmError>(cause))
    };
    let of_machine = || cause.is::<std::io::Error>().then_some(Code::FileUnwritable);
    of_input.or_else(of_belief).or_else(|| of_features(cause)).or_else(of_machine)
}

/// Returns the code of an error of a crate that a build may leave out.
fn of_features(cause: &(dyn std::error::Error + 'static)) -> Option<Code> {
    #[cfg(feature = "closed-loop")]
    if let Some(error) = cause.downcast_ref::<crate::run::RunError>() {
        return Some(error.code());
    }
    #[cfg(feature = "images")]
    if let Some(error) = cause.downcast_ref::<armcal_detect::DetectError>() {
        return Some(error.code());
    }
    #[cfg(feature = "sim")]
    {
        use crate::campaign::CampaignError;
        use armcal_sim::SimError;
        let of_campaign = cause.downcast_ref::<CampaignError>().map(Coded::code);
        if let Some(code) = of_campaign.or_else(|| cause.downcast_ref::<SimError>().map(Coded::code)) {
            return Some(code);
        }
    }
    #[cfg(feature = "viewer")]
    {
        use armcal_replay::{ReplayError, ViewerError};
        let of_replay = cause.downcast_ref::<ReplayError>().map(Coded::code);
        if let Some(code) = of_replay.or_else(|| cause.downcast_ref::<ViewerError>().map(Coded::code)) {
            return Some(code);
        }
    }
    #[cfg(feature = "live")]
    {
        use armcal_live::{LiveError, NudgeProblem, StopReason};
        let of_live = cause.downcast_ref::<LiveError>().map(Coded::code);
        let of_nudge = || cause.downcast_ref::<NudgeProblem>().map(Coded::code);
        if let Some(code) = of_live.or_else(of_nudge).or_else(|| cause.downcast_ref::<StopReason>().map(Coded::code)) {
            return Some(code);
        }
    }
    let _ = cause;
    None
}

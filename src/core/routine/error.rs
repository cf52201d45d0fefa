//! Errors of routines.

use crate::codes::{Code, Coded};
use crate::robot::{FileIssue, RobotError};

/// Reason why a routine was refused.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum RoutineError {
    #[error(transparent)]
    File(#[from] RobotError),
}

impl From<FileIssue> for RoutineError {
    fn from(issue: FileIssue) -> Self {
        Self::File(issue.into())
    }
}

impl Coded for RoutineError {
    fn code(&self) -> Code {
        let Self::File(error) = self;
        error.code()
    }
}

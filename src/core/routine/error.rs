//! Errors of routines.

use crate::robot::{FileIssue, RobotError};

/// Why a routine was refused.
#[derive(Debug, thiserror::Error)]
pub enum RoutineError {
    #[error(transparent)]
    File(#[from] RobotError),
}

impl From<FileIssue> for RoutineError {
    fn from(issue: FileIssue) -> Self {
        Self::File(issue.into())
    }
}

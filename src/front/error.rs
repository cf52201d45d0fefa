//! Errors between measurements and a calibration.

use armcal_belief::calib::{CalibError, CalibrationFileError};
use armcal_core::codes::{Code, Coded};
use armcal_core::input::InputError;
use armcal_core::log::LogError;
use armcal_core::robot::{FileIssue, RobotError};

/// Reason that there is no calibration; a poor calibration is no error, but is returned as refused.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// A recording that cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A recording of another system that cannot be read by its input map.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A file that accompanies the recording.
    #[error(transparent)]
    File(#[from] FileIssue),
    /// A robot, tag map or task.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// A prior that belongs to another arm.
    #[error(transparent)]
    Prior(#[from] CalibrationFileError),
    /// Views that cannot be fitted.
    #[error(transparent)]
    Calib(#[from] CalibError),
    /// A value that was given in memory.
    #[error("{0}")]
    Value(String),
    /// Measurements that need further inputs.
    #[error("{0}")]
    Usage(String),
}

impl Coded for CalibrateError {
    fn code(&self) -> Code {
        match self {
            Self::Log(error) => error.code(),
            Self::Input(error) => error.code(),
            Self::File(error) => error.code(),
            Self::Robot(error) => error.code(),
            Self::Prior(error) => error.code(),
            Self::Calib(error) => error.code(),
            Self::Value(_) => Code::ValueInvalid,
            Self::Usage(_) => Code::UsageInvalid,
        }
    }
}

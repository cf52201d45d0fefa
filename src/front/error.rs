//! Errors between measurements and a calibration.

use armcal_belief::calib::{CalibError, CalibrationFileError};
use armcal_core::codes::{Code, Coded};
use armcal_core::input::InputError;
use armcal_core::log::LogError;
use armcal_core::robot::{FileIssue, RobotError};

/// Why there is no calibration; one that is not good comes out refused instead.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// A recording that cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A recording of another system that cannot be read by its input map.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A file that goes with the recording.
    #[error(transparent)]
    File(#[from] FileIssue),
    /// A robot, tag map or task.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// A prior that is not of this arm.
    #[error(transparent)]
    Prior(#[from] CalibrationFileError),
    /// Views that cannot be fitted.
    #[error(transparent)]
    Calib(#[from] CalibError),
    /// A value that was given in memory.
    #[error("{0}")]
    Value(String),
    /// Measurements that need something else with them.
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

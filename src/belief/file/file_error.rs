//! Errors in calibration.toml and its covariance file.

use armcal_core::codes::{Code, Coded};
use std::path::PathBuf;

use armcal_core::robot::RobotError;

/// Reason why a calibration file was refused.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum CalibrationFileError {
    #[error(transparent)]
    File(#[from] RobotError),
    #[error("{file}: is for robot `{found}` with joints {found_joints:?}, not for `{expected}`")]
    OtherRobot { file: String, found: String, found_joints: Vec<String>, expected: String },
    #[error(
        "{file}: joint `{joint}`: was calibrated with {key} = {found}, and {} has {expected}: give the robot folder \
         that the calibration was made with, or calibrate again", robot_file.display()
    )]
    OtherDatasheet { file: String, robot_file: PathBuf, joint: String, key: &'static str, found: f64, expected: f64 },
    #[error(
        "{file}: joint `{joint}`: terms.nonlinearity_rad bends the sensor to {least:.2} .. {most:.2} times its gain, \
         so that readings have no certain angle; allowed is 0.2 .. 1.8"
    )]
    Bent { file: String, joint: String, least: f64, most: f64 },
    #[error(
        "{}: is missing: it is the covariance of {}, without which that is no prior; put it beside it",
        file.display(), calibration.display()
    )]
    NoCovariance { file: PathBuf, calibration: PathBuf },
    #[error(
        "{}: is the covariance of another calibration than {} (or one of them was edited); put the two files of one \
         calibration beside each other", file.display(), calibration.display()
    )]
    ForeignCovariance { file: PathBuf, calibration: PathBuf },
}

impl Coded for CalibrationFileError {
    fn code(&self) -> Code {
        match self {
            Self::File(error) => error.code(),
            Self::OtherRobot { .. } | Self::OtherDatasheet { .. } => Code::RobotMismatch,
            Self::Bent { .. } => Code::ValueOutOfRange,
            Self::NoCovariance { .. } | Self::ForeignCovariance { .. } => Code::CovarianceMismatch,
        }
    }
}

//! Calibrations as programs make and read them, by each method that a routine may name.

use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::routine::Method;

pub use armcal_belief::calib::*;
pub use armcal_paper::{
    Gauge, Interpolation, PositionMethod, PositionSearch, Scaling, SearchOptions, calibration_method,
    determined_by_variance, fisher_information, least_squares, minimum_distance,
};

/// [`armcal_belief::calib::calibrate`] by `method`.
///
/// # Errors
/// Those of the same.
pub fn calibrate(recording: &Recording, robot: &Robot, method: Method) -> Result<Calibration, CalibError> {
    armcal_belief::calib::calibrate(recording, robot, calibration_method(method))
}

/// [`armcal_belief::calib::calibrate_with_survey`] by `method`.
///
/// # Errors
/// Those of the same.
pub fn calibrate_with_survey(recording: &Recording, robot: &Robot, method: Method) -> Result<Calibration, CalibError> {
    armcal_belief::calib::calibrate_with_survey(recording, robot, calibration_method(method))
}

/// [`armcal_belief::calib::calibrate_data`] by `method`.
///
/// # Errors
/// Those of the same.
pub fn calibrate_data(
    data: CalibrationData,
    method: Method,
    prior: Option<&Calibration>,
) -> Result<Calibration, CalibError> {
    armcal_belief::calib::calibrate_data(data, calibration_method(method), prior)
}

//! Inputs of a session.

use crate::methods::CalibrationMethod;
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Routine;

/// Inputs of a run.
pub struct SessionInputs<'a> {
    /// Nominal arm, as mounted on the vehicle.
    pub robot: &'a Robot,
    /// Nominal vehicle.
    pub vehicle: &'a Vehicle,
    /// Script, scene, task and settings.
    pub routine: &'a Routine,
    /// Calibration method of the routine, with the solver for methods that use positions.
    pub method: CalibrationMethod,
    /// Seed of planning; a simulated arm has its own.
    pub seed: u64,
}

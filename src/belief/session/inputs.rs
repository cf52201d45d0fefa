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
    /// How the routine's calibrations are made: its method, with the solver of those that go by positions.
    pub method: CalibrationMethod,
    /// Seed of planning; a simulated arm has its own.
    pub seed: u64,
}

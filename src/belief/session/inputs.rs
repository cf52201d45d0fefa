//! Inputs of a session.

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
    /// Seed of planning; a simulated arm has its own.
    pub seed: u64,
}

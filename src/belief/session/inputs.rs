//! Inputs of a session.

use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Routine;

/// Inputs of a run.
pub struct SessionInputs<'a> {
    pub robot: &'a Robot,
    pub vehicle: &'a Vehicle,
    pub routine: &'a Routine,
    /// Seed of planning; a simulated arm has its own.
    pub seed: u64,
}

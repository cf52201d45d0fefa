//! Inputs of a run, read and checked before anything moves.

use std::path::Path;

use crate::run::RunError;
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::{self, Overrides, Routine};
#[cfg(feature = "sim")]
use armcal_sim::WorldSpec;

/// All inputs of a run, read and checked before anything moves.
#[derive(Clone, Debug)]
pub struct RunInputs {
    pub routine: Routine,
    pub robot: Robot,
    pub vehicle: Vehicle,
    #[cfg(feature = "sim")]
    pub spec: WorldSpec,
}

impl RunInputs {
    /// Reads a routine and all files that it names.
    ///
    /// # Errors
    /// [`RunError`] naming file, key and allowed range.
    pub fn load(file: &Path, overrides: &Overrides) -> Result<Self, RunError> {
        let routine = routine::load_with(file, overrides)?;
        let (robot, vehicle) = routine.load_arm()?;
        #[cfg(feature = "sim")]
        let spec = WorldSpec::from_routine(&routine, &robot)?;
        Ok(Self {
            routine,
            robot,
            vehicle,
            #[cfg(feature = "sim")]
            spec,
        })
    }
}

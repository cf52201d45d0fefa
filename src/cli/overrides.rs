//! Options that replace parts of a routine; the same for every command that runs one.

use std::path::PathBuf;

use clap::Args;

use armcal_core::routine::{Override, Overrides};

#[derive(Clone, Debug, Default, Args)]
pub(super) struct OverrideArgs {
    /// Replace a key of the routine, such as world.camera.corner_noise_px=0.45; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
    /// Robot folder instead of the routine's
    #[arg(long, value_name = "DIR")]
    robot: Option<PathBuf>,
    /// Vehicle file instead of the routine's
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
}

impl OverrideArgs {
    pub fn overrides(&self) -> Overrides {
        Overrides { set: self.set.clone(), robot: self.robot.clone(), vehicle: self.vehicle.clone() }
    }
}

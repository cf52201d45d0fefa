//! Options that replace parts of a routine; the same for every command that runs one.

use std::path::PathBuf;

use clap::Args;
use toml::Value;

use crate::cli::named;
use armcal_core::routine::{Override, Overrides};

#[derive(Clone, Debug, Default, Args)]
pub struct OverrideArgs {
    /// Replace a key of the routine, such as world.camera.corner_noise_px=0.45 or vehicle=FILE; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
    /// Robot folder instead of the routine's
    #[arg(long, value_name = "DIR", value_parser = named::robot())]
    robot: Option<PathBuf>,
}

impl OverrideArgs {
    /// Overrides for the routine's reader. Paths of vehicle and robot are relative to the working directory.
    #[must_use]
    pub fn overrides(&self) -> Overrides {
        let mut overrides = Overrides { robot: self.robot.clone(), ..Overrides::default() };
        for one in &self.set {
            match (&one.key[..], &one.value) {
                ("vehicle", Value::String(file)) => overrides.vehicle = Some(file.into()),
                _ => overrides.set.push(one.clone()),
            }
        }
        overrides
    }
}

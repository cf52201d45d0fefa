//! `armcal serve`: the simulated arm on the topics of a real one.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use crate::cli::exit::Exit;
use crate::cli::named;
use crate::cli::overrides::OverrideArgs;

#[cfg(feature = "live")]
mod served;

#[derive(Debug, Args)]
pub(super) struct ServeArgs {
    /// The routine (.toml): its robot, vehicle, scene and world
    #[arg(value_parser = named::routine())]
    routine: PathBuf,
    /// Connection map that the client also uses; default: the topics of armcal's recordings
    #[arg(long, value_name = "ARM.toml")]
    arm: Option<PathBuf>,
    /// Speed of the arm's clock over real time, 0.05 to 50
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = factor)]
    factor: f64,
    /// End after this many seconds; default: at Ctrl-C
    #[arg(long = "for", value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Write the simulated truth to FILE.mcap
    #[arg(long, value_name = "FILE.mcap")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    overrides: OverrideArgs,
}

fn factor(text: &str) -> Result<f64, String> {
    let factor: f64 = text.parse().map_err(|error| format!("{error}"))?;
    if (0.05..=50.0).contains(&factor) { Ok(factor) } else { Err("it must be 0.05 .. 50".to_owned()) }
}

#[cfg(feature = "live")]
pub(super) fn serve(args: &ServeArgs) -> Result<Exit> {
    served::serve(args)
}

#[cfg(not(feature = "live"))]
pub(super) fn serve(_: &ServeArgs) -> Result<Exit> {
    Err(crate::cli::exit::not_built("serve"))
}

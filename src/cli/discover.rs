//! `armcal discover`: the topics of a ROS 2 domain as a proposed connection map.

use std::net::Ipv4Addr;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use crate::cli::exit::Exit;
use crate::cli::named;

#[cfg(feature = "live")]
mod looked;

/// Listens to a ROS 2 domain, and proposes a connection map with the topics of the arm.
#[derive(Debug, Args)]
pub(super) struct DiscoverArgs {
    /// ROS_DOMAIN_ID
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=232))]
    domain: u16,
    /// Address of a local interface to listen on; repeatable; default: all
    #[arg(long = "network", value_name = "ADDRESS")]
    networks: Vec<Ipv4Addr>,
    /// Robot folder whose joints are matched to the driver's
    #[arg(long, value_parser = named::robot())]
    robot: Option<PathBuf>,
    /// Listening time, s
    #[arg(long = "for", value_name = "SECONDS", default_value_t = 5.0, value_parser = seconds)]
    seconds: f64,
    /// Write the map here; default: stdout. Nothing is overwritten
    #[arg(long, value_name = "ARM.toml")]
    out: Option<PathBuf>,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|error| format!("{error}"))?;
    if (1.0..=3600.0).contains(&seconds) { Ok(seconds) } else { Err("it must be 1 .. 3600".to_owned()) }
}

#[cfg(feature = "live")]
pub(super) fn discover(args: &DiscoverArgs) -> Result<Exit> {
    looked::discover(args)
}

#[cfg(not(feature = "live"))]
pub(super) fn discover(_: &DiscoverArgs) -> Result<Exit> {
    Err(crate::cli::exit::not_built("discover"))
}

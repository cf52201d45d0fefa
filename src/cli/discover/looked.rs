//! Listening to a ROS 2 domain, and the map proposed from it.

use anyhow::Result;
use armcal_core::codes::Code;

use super::DiscoverArgs;
use crate::cli::calibration_inputs::load_robot;
use crate::cli::drive::watch_memory;
use crate::cli::exit::{Exit, UsageError};
use crate::cli::interrupt::Interrupt;
use crate::cli::stdout::{note, say};
use crate::output;
use armcal_core::text::counted;
use armcal_live::{Domain, LiveError, look_around, propose_connection};

pub(super) fn discover(args: &DiscoverArgs) -> Result<Exit> {
    let robot = args.robot.as_ref().map(|folder| load_robot(folder, &[])).transpose()?;
    if let Some(file) = args.out.as_deref().filter(|file| file.symlink_metadata().is_ok()) {
        return Err(
            UsageError::new(Code::FileExists, format!("{}: is there; name another --out", file.display())).into()
        );
    }
    let interrupt = Interrupt::install()?;
    let domain = Domain { number: args.domain, networks: args.networks.clone() };
    let memory = watch_memory(None)?;
    let seen = look_around(&domain, args.seconds, &|| interrupt.is_requested() || memory.check().is_err())?;
    memory.check()?;
    if seen.topics.is_empty() {
        return Err(LiveError::Nobody { domain: args.domain, seconds: args.seconds }.into());
    }
    let proposed = propose_connection(&seen, robot.as_ref());
    match &args.out {
        Some(file) => {
            output::write_together(&[(file.as_path(), proposed.text.as_bytes())])?;
            note(format_args!("written: {}; look at what it says was chosen", file.display()));
        }
        None => say(proposed.text.trim_end())?,
    }
    let (topics, services) = (counted(seen.topics.len(), "topic"), counted(seen.services.len(), "service"));
    note(format_args!("{topics} and {services} were seen"));
    if !proposed.missing.is_empty() {
        note(format_args!("left to fill in: {}", proposed.missing.join(", ")));
    }
    Ok(Exit::Ok)
}

//! `armcal drive`: the closed loop on a real arm. No other command moves one.

#[cfg(feature = "live")]
mod connected;
#[cfg(feature = "live")]
mod ending;
#[cfg(feature = "live")]
mod nudging;

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use crate::cli::closed_loop::LoopArgs;
use crate::cli::exit::Exit;
use crate::cli::named;
#[cfg(feature = "live")]
pub(super) use ending::watch_memory;

/// Moves a real arm by a routine, and asks before each motion.
#[derive(Debug, Args)]
pub(super) struct DriveArgs {
    /// Routine (.toml), or the name of one that comes with armcal
    #[arg(value_parser = named::routine())]
    routine: PathBuf,
    /// Connection map of the arm: over DDS, or over the bridge that its [rosbridge] names
    #[arg(long, value_name = "ARM.toml")]
    arm: PathBuf,
    /// Move the arm without asking before each motion
    #[arg(long)]
    unattended: bool,
    /// Listen to the arm, print what is heard, and move nothing
    #[arg(long)]
    no_motion: bool,
    /// First move each joint by one degree and back, each after a yes; continue only if all follow
    #[arg(long, conflicts_with_all = ["unattended", "no_motion"])]
    nudge: bool,
    /// Share of the joint rates in robot.toml, 0.01 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = share)]
    speed: f64,
    #[command(flatten)]
    closed_loop: LoopArgs,
}

fn share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|error| format!("{error}"))?;
    if (0.01..=1.0).contains(&share) { Ok(share) } else { Err("it must be 0.01 .. 1".to_owned()) }
}

#[cfg(feature = "live")]
pub(super) fn drive(args: &DriveArgs) -> Result<Exit> {
    use crate::cli::closed_loop::Asking;
    use crate::cli::interrupt::Interrupt;

    let started = std::time::Instant::now();
    let mut inputs = args.closed_loop.inputs(&args.routine)?;
    for sensor in &mut inputs.robot.sensors {
        sensor.max_rate_rad_s *= args.speed;
    }
    let mut arm = connected::ConnectedArm::open(&args.arm, &inputs)?;
    if args.no_motion {
        return Ok(Exit::Ok);
    }
    let interrupt = Interrupt::install()?;
    if args.nudge {
        arm.nudge(&inputs.robot, &interrupt)?;
    }
    let asking = if args.unattended { Asking::Nobody } else { Asking::EachMotion };
    args.closed_loop
        .carry_out(&inputs, (started, interrupt), asking, |output, progress| arm.execute(&inputs, output, progress))
}

#[cfg(not(feature = "live"))]
pub(super) fn drive(_: &DriveArgs) -> Result<Exit> {
    Err(crate::cli::exit::not_built("drive"))
}

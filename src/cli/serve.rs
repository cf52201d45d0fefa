//! `armcal serve`: the simulated arm behind the topics of a real one.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;

use crate::cli::exit::Exit;
use crate::cli::interrupt::Interrupt;
use crate::cli::overrides::OverrideArgs;
use crate::cli::stdout::note;
use crate::run::RunInputs;
use armcal_live::{Connection, Pace};
use armcal_sim::truth::TruthRecorder;
use armcal_sim::{World, WorldInput};

#[derive(Debug, Args)]
pub(super) struct ServeArgs {
    /// The routine (.toml): its robot, vehicle, scene and world
    routine: PathBuf,
    /// The connection map that the other side uses, too; the topics of our own recordings if not given
    #[arg(long, value_name = "ARM.toml")]
    arm: Option<PathBuf>,
    /// Seed of everything random in the world; the routine's own if not given
    #[arg(long)]
    seed: Option<u64>,
    /// The arm's time over ours
    #[arg(long, default_value_t = 1.0, value_parser = factor)]
    factor: f64,
    /// End after so many seconds; with Ctrl-C if not given
    #[arg(long = "for", value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Write the truth of this world into FILE.mcap
    #[arg(long, value_name = "FILE.mcap")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    overrides: OverrideArgs,
}

fn factor(text: &str) -> Result<f64, String> {
    let factor: f64 = text.parse().map_err(|error| format!("{error}"))?;
    if (0.05..=50.0).contains(&factor) { Ok(factor) } else { Err("it must be 0.05 .. 50".to_owned()) }
}

pub(super) fn serve(args: &ServeArgs) -> Result<Exit> {
    let inputs = RunInputs::load(&args.routine, &args.overrides.overrides())?;
    let connection = args.arm.as_deref().map_or_else(|| Ok(Connection::default()), Connection::load)?;
    let mut world = World::new(WorldInput {
        robot: &inputs.robot,
        vehicle: &inputs.vehicle,
        scene: &inputs.routine.scene,
        spec: inputs.spec.clone(),
        seed: args.seed.unwrap_or(inputs.routine.seed),
    })?;
    if let Some(file) = &args.truth {
        world.set_truth_sink(Box::new(TruthRecorder::create(file)?))?;
    }
    let interrupt = Interrupt::install()?;
    note(format_args!(
        "serving {} in ROS domain {}: readings on {}, set-points from {}",
        inputs.robot.name, connection.domain, connection.joint_sensors, connection.commands.topic
    ));
    let pace = Pace { factor: args.factor, seconds: args.seconds };
    let served = armcal_live::serve(&mut world, &inputs.robot, &connection, pace, &|| interrupt.is_requested());
    world.finish_truth().context("the truth")?;
    let served = served?;
    note(format_args!(
        "served {:.1} s of the arm's time in {:.1} s: {} set-points, {} of no use{}",
        served.arm_s,
        served.wall_s,
        served.commands,
        served.unusable,
        if served.stopped { "; it was told to stop" } else { "" }
    ));
    Ok(Exit::Ok)
}

//! The simulated world on its topics, until the user ends it.

use std::path::PathBuf;

use anyhow::{Context, Result};

use super::ServeArgs;
use crate::cli::drive::watch_memory;
use crate::cli::exit::Exit;
use crate::cli::interrupt::Interrupt;
use crate::cli::own_inputs::spare_inputs;
use crate::cli::stdout::note;
use crate::run::RunInputs;
use armcal_live::{Connection, Pace};
use armcal_sim::truth::TruthRecorder;
use armcal_sim::{World, WorldInput};

pub(super) fn serve(args: &ServeArgs) -> Result<Exit> {
    let inputs = RunInputs::load(&args.routine, &args.overrides.overrides())?;
    let connection = args.arm.as_deref().map_or_else(|| Ok(Connection::default()), Connection::load)?;
    let mut world = World::new(WorldInput {
        robot: &inputs.robot,
        vehicle: &inputs.vehicle,
        scene: &inputs.routine.scene,
        spec: inputs.spec.clone(),
        seed: inputs.routine.seed,
    })?;
    if let Some(file) = &args.truth {
        spare_inputs(file, [Some(&args.routine), args.arm.as_ref()].into_iter().flatten().map(PathBuf::as_path))?;
        world.set_truth_sink(Box::new(TruthRecorder::create(file)?))?;
    }
    let interrupt = Interrupt::install()?;
    note(format_args!(
        "serving {} in ROS domain {}: readings on {}, set-points from {}",
        inputs.robot.name, connection.domain, connection.joint_sensors, connection.commands.topic
    ));
    let pace = Pace { factor: args.factor, seconds: args.seconds };
    let memory = watch_memory(Some(&inputs.robot.camera.lens))?;
    let is_over = || interrupt.is_requested() || memory.check().is_err();
    let served = armcal_live::serve(&mut world, &inputs.robot, &connection, pace, &is_over);
    world.finish_truth().context("the truth")?;
    let served = served?;
    memory.check()?;
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

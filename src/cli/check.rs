//! `armcal check`: what is wrong with a file, before anything moves.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;

use super::exit::{Exit, UsageError};
use crate::calib::Calibration;
use crate::robot::{self, Robot};
use crate::routine::{self, Routine};

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// Robot folders or robot.toml files, routines, vehicles, calibrations
    #[arg(required = true)]
    files: Vec<PathBuf>,
}

pub(super) fn check(args: &CheckArgs) -> Result<Exit> {
    let mut all_good = true;
    for file in &args.files {
        match check_one(file) {
            Ok(found) => println!("ok: {}: {found}", file.display()),
            Err(error) => {
                all_good = false;
                println!("error: {}", super::explain(&error));
            }
        }
    }
    Ok(if all_good { Exit::Ok } else { Exit::InvalidInput })
}

fn check_one(file: &Path) -> Result<String> {
    if file.is_dir() {
        return Ok(describe_robot(&robot::load(file)?));
    }
    if file.file_name().is_some_and(|name| name == "robot.toml") {
        return Ok(describe_robot(&robot::load(file.parent().unwrap_or(Path::new(".")))?));
    }
    let text = std::fs::read_to_string(file).with_context(|| format!("{}: cannot be read", file.display()))?;
    let table: toml::Table = toml::from_str(&text).with_context(|| format!("{}: is no TOML", file.display()))?;
    if table.contains_key("robot") && table.contains_key("vehicle") {
        return check_routine(&routine::load(file)?);
    }
    if table.contains_key("part") {
        let vehicle = robot::load_vehicle(file)?;
        return Ok(format!("vehicle `{}`, {} parts", vehicle.name, vehicle.parts.len()));
    }
    if table.contains_key("messages_hash") {
        let calibration = Calibration::read(file)?;
        return Ok(format!("calibration of `{}`, {} joints", calibration.robot, calibration.joint.len()));
    }
    Err(UsageError(format!("{}: is none of robot, routine, vehicle, calibration", file.display())).into())
}

fn describe_robot(robot: &Robot) -> String {
    let mass_kg: f64 = robot.bodies.iter().map(|body| body.mass_kg).sum();
    let simulated = if robot.require_masses().is_ok() { "" } else { "; a link has no mass, so it cannot be simulated" };
    format!(
        "robot `{}`, {} joints, {} tags, {mass_kg:.1} kg{simulated}",
        robot.name,
        robot.n_joints(),
        robot.tags.len()
    )
}

fn check_routine(routine: &Routine) -> Result<String> {
    let robot = robot::load(&routine.robot_folder)?;
    let vehicle = robot::load_vehicle(&routine.vehicle_file)?;
    #[cfg(feature = "sim")]
    crate::sim::WorldSpec::from_table(&routine.world, &routine.file)?;
    let farthest = routine.task.targets_m.iter().map(|t| nalgebra::Vector3::from(*t).norm()).fold(0.0, f64::max);
    Ok(format!(
        "routine `{}`: robot `{}` on `{}`, {} poses and {} held out, {} targets up to {farthest:.2} m from the base",
        routine.name,
        robot.name,
        vehicle.name,
        routine.capture.poses,
        routine.capture.held_out,
        routine.task.targets_m.len()
    ))
}

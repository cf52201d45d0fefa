//! `armcal check`: what is wrong with a file, before anything moves.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;

#[cfg(feature = "sim")]
use crate::campaign::Request;
use crate::cli::exit::{Exit, UsageError, explain};
use crate::cli::overrides::OverrideArgs;
use crate::cli::stdout::say;
use armcal_belief::calib::{Calibration, CalibrationFileError};
use armcal_belief::plan::{ClearanceModel, PlanFile, SceneCheck, SceneIssues, grips_at_first};
use armcal_belief::tagmap::files::read_landmarks;
use armcal_core::input::{InputMap, Source, TagUse, Topics, read_input_map, read_task};
use armcal_core::robot::{self, Robot, Vehicle};
use armcal_core::routine::{self, Overrides, Routine, Step};
use armcal_core::stats::stream_rng;
use armcal_core::text::counted;

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// Robot folders or robot.toml files, routines, vehicles, calibrations, input maps, tag maps, tasks, plans
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// For the routines among them
    #[command(flatten)]
    overrides: OverrideArgs,
}

pub(super) fn check(args: &CheckArgs) -> Result<Exit> {
    let overrides = args.overrides.overrides();
    let mut all_good = true;
    for file in &args.files {
        match check_one(file, &overrides) {
            Ok(found) => {
                say(&format!("ok: {}: {}", file.display(), found.text))?;
                for warning in &found.warnings {
                    say(&format!("warning: {}: {warning}", file.display()))?;
                }
            }
            Err(error) => {
                all_good = false;
                say(&format!("error: {}", explain(&error)))?;
            }
        }
    }
    Ok(if all_good { Exit::Ok } else { Exit::InvalidInput })
}

/// What a file holds, and what a run would go on without.
struct Found {
    text: String,
    warnings: Vec<String>,
}

fn check_one(file: &Path, overrides: &Overrides) -> Result<Found> {
    if file.is_dir() {
        return check_robot(file);
    }
    if file.file_name().is_some_and(|name| name == "robot.toml") {
        return check_robot(file.parent().unwrap_or(Path::new(".")));
    }
    let text = robot::read_text(file)?;
    let table: toml::Table = robot::parse_toml(file, &text)?;
    if table.contains_key("robot") && table.contains_key("vehicle") && !table.contains_key("inputs_hash") {
        return check_routine(file, overrides);
    }
    Ok(Found { text: describe(file, &text, &table)?, warnings: Vec::new() })
}

/// What a file that is neither robot nor routine holds.
fn describe(file: &Path, text: &str, table: &toml::Table) -> Result<String> {
    if table.contains_key("inputs_hash") {
        let plan = PlanFile::read(file)?;
        let (poses, least_m) = (plan.pose.len(), plan.totals.least_clearance_m);
        let arm_min = plan.totals.arm_time_s / 60.0;
        return Ok(format!(
            "plan for `{}`, {poses} poses in {arm_min:.1} min, at least {least_m:.3} m clear",
            plan.robot
        ));
    }
    if table.contains_key("part") {
        let vehicle = robot::load_vehicle(file)?;
        let tags = vehicle
            .survey
            .as_ref()
            .map_or_else(String::new, |survey| format!(", {}", counted(survey.tags.len(), "tag")));
        return Ok(format!("vehicle `{}`, {} parts{tags}", vehicle.name, vehicle.parts.len()));
    }
    if table.contains_key("joint_sensors") && table.contains_key("tags") {
        return Ok(describe_input(&read_input_map(file)?));
    }
    if table.contains_key("frame") && table.contains_key("tag") {
        let map = read_landmarks(file)?;
        return Ok(format!("tag map in the frame `{}`, {}", map.frame, counted(map.landmarks.len(), "landmark")));
    }
    if table.contains_key("tolerance_m") {
        let task = read_task(file)?;
        let (targets, poses) = (task.targets_m.len(), task.poses_rad.len());
        return Ok(format!("task, {targets} targets and {poses} poses, tolerance {} mm", task.tolerance_m * 1e3));
    }
    if table.contains_key("messages_hash") {
        return describe_calibration(file, text);
    }
    if table.contains_key("robot") && table.contains_key("task") {
        return Err(UsageError(format!(
            "{}: vehicle: is missing; a routine names the vehicle that carries the arm: \
             robots/vehicles/fixed-base.toml is an arm bolted to the ground",
            file.display()
        ))
        .into());
    }
    Err(UsageError(format!(
        "{}: is none of robot, routine, vehicle, calibration, input map, tag map, task, plan",
        file.display()
    ))
    .into())
}

/// One without its covariance still moves an arm; one beside another's is wrong.
fn describe_calibration(file: &Path, text: &str) -> Result<String> {
    let (calibration, without) = match Calibration::read(file) {
        Ok(calibration) => (calibration, String::new()),
        Err(CalibrationFileError::NoCovariance { file: covariance, .. }) => (
            Calibration::parse(file, text)?,
            format!("; no prior for another, for {} is missing", covariance.display()),
        ),
        Err(error) => return Err(error.into()),
    };
    let (joints, valid) = (calibration.joint.len(), calibration.valid_for().join(", "));
    Ok(format!("calibration of `{}`, {joints} joints; valid for {valid}{without}", calibration.robot))
}

fn describe_input(map: &InputMap) -> String {
    let landmark = map.child_frame.as_ref().map_or_else(|| "tags".to_owned(), |child| format!("`{}`", child.text()));
    let what = match map.tag_use {
        TagUse::Corners => "corners".to_owned(),
        TagUse::Pose => format!("poses of {landmark}"),
        TagUse::Position => format!("positions of {landmark}"),
    };
    match &map.source {
        Source::Topics(Topics { joints, tags, camera_frame, .. }) => {
            let seen_from = match (map.tag_use, camera_frame) {
                (TagUse::Pose | TagUse::Position, Some(camera)) => format!(" in `{camera}`"),
                _ => String::new(),
            };
            format!("input map: joint readings on {joints}, {what}{seen_from} on {tags}")
        }
        Source::Table(table) => format!("input map: a table, {what} in {}", table.position.join(", ")),
    }
}

/// What only planning lacks is a warning: an arm that records needs none of it.
fn check_robot(folder: &Path) -> Result<Found> {
    let robot = robot::load(folder)?;
    let missing = robot.planning_issues.iter();
    let warnings = missing.map(|issue| format!("run and plan will refuse it: {}: {}", issue.key, issue.problem));
    Ok(Found { text: describe_robot(&robot)?, warnings: warnings.collect() })
}

fn describe_robot(robot: &Robot) -> Result<String> {
    let is_stowed = !robot.planning_issues.iter().any(|issue| issue.key == "stowed_rad");
    let overlaps = ClearanceModel::of_arm_alone(robot).overlaps(&robot.stowed);
    if let Some(pair) = overlaps.first().filter(|_| is_stowed) {
        let file = robot.folder.join("robot.toml");
        return Err(UsageError(format!(
            "{}: stowed_rad: {pair} overlap there ({} pairs in all). Links that touch by design belong to \
             allowed_pairs",
            file.display(),
            overlaps.len()
        ))
        .into());
    }
    let mass_kg: f64 = robot.bodies.iter().map(|body| body.mass_kg).sum();
    let simulated = if robot.require_masses().is_ok() { "" } else { "; a link has no mass, so it cannot be simulated" };
    Ok(format!(
        "robot `{}`, {}, {}, {mass_kg:.1} kg{simulated}",
        robot.name,
        counted(robot.n_joints(), "joint"),
        counted(robot.tags.len(), "tag")
    ))
}

/// The scene's geometry: stowed arm, tags and targets.
fn scene_issues(routine: &Routine, robot: &Robot, vehicle: &Vehicle) -> SceneIssues {
    let model = || ClearanceModel::new(robot, vehicle, &routine.scene);
    let (clearance, open) = (model(), model().with_open_jaws());
    // As a run plans them.
    let clearance_at_targets = if grips_at_first(&routine.steps) { &open } else { &clearance };
    let check = SceneCheck { robot, routine, clearance: &clearance, clearance_at_targets };
    check.issues(&mut stream_rng(routine.seed, "check"))
}

fn check_routine(file: &Path, overrides: &Overrides) -> Result<Found> {
    let routine = &routine::load_with(file, overrides)?;
    let (robot, vehicle) = routine.load_arm()?;
    #[cfg(feature = "sim")]
    let beyond = armcal_sim::WorldSpec::from_routine(routine, &robot)?.beyond_datasheet(&robot);
    #[cfg(not(feature = "sim"))]
    let beyond = Vec::new();
    let SceneIssues { errors, mut warnings } = scene_issues(routine, &robot, &vehicle);
    warnings.extend(beyond);
    if !errors.is_empty() {
        return Err(UsageError(format!("{}: {}", file.display(), errors.join("; "))).into());
    }
    #[cfg(feature = "sim")]
    if !routine.campaign.matrix.is_empty() {
        // Every point of the matrix is a routine of its own.
        crate::campaign::Prepared::load(Request { routine: file.to_owned(), overrides: overrides.clone() })?;
    }
    let farthest = routine.task.targets_m.iter().map(|t| nalgebra::Vector3::from(*t).norm()).fold(0.0, f64::max);
    let text = format!(
        "routine `{}`: robot `{}` on `{}`, {} steps ({}), {} targets up to {farthest:.2} m from the base",
        routine.name,
        robot.name,
        vehicle.name,
        routine.steps.len(),
        routine.steps.iter().map(described).collect::<Vec<_>>().join(", "),
        routine.task.targets_m.len()
    );
    Ok(Found { text, warnings })
}

fn described(step: &Step) -> String {
    match step {
        Step::Capture(capture) => format!("capture of {} poses and {} held out", capture.poses, capture.held_out),
        step => step.name().to_owned(),
    }
}

//! `armcal check`: errors of a file, before anything moves.

use armcal_core::codes::{Code, Coded, Warning};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use clap::Args;
use serde::Serialize;

#[cfg(feature = "sim")]
use crate::campaign::Request;
use crate::cli::closing::say_wrapped;
use crate::cli::exit::{Exit, UsageError, code_of, message_of};
use crate::cli::file_kind::FileKind;
use crate::cli::stdout::say;
use armcal_belief::calib::{Calibration, CalibrationFileError, Status};
use armcal_belief::plan::{ClearanceModel, PlanFile, SceneCheck, SceneIssues, grips_at_first};
use armcal_belief::tagmap::files::read_landmarks;
use armcal_core::document::{missing_kind, stated_kind};
use armcal_core::input::{InputMap, SeenColumns, Source, TagUse, Topics, read_input_map, read_task};
use armcal_core::kind::Kind;
use armcal_core::robot::{self, Robot, Vehicle};
use armcal_core::routine::{self, Override, Overrides, Routine, Step};
use armcal_core::stats::stream_rng;
use armcal_core::text::counted;

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// Robot folders, routines, vehicles, calibrations, input maps, tag maps, tasks or plans
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Print JSON instead of text: a list with one entry per file
    #[arg(long)]
    json: bool,
    /// For the routines among them
    /// Replace a key of the routines, such as capture.poses=20; repeatable
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
}

pub(super) fn check(args: &CheckArgs) -> Result<Exit> {
    let context = Context {
        overrides: Overrides { set: args.set.clone(), ..Overrides::default() },
        robot: only_robot(&args.files),
    };
    let checked = args.files.iter().map(|file| Checked::of(file, &context));
    let checked: Vec<Checked> = if args.json {
        let checked: Vec<Checked> = checked.collect();
        say(&serde_json::to_string_pretty(&checked).context("the answer has no JSON form")?)?;
        checked
    } else {
        checked.map(|checked| say_wrapped(&checked.lines()).map(|()| checked)).collect::<Result<_>>()?
    };
    let is_bad = |checked: &Checked| !checked.ok && !checked.refused;
    Ok(match (checked.iter().any(is_bad), checked.iter().any(|checked| checked.refused)) {
        (true, _) => Exit::InvalidInput,
        (false, true) => Exit::Refused,
        (false, false) => Exit::Ok,
    })
}

/// Settings for all files, and the robot that the tasks and calibrations among them are for.
struct Context {
    overrides: Overrides,
    robot: Option<Robot>,
}

/// Returns the robot of the only robot folder among `files`; `None` where there are several or where it does not read.
fn only_robot(files: &[PathBuf]) -> Option<Robot> {
    let mut folders = files.iter().filter(|file| FileKind::of(file) == Some(FileKind::RobotFolder));
    let folder = folders.next().filter(|_| folders.next().is_none())?;
    robot::load(folder).ok()
}

/// Result for one file.
#[derive(Serialize)]
struct Checked {
    file: String,
    ok: bool,
    /// True for a refused calibration; `error` has the reason.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    refused: bool,
    /// Contents of the file in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    holds: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    warnings: Vec<Warning>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    /// Code of the error.
    #[serde(skip_serializing_if = "Option::is_none")]
    code: Option<Code>,
}

impl Checked {
    fn of(file: &Path, context: &Context) -> Self {
        let name = file.display().to_string();
        match check_one(file, context) {
            Ok(Found { text, warnings, refusal }) => {
                let (error, code) = refusal.unzip();
                let refused = error.is_some();
                Self { file: name, ok: !refused, refused, holds: Some(text), warnings, error, code }
            }
            Err(error) => {
                let code = Some(code_of(&error));
                let (warnings, error) = (Vec::new(), Some(message_of(&error)));
                Self { file: name, ok: false, refused: false, holds: None, warnings, error, code }
            }
        }
    }

    fn lines(&self) -> String {
        let Self { file, holds, warnings, error, code, refused, .. } = self;
        let kind = if *refused { "REFUSED" } else { "ok" };
        let found = holds.iter().map(|holds| format!("{kind}: {file}: {holds}"));
        let warnings = warnings.iter().map(|warning| format!("warning: {file}: {warning}"));
        let kind = if *refused { "because" } else { "error" };
        let errors = error.iter().zip(code).map(|(error, code)| format!("{kind}: {error} [{code}]"));
        found.chain(warnings).chain(errors).collect::<Vec<_>>().join("\n")
    }
}

/// Contents of a file, and its warnings.
struct Found {
    text: String,
    warnings: Vec<Warning>,
    /// Reason of a calibration's refusal, and its code.
    refusal: Option<(String, Code)>,
}

impl Found {
    fn whole(text: String) -> Self {
        Self { text, warnings: Vec::new(), refusal: None }
    }
}

fn check_one(file: &Path, context: &Context) -> Result<Found> {
    if file.is_dir() {
        expect_robot_folder(file)?;
        return check_robot(file);
    }
    expect_toml(file)?;
    expect_readable(file)?;
    let text = robot::read_text(file)?;
    let table: toml::Table = robot::parse_toml(file, &text)?;
    let kind = stated_kind(file, &table, is_robot_toml(file).then_some(Kind::Robot))?;
    expect_stated(file, kind, &table)?;
    check_kind(file, kind, &text, context)
}

/// Refuses a file without the key `kind` if its other keys identify its kind to other commands.
fn expect_stated(file: &Path, kind: Kind, table: &toml::Table) -> Result<()> {
    if table.contains_key("kind") { Ok(()) } else { Err(missing_kind(file, kind).into()) }
}

fn is_robot_toml(file: &Path) -> bool {
    file.file_name().is_some_and(|name| name == "robot.toml")
}

fn check_kind(file: &Path, kind: Kind, text: &str, context: &Context) -> Result<Found> {
    let folder = file.parent().unwrap_or(Path::new("."));
    match kind {
        Kind::Routine => check_routine(file, &context.overrides),
        Kind::Calibration => describe_calibration(file, text, context.robot.as_ref()),
        Kind::Task => describe_task(file, context.robot.as_ref()),
        Kind::Robot if !is_robot_toml(file) => {
            let problem = format!(
                "{}: is a robot.toml under another name; call it robot.toml, in a folder with its URDF",
                file.display()
            );
            Err(UsageError::new(Code::FileKind, problem).into())
        }
        Kind::Robot | Kind::SelfCollision => check_robot(folder),
        kind => Ok(Found::whole(describe(file, kind)?)),
    }
}

/// Files of results that `check` reads, in the order in which a folder's are named.
const RESULTS: [&str; 3] = ["calibration.toml", "plan.toml", "tagmap.toml"];
/// Extensions of results and tables that `check` does not read.
const UNREAD: [&str; 8] = ["json", "jsonl", "csv", "html", "md", "xml", "svg", "parquet"];

/// Refuses the folder of a result, and names the file in it that `check` reads.
fn expect_robot_folder(folder: &Path) -> Result<()> {
    let is_there = |name: &&&str| folder.join(name).is_file();
    match RESULTS.iter().find(is_there).filter(|_| !folder.join("robot.toml").exists()) {
        Some(name) => {
            let (folder, file) = (folder.display(), folder.join(name));
            let problem = format!("{folder}: is a folder of results, not a robot folder; give {}", file.display());
            Err(UsageError::new(Code::FileKind, problem).into())
        }
        None => Ok(()),
    }
}

/// Refuses files of results that are no TOML.
fn expect_readable(file: &Path) -> Result<()> {
    let ending = file.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !UNREAD.contains(&ending.as_str()) || !file.is_file() {
        return Ok(());
    }
    let file = file.display();
    let problem = format!(
        "{file}: is a .{ending} file, which `check` does not read; give a TOML file, such as calibration.toml or \
         plan.toml"
    );
    Err(UsageError::new(Code::FileKind, problem).into())
}

/// Refuses recordings and URDFs, and names the commands for them.
fn expect_toml(file: &Path) -> Result<()> {
    let advice = match FileKind::of(file) {
        Some(FileKind::Recording | FileKind::Bag) => "`armcal inspect` says what is in it",
        Some(FileKind::Urdf) => "`armcal new-robot` makes a robot folder of it",
        Some(FileKind::Rerun) => "open it with `rerun FILE`",
        _ => return Ok(()),
    };
    let (name, kind) = (file.display(), FileKind::of(file).map_or("", FileKind::name));
    Err(UsageError::new(Code::FileKind, format!("{name}: is {kind}, which `check` does not read; {advice}")).into())
}

/// Describes a file that needs no other one.
fn describe(file: &Path, kind: Kind) -> Result<String> {
    match kind {
        Kind::Plan => {
            let plan = PlanFile::read(file)?;
            let (poses, least_m) = (plan.pose.len(), plan.totals.least_clearance_m);
            let arm_min = plan.totals.arm_time_s / 60.0;
            Ok(format!("plan for `{}`, {poses} poses in {arm_min:.1} min, at least {least_m:.3} m clear", plan.robot))
        }
        Kind::Vehicle => {
            let vehicle = robot::load_vehicle(file)?;
            let n_tags = vehicle.survey.as_ref().map(|survey| survey.tags.len());
            let tags = n_tags.map_or_else(String::new, |n| format!(", {}", counted(n, "tag")));
            Ok(format!("vehicle `{}`, {} parts{tags}", vehicle.name, vehicle.parts.len()))
        }
        Kind::Input => Ok(describe_input(&read_input_map(file)?)),
        Kind::TagMap => {
            let map = read_landmarks(file)?;
            Ok(format!("tag map in the frame `{}`, {}", map.frame, counted(map.landmarks.len(), "landmark")))
        }
        Kind::Scene => Ok(format!("scene, {}", counted(routine::load_scene(file)?.obstacles.len(), "obstacle"))),
        #[cfg(feature = "live")]
        Kind::Arm => {
            let connection = armcal_live::Connection::load(file)?;
            Ok(format!("connection map: set-points on {}", connection.commands.topic))
        }
        kind => {
            let (file, in_words, takers) = (file.display(), kind.in_words(), kind.takers());
            Err(UsageError::new(
                Code::FileKind,
                format!("{file}: is {in_words}, which `check` does not read; {takers}"),
            )
            .into())
        }
    }
}

/// Describes a task, and checks it against the robot's joints where one is given with it.
fn describe_task(file: &Path, robot: Option<&Robot>) -> Result<Found> {
    let task = read_task(file)?;
    if let Some(robot) = robot {
        task.check_poses(file, robot)?;
    }
    let (targets, poses) = (task.targets_m.len(), task.poses_rad.len());
    let text = format!("task, {targets} targets and {poses} poses, tolerance {} mm", task.tolerance_m * 1e3);
    Ok(Found::whole(text))
}

/// Describes a calibration. Without its covariance it can still move an arm; with another calibration's covariance it
/// is an error, and with a robot folder that it was not made with.
fn describe_calibration(file: &Path, text: &str, robot: Option<&Robot>) -> Result<Found> {
    let (calibration, without) = match Calibration::read(file) {
        Ok(calibration) => (calibration, String::new()),
        Err(CalibrationFileError::NoCovariance { file: covariance, .. }) => (
            Calibration::parse(file, text)?,
            format!("; no prior for another, for {} is missing", covariance.display()),
        ),
        Err(error) => return Err(error.into()),
    };
    robot.map_or(Ok(()), |robot| calibration.check_robot(file, robot))?;
    let (joints, valid) = (calibration.joint.len(), calibration.valid_for().join(", "));
    let text = format!("calibration of `{}`, {joints} joints; valid for {valid}{without}", calibration.robot);
    let refusal = calibration.refusals.first().map(|first| (first.cause(), first.code()));
    let refusal = refusal.filter(|_| calibration.status == Status::Refused);
    Ok(Found { refusal, ..Found::whole(text) })
}

fn describe_input(map: &InputMap) -> String {
    let landmark = map.child_frame.as_ref().map_or_else(|| "tags".to_owned(), |child| format!("`{}`", child.text()));
    let what = match map.tag_use {
        TagUse::Corners => "corners".to_owned(),
        TagUse::BoardCorners => format!("corners of the board {landmark}"),
        TagUse::Pose => format!("poses of {landmark}"),
        TagUse::Position => format!("positions of {landmark}"),
    };
    match &map.source {
        Source::Topics(Topics { joints, tags, camera_frame, further, .. }) => {
            let seen_from = match (map.tag_use, camera_frame) {
                (TagUse::Pose | TagUse::Position, Some(camera)) => format!(" in `{camera}`"),
                _ => String::new(),
            };
            let further = further.iter().map(|further| format!("; those of `{}` on {}", further.camera, further.topic));
            format!("input map: joint readings on {joints}, {what}{seen_from} on {tags}{}", further.collect::<String>())
        }
        Source::Table(table) => {
            let columns = match &table.seen {
                SeenColumns::Pose(pose) => pose.position.join(", "),
                SeenColumns::Pixel(pixel) | SeenColumns::TagCorner { pixel, .. } => pixel.join(", "),
                SeenColumns::TagCorners { columns, .. } => columns.join(", "),
            };
            let of = table.tags.as_ref().map_or(String::new(), |tags| format!(" of {}", tags.file.display()));
            format!("input map: a table, {what} in {columns}{of}")
        }
    }
}

/// Describes a robot folder. Missing data for planning is only a warning, because recording needs none of it.
fn check_robot(folder: &Path) -> Result<Found> {
    let robot = robot::load(folder)?;
    let file = folder.join("robot.toml");
    expect_stated(&file, Kind::Robot, &robot::parse_toml(&file, &robot::read_text(&file)?)?)?;
    let missing = robot.planning_issues.iter();
    let refused = missing.map(|issue| format!("run and plan will refuse it: {}: {}", issue.key, issue.problem));
    let lost = robot.base_tag.filter(|_| robot.tags.is_empty());
    let lost = lost.map(|id| {
        format!("base_tag: there is no [[tag]], so that tag {id} must be one of the vehicle's, or of a tag map")
    });
    let for_planning = refused.chain(lost).map(|text| Warning::new(Code::PlanningIncomplete, text));
    let warnings = robot.urdf_warnings.iter().cloned().chain(for_planning).collect();
    Ok(Found { warnings, ..Found::whole(describe_robot(&robot)?) })
}

fn describe_robot(robot: &Robot) -> Result<String> {
    let is_stowed = !robot.planning_issues.iter().any(|issue| issue.key == "stowed_rad");
    let overlaps = ClearanceModel::of_arm_alone(robot).overlaps(&robot.stowed);
    if let Some(pair) = overlaps.first().filter(|_| is_stowed) {
        let file = robot.folder.join("robot.toml");
        return Err(UsageError::new(
            Code::ClearanceTooSmall,
            format!(
                "{}: stowed_rad: {pair} overlap there ({} pairs in all). Links that touch by design belong to \
             allowed_pairs",
                file.display(),
                overlaps.len()
            ),
        )
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

/// Checks the scene's geometry: stowed arm, tags and targets.
fn scene_issues(routine: &Routine, robot: &Robot, vehicle: &Vehicle) -> SceneIssues {
    let model = || ClearanceModel::new(robot, vehicle, &routine.scene);
    let (clearance, open) = (model(), model().with_open_jaws());
    // The clearance model is that of a run.
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
    let beyond: Vec<String> = Vec::new();
    let SceneIssues { errors, mut warnings } = scene_issues(routine, &robot, &vehicle);
    warnings.extend(beyond.into_iter().map(|text: String| Warning::new(Code::WorldBeyondDatasheet, text)));
    if !errors.is_empty() {
        return Err(UsageError::new(Code::ValueInvalid, format!("{}: {}", file.display(), errors.join("; "))).into());
    }
    #[cfg(feature = "sim")]
    if !routine.campaign.matrix.is_empty() {
        // Every point of the matrix is a separate routine.
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
    Ok(Found { warnings, ..Found::whole(text) })
}

fn described(step: &Step) -> String {
    match step {
        Step::Capture(capture) => format!("capture of {} poses and {} held out", capture.poses, capture.held_out),
        step => step.name().to_owned(),
    }
}

//! `armcal plan`: poses and paths of a routine's first capture, without moving.

use armcal_core::codes::Code;
use armcal_core::kind::Kind;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use comfy_table::presets::{ASCII_MARKDOWN, UTF8_FULL_CONDENSED};
use comfy_table::{CellAlignment, Table};

use crate::cli::calibration_inputs::read_prior;
use crate::cli::closing::{say_closing, terminal_width};
use crate::cli::exit::Exit;
use crate::cli::file_kind::{expect_option, expect_routine};
use crate::cli::named;
use crate::cli::overrides::OverrideArgs;
use crate::cli::own_inputs::spare_inputs;
use crate::cli::stdout::{is_quiet, note, say, warn};
use crate::output;
use crate::report::fit_columns;
use armcal_belief::calib::Calibration;
use armcal_belief::plan::{
    ArmBelief, ClearanceModel, ItineraryRequest, PlanFile, PlanHeader, PoseTable, SetName, count_digits, plan_itinerary,
};
use armcal_core::files::{self, FileKind as Size};
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::{self, Overrides, Routine, Step, effective_table};
use armcal_core::stats::stream_rng;

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    /// Routine (.toml), or the name of one that comes with armcal
    #[arg(value_parser = named::routine())]
    routine: PathBuf,
    /// Accepted calibration.toml of this arm as prior; default: the datasheet
    #[arg(long, value_name = "CALIBRATION.toml")]
    prior: Option<PathBuf>,
    /// Output folder for plan.toml, plan.md and plan.rrd; default: recordings/ROUTINE-NAME-plan
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Also print each pose with its joints, counts and tags
    #[arg(long)]
    details: bool,
    /// Print the plan as JSON, with the keys of plan.toml
    #[arg(long, conflicts_with = "details")]
    json: bool,
    #[command(flatten)]
    overrides: OverrideArgs,
}

/// Files of a plan, in the output folder.
const RESULTS: [&str; 3] = ["plan.rrd", "plan.md", "plan.toml"];
/// Version of the hash; a new meaning of the file needs a new version.
const DOMAIN: &[u8] = b"armcal plan 1";

pub(super) fn plan(args: &PlanArgs) -> Result<Exit> {
    expect_routine(&args.routine)?;
    expect_option(args.prior.as_deref(), Kind::Calibration)?;
    let overrides = args.overrides.overrides();
    let routine = routine::load_with(&args.routine, &overrides)?;
    let (robot, vehicle) = routine.load_arm()?;
    let out = args.out.clone().unwrap_or_else(|| Path::new("recordings").join(format!("{}-plan", routine.name)));
    for name in RESULTS {
        spare_inputs(
            &out.join(name),
            [Some(&args.routine), args.prior.as_ref()].into_iter().flatten().map(PathBuf::as_path),
        )?;
    }
    output::check_takes_files(&out)?;
    let prior = args.prior.as_deref().map(|file| Ok::<_, anyhow::Error>((read_prior(file, &robot)?, read(file)?)));
    let prior = prior.transpose()?;
    let file = plan_of((&args.routine, &overrides), &routine, (&robot, &vehicle), prior)?;
    for warning in &file.warnings {
        note(format_args!("warning: {warning}"));
    }
    for left in &file.left_out {
        warn(Code::PoseSkipped, format_args!("a pose is left out: {}", left.reason));
    }
    output::make_folder(&out)?;
    let (toml, markdown) = (file.to_toml(), markdown(&file, &robot));
    let (toml_path, markdown_path) = (out.join("plan.toml"), out.join("plan.md"));
    #[cfg(feature = "viewer")]
    let rrd = (out.join("plan.rrd"), picture(&routine, (&robot, &vehicle), &file, &markdown)?);
    output::write_together(&[
        #[cfg(feature = "viewer")]
        (&rrd.0, &rrd.1),
        (&markdown_path, markdown.as_bytes()),
        (&toml_path, toml.as_bytes()),
    ])?;
    say_plan(args, (&file, &robot), &out)?;
    Ok(Exit::Ok)
}

fn read(path: &Path) -> Result<Vec<u8>> {
    files::read_bytes(path, Size::Text).with_context(|| format!("{}: cannot be read", path.display()))
}

/// The plan of a routine's first capture; `prior` is a calibration and the bytes of its file.
///
/// # Errors
/// A routine that cannot be read, and targets or views that no certified path reaches.
pub fn plan_routine(routine_file: &Path, prior: Option<Calibration>) -> Result<PlanFile> {
    let routine = routine::load(routine_file)?;
    let (robot, vehicle) = routine.load_arm()?;
    if let Some(prior) = &prior {
        prior.check_robot(Path::new("calibration.toml"), &robot)?;
    }
    let prior = prior.map(|prior| {
        let text = prior.to_toml().into_bytes();
        (prior, text)
    });
    plan_of((routine_file, &Overrides::default()), &routine, (&robot, &vehicle), prior)
}

fn plan_of(
    (file, overrides): (&Path, &Overrides),
    routine: &Routine,
    (robot, vehicle): (&Robot, &Vehicle),
    prior: Option<(Calibration, Vec<u8>)>,
) -> Result<PlanFile> {
    let (prior, prior_text) = prior.unzip();
    let belief = match prior {
        None => ArmBelief::datasheet(robot),
        Some(prior) => ArmBelief::of(robot, prior)?,
    };
    let seed = routine.seed;
    let header = PlanHeader {
        routine: routine.name.clone(),
        vehicle: vehicle.name.clone(),
        seed,
        inputs_hash: inputs_hash(file, overrides, (robot, vehicle), &prior_text.unwrap_or_default(), seed)?,
        margin_m: routine.capture.clearance_m,
    };
    planned(routine, (robot, vehicle), &belief, header)
}

fn say_plan(args: &PlanArgs, (file, robot): (&PlanFile, &Robot), out: &Path) -> Result<()> {
    if args.json {
        return say(&serde_json::to_string_pretty(file).context("the plan has no JSON form")?);
    }
    let totals = totals(file);
    if is_quiet() {
        return say(totals.lines().next().unwrap_or_default());
    }
    let out = out.display();
    let next =
        format!("written      {out}\nnext         {out}/plan.md for the operator, {out}/plan.rrd for the viewer");
    if args.details {
        say_closing(&format!("{}\n{totals}\n{next}", table((file, robot), UTF8_FULL_CONDENSED, terminal_width())))
    } else {
        say_closing(&format!("{totals}\n{next}; print each pose with --details"))
    }
}

fn planned(
    routine: &Routine,
    (robot, vehicle): (&Robot, &Vehicle),
    belief: &ArmBelief,
    header: PlanHeader,
) -> Result<PlanFile> {
    let model = || ClearanceModel::new(robot, vehicle, &routine.scene);
    let clearance = model();
    let open = model().with_open_jaws();
    let is_touched = routine.steps.iter().any(|step| matches!(step, Step::Reach(reach) if reach.touch));
    let clearance_at_targets = if is_touched { &open } else { &clearance };
    let request = ItineraryRequest { robot, routine, clearance: &clearance, clearance_at_targets, belief };
    let itinerary = plan_itinerary(&request, &mut stream_rng(header.seed, "plan"))?;
    Ok(PlanFile::new(header, &itinerary, belief, robot))
}

/// The plan as .rrd, to be put in place with the other files.
#[cfg(feature = "viewer")]
fn picture(
    routine: &Routine,
    (robot, vehicle): (&Robot, &Vehicle),
    plan: &PlanFile,
    markdown: &str,
) -> Result<Vec<u8>> {
    let folder = tempfile::tempdir().context("no temporary folder can be made")?;
    let path = folder.path().join("plan.rrd");
    let (scene, task) = (&routine.scene, &routine.task);
    armcal_replay::write_plan_rrd(&armcal_replay::PlanInput { plan, robot, vehicle, scene, task, markdown }, &path)?;
    std::fs::read(&path).context("plan.rrd cannot be read back")
}

/// BLAKE3 over all inputs of the plan; 64 hexadecimal digits. Comments and paths of files are omitted.
fn inputs_hash(
    routine: &Path,
    overrides: &Overrides,
    (robot, vehicle): (&Robot, &Vehicle),
    prior: &[u8],
    seed: u64,
) -> Result<String> {
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    let mut table = effective_table(routine, &overrides.set)?;
    for key in ["seed", "robot", "vehicle", "world", "campaign", "regress"] {
        table.remove(key);
    }
    add(DOMAIN);
    add(env!("CARGO_PKG_VERSION").as_bytes());
    add(&seed.to_le_bytes());
    add(table.to_string().as_bytes());
    add(&read(&robot.folder.join("robot.toml"))?);
    add(robot.urdf_text.as_bytes());
    add(vehicle.text.as_bytes());
    add(prior);
    Ok(hasher.finalize().to_hex().to_string())
}

/// Table of the plan for people, in degrees and millimetres.
fn table((file, robot): (&PlanFile, &Robot), preset: &str, width: Option<usize>) -> String {
    let mut table = Table::new();
    table.load_preset(preset);
    table.set_header([
        "pose",
        "for",
        "joints, deg",
        "counts by datasheet",
        "tags",
        "clear, mm",
        "tool error, mm",
        "at, s",
    ]);
    for pose in &file.pose {
        table.add_row(row(pose, robot));
    }
    for column in [0, 5, 6, 7] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    fit_columns(&mut table, width);
    table.to_string()
}

fn row(pose: &PoseTable, robot: &Robot) -> [String; 8] {
    let degrees: Vec<String> = pose.angles_rad.iter().map(|angle| format!("{:.1}", angle.to_degrees())).collect();
    let with_digits = pose.raw_counts.iter().zip(&robot.sensors);
    let counts: Vec<String> = with_digits
        .map(|(value, sensor)| format!("{value:.digits$}", digits = count_digits(sensor.counts_per_rad)))
        .collect();
    let tags = pose.tags.iter().map(|tag| match tag.probability {
        certain if certain > 0.995 => tag.id.to_string(),
        share => format!("{} ({:.0} %)", tag.id, 100.0 * share),
    });
    [
        pose.number.to_string(),
        match pose.set {
            SetName::Fit => "fit".to_owned(),
            SetName::HeldOut => "check".to_owned(),
        },
        degrees.join(" "),
        counts.join(" "),
        tags.collect::<Vec<_>>().join(" "),
        format!("{:.0} of {:.0}", 1e3 * pose.proven_clearance_m, 1e3 * pose.clearance_m),
        pose.predicted_tool_error_m.map_or_else(|| "-".to_owned(), |m| format!("{:.2}", 1e3 * m)),
        format!("{:.0}", pose.arm_time_s),
    ]
}

fn totals(file: &PlanFile) -> String {
    let totals = &file.totals;
    let error = totals.predicted_tool_error_m.map_or_else(|| "-".to_owned(), |m| format!("{:.2} mm", 1e3 * m));
    format!(
        "planned      {} poses ({}), {} infeasible, {:.0} s of arm time, {:.0} s of it moving\n\
         tool error   {error} predicted after the last pose\n\
         clearance    certified {:.0} mm or more for any joint error within {}\n\
         joints       {}",
        totals.poses,
        totals.stop_reason,
        totals.left_out,
        totals.arm_time_s,
        totals.motion_s,
        1e3 * totals.least_clearance_m,
        if file.prior == "datasheet" { "the datasheet's bounds" } else { "the prior's bounds" },
        file.joints.join(", ")
    )
}

fn markdown(file: &PlanFile, robot: &Robot) -> String {
    let warnings = file.warnings.iter().map(|warning| format!("- warning: {warning}"));
    let lines: Vec<String> = totals(file).lines().map(|line| format!("- {line}")).chain(warnings).collect();
    format!(
        "# Plan of `{}` for `{}`\n\n{}\n\n{}\n",
        file.routine,
        file.robot,
        table((file, robot), ASCII_MARKDOWN, None),
        lines.join("\n")
    )
}

//! `armcal calibrate`: the estimator on a recording.

use armcal_core::codes::Code;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;

use crate::cli::calibration_inputs::{Calibrated, CalibrationInputs, load_robot};
use crate::cli::closing::ClosingArgs;
use crate::cli::exit::{Exit, UsageError};
use crate::cli::named;
use crate::cli::own_inputs::spare_inputs;
use crate::cli::stdout::warn;
use crate::output::{self, accepted_kept};
#[cfg(feature = "viewer")]
use crate::report::markdown;
use crate::report::{About, Report, RunSummary, html};
use armcal_belief::calib::{Calibration, MapResult, Status, View, covariance_file};
use armcal_core::robot::Robot;
use armcal_core::routine::Method;

#[derive(Debug, Args)]
pub(super) struct CalibrateArgs {
    /// Recordings (.mcap); the views of several are pooled
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// Folder of the robot (robot.toml and its URDF), or the name of one that comes with armcal
    #[arg(long, value_name = "DIR", value_parser = named::robot())]
    robot: PathBuf,
    /// Input map (.toml) with topics and frames, for recordings that armcal did not make
    #[arg(long, value_name = "FILE")]
    input: Option<PathBuf>,
    /// Tag map (.toml) in the frame of the arm's base; default: the survey in the recording or robot folder
    #[arg(long, value_name = "FILE")]
    tag_map: Option<PathBuf>,
    /// Accepted calibration.toml of this arm as prior; default: the datasheet
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,
    /// Task (.toml): tolerance (m) and targets (m) or poses (rad) for the predicted tool error; default: the
    /// recording's task
    #[arg(long, value_name = "FILE")]
    task: Option<PathBuf>,
    /// Declare a failed joint: JOINT=locked, dead, stuck or jumps; repeatable (method bundle)
    #[arg(long, value_name = "JOINT=KIND")]
    failed: Vec<String>,
    /// Calibration method
    #[arg(long, value_name = "METHOD", default_value_t)]
    method: Method,
    /// Folder for calibration.toml, summary.json and report.html
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    #[command(flatten)]
    closing: ClosingArgs,
}

/// Files of a calibration, in the output folder.
const RESULTS: [&str; 6] =
    ["tagmap.toml", "calibration.covariance.toml", "calibration.toml", "report.html", "summary.json", "replay.rrd"];

impl CalibrateArgs {
    /// Refuses, before minutes of work, a folder in which a result overwrites an input. A prior may be replaced by a
    /// better result.
    fn check_outputs(&self) -> Result<(), UsageError> {
        let options = [self.input.as_ref(), self.tag_map.as_ref(), self.task.as_ref()];
        for name in RESULTS {
            let inputs = self.recordings.iter().chain(options.into_iter().flatten());
            spare_inputs(&self.out.join(name), inputs.map(PathBuf::as_path))?;
        }
        Ok(())
    }
}

pub(super) fn calibrate(args: &CalibrateArgs) -> Result<Exit> {
    let robot = load_robot(&args.robot, &args.failed)?;
    args.check_outputs()?;
    // The lock is taken before minutes of work, not after.
    let _lock = output::FolderLock::take(&args.out)?;
    let given = CalibrationInputs {
        recordings: &args.recordings,
        robot: &robot,
        method: args.method,
        input: args.input.as_deref(),
        tag_map: args.tag_map.as_deref(),
        prior: args.prior.as_deref(),
        task: args.task.as_deref(),
    };
    given.check_kinds()?;
    let started = Instant::now();
    let Calibrated { calibration, lost, external } = given.calibrate()?;
    let (views, tags, steps) = (calibration.fit.views, calibration.fit.tags_seen, calibration.fit.evaluations);
    tracing::info!("{views} views with {tags} tag observations fitted in {steps} steps, method {:?}", args.method);
    let summary = RunSummary::of_calibration(&calibration, started.elapsed().as_secs_f64()).judged();
    let kept = accepted_kept(&args.out, &calibration);
    let out = kept.as_ref().map_or_else(|| args.out.clone(), |kept| kept.folder.clone());
    output::make_folder(&out)?;
    write_results(&out, &args.recordings, &robot, (&calibration, &summary))?;
    if let Some((views, robot)) = &external {
        // The calibration is in place already, so a failed picture is only a warning.
        if let Err(error) = draw(&out, views, robot, (&calibration, &summary)) {
            warn(Code::ReplayMissing, format_args!("no replay: {error:#}"));
        }
    }
    let replay = external.map(|_| out.join("replay.rrd")).filter(|file| file.is_file());
    args.closing.say(&summary, &next_step(&out, replay.as_deref()))?;
    if let Some(kept) = kept {
        warn(Code::ResultKept, format_args!("{}: {kept}", args.out.display()));
    }
    Ok(match (calibration.status, lost) {
        (Status::Refused, _) => Exit::Refused,
        (Status::Accepted, true) => Exit::DataLost,
        (Status::Accepted, false) => Exit::Ok,
    })
}

/// Writes a calibration with its covariance, report and summary into `out`, or next to it where an accepted one stays
/// there; returns the folder.
///
/// # Errors
/// A folder that cannot be written to or that another program writes to.
pub fn save_results(out: &Path, robot: &Robot, of: (&Calibration, &RunSummary)) -> Result<PathBuf> {
    let _lock = output::FolderLock::take(out)?;
    let folder = accepted_kept(out, of.0).map_or_else(|| out.to_owned(), |kept| kept.folder);
    output::make_folder(&folder)?;
    write_results(&folder, &[], robot, of)?;
    Ok(folder)
}

/// Writes the calibration with its covariance, report and summary, and the map where tags were mapped.
fn write_results(
    out: &Path,
    recordings: &[PathBuf],
    robot: &Robot,
    (calibration, summary): (&Calibration, &RunSummary),
) -> Result<()> {
    let json = serde_json::to_string_pretty(summary).context("summary.json")?;
    let (map_file, calibration_file) = (out.join("tagmap.toml"), out.join("calibration.toml"));
    let covariance_file = covariance_file(&calibration_file);
    let (map, texts) = (calibration.map.as_ref().map(MapResult::to_toml), calibration.to_files());
    let (summary_file, json) = (out.join("summary.json"), format!("{json}\n"));
    let about = About { recordings: names(recordings), ..About::default() };
    let report = Report { summary, calibration, robot, online: None, about };
    let (report_file, report) = (out.join("report.html"), html(&report));
    let mut written: Vec<(&Path, &[u8])> = Vec::new();
    written.extend(map.iter().map(|map| (map_file.as_path(), map.as_bytes())));
    written.extend([
        (covariance_file.as_path(), texts.covariance.as_bytes()),
        (calibration_file.as_path(), texts.calibration.as_bytes()),
        (report_file.as_path(), report.as_bytes()),
        (summary_file.as_path(), json.as_bytes()),
    ]);
    output::write_together(&written)?;
    // A result that our own reader rejects is an error.
    Calibration::read(&calibration_file)?.sensors(robot)?;
    written.iter().for_each(|(path, bytes)| tracing::info!("{}: {} bytes written", path.display(), bytes.len()));
    Ok(())
}

/// Text with the folder of the results, and the file to open next.
fn next_step(out: &Path, replay: Option<&Path>) -> String {
    let replay = replay.map_or_else(String::new, |file| format!("; {} to look at", file.display()));
    let out = out.display();
    format!("written      {out}\nnext         {out}/report.html{replay}")
}

/// File names for a report, without their paths, which are valid only on this machine.
fn names(recordings: &[PathBuf]) -> Vec<String> {
    recordings.iter().filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned())).collect()
}

/// Writes the views as a file for the Rerun viewer, replay.rrd in `out`, and removes that of an earlier calibration.
#[cfg(feature = "viewer")]
fn draw(out: &Path, views: &[View], robot: &Robot, of: (&Calibration, &RunSummary)) -> Result<()> {
    let file = out.join("replay.rrd");
    output::remove(&file)?;
    let (calibration, summary) = of;
    let angles = calibration.view_angles(robot, views)?;
    let input = armcal_replay::ViewsInput {
        views,
        drawn: robot,
        calibrated: &calibration.applied_to(robot),
        angles: &angles,
        summary_markdown: &markdown(summary),
    };
    let growing = output::Beside::begin(&file)?;
    armcal_replay::write_views_rrd(&input, growing.grows_at())?;
    growing.put_in_place()?;
    Ok(())
}

#[cfg(not(feature = "viewer"))]
fn draw(_: &Path, _: &[View], _: &Robot, _: (&Calibration, &RunSummary)) -> Result<()> {
    Ok(())
}

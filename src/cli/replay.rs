//! `armcal replay`: a recording in the Rerun viewer.

use armcal_core::codes::Code;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;

use crate::cli::exit::{Exit, UsageError};
use crate::cli::file_kind::{FileKind, expect_kind, expect_no_truth};
use crate::cli::live_view::LiveViewArgs;
use crate::cli::losses::warn_of_losses;
use crate::cli::named;
use crate::cli::own_inputs::spare_inputs;
use crate::cli::stdout::{say, warn};
use crate::output;
use armcal_belief::calib::online::BeliefLog;
use armcal_belief::calib::{Calibration, Status, check_joints, surveyed};
use armcal_belief::session::ToolBelief;
use armcal_core::files::{self, FileKind as Size};
use armcal_core::log::{Recording, Stream, read_attachments};
use armcal_core::robot::{self, Robot, Vehicle};
use armcal_core::routine::{self, Scene};
use armcal_core::time::Stamp;
use armcal_replay::{ReplayInput, open_viewer, read_for_replay, show_recording, write_rrd};

#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    /// Recording (.mcap); truth.mcap, calibration.toml and belief.jsonl in the same folder are shown with it
    recording: PathBuf,
    /// Write this .rrd file instead of opening the viewer
    #[arg(long, visible_alias = "out", value_name = "FILE")]
    save: Option<PathBuf>,
    #[command(flatten)]
    view: LiveViewArgs,
    /// Robot folder, for recordings without attached robot files
    #[arg(long, value_name = "DIR", value_parser = named::robot())]
    robot: Option<PathBuf>,
}

pub(super) fn replay(args: &ReplayArgs) -> Result<Exit> {
    args.save.as_deref().map_or(Ok(()), |out| check_name(out, &args.recording))?;
    expect_kind(&args.recording, &[FileKind::Recording])?;
    let recording = read_for_replay(&args.recording)?;
    if recording.joint_names.is_empty() {
        expect_no_truth(&args.recording)?;
    }
    let lost = warn_of_losses(&recording);
    say_what_is_left_out(&recording);
    let drawings = Drawings::find(args, &recording)?;
    let truth = truth_beside(&args.recording);
    let calibration = calibration_beside(&args.recording, &drawings.robot);
    let since = |calibration: &Calibration| Stamp { nanos: calibration.valid.time_nanos };
    let believed_links: Vec<_> = calibration.iter().map(|found| (since(found), found.link_corrections())).collect();
    let believed = calibration.iter();
    let tool_beliefs: Vec<_> =
        believed.map(|found| (since(found), ToolBelief::by_calibration(&drawings.robot, found))).collect();
    let online = belief_beside(&args.recording, &drawings.robot);
    let truth = (truth != args.recording && truth.is_file()).then_some(truth);
    let input = ReplayInput {
        recording: &recording,
        truth: truth.as_deref(),
        robot: &drawings.robot,
        vehicle: drawings.vehicle.as_ref(),
        scene: drawings.scene.as_ref(),
        believed_links: &believed_links,
        tool_beliefs: &tool_beliefs,
        residuals: &[],
        clearance_m: None,
        online: online.as_ref(),
        summary_markdown: None,
    };
    match (&args.view.live, &args.save) {
        (Some(_), Some(_)) => {
            return Err(UsageError::new(Code::UsageInvalid, "--live and --save: only one of them".to_owned()).into());
        }
        (Some(address), None) => show_recording(&input, address)?,
        (None, Some(out)) => {
            let growing = output::Beside::begin(out)?;
            write_rrd(&input, growing.grows_at())?;
            growing.put_in_place()?;
            say(&format!("written      {}", out.display()))?;
        }
        (None, None) => {
            let folder = tempfile::tempdir().context("no temporary folder can be made")?.keep();
            let out = folder.join("replay.rrd");
            write_rrd(&input, &out)?;
            open_viewer(&out)?;
        }
    }
    Ok(if lost { Exit::DataLost } else { Exit::Ok })
}

/// Refuses a name without the ending .rrd, which no file next to the recording has, and the recording itself.
fn check_name(out: &Path, recording: &Path) -> Result<(), UsageError> {
    if out.extension().is_none_or(|extension| extension != "rrd") {
        let problem = format!("{}: the name of a file for the viewer must end in .rrd", out.display());
        return Err(UsageError::new(Code::FileFormat, problem));
    }
    spare_inputs(out, [recording])
}

/// Warns that a long recording is shown at a lower rate, with the omitted numbers by stream. Images are never among the
/// messages.
fn say_what_is_left_out(recording: &Recording) {
    let left_out = recording.left_in_file.iter().filter(|(stream, _)| **stream != Stream::Images);
    let left_out: Vec<String> = left_out.map(|(stream, n)| format!("{n} of {}", stream.topic())).collect();
    if !left_out.is_empty() {
        let file = recording.path.display();
        let left_out = left_out.join(", ");
        warn(Code::ReplayIncomplete, format_args!("{file}: long; shown at a lower rate, without {left_out}"));
    }
}

/// The truth of the same run: truth-cut-2.mcap next to run-cut-2.mcap, else truth.mcap.
fn truth_beside(recording: &Path) -> PathBuf {
    let unfinished = recording
        .file_name()
        .and_then(|name| name.to_str()?.strip_prefix("run"))
        .filter(|rest| rest.starts_with("-cut-") || *rest == ".mcap.partial");
    recording.with_file_name(format!("truth{}", unfinished.unwrap_or(".mcap")))
}

/// The accepted calibration next to a recording of the same arm; it applies from the recording's last view on.
fn calibration_beside(recording: &Path, robot: &Robot) -> Option<Calibration> {
    let file = recording.with_file_name("calibration.toml");
    if !file.is_file() {
        return None;
    }
    // A calibration without its covariance is sufficient: the link corrections are in the table.
    let without = || {
        let text = files::read_text(&file, Size::Text).map_err(|error| error.to_string())?;
        Calibration::parse(&file, &text).map_err(|error| error.to_string())
    };
    match Calibration::read(&file).or_else(|_| without()) {
        Ok(calibration)
            if calibration.robot == robot.name
                && calibration.joint.len() == robot.n_joints()
                && calibration.status == Status::Accepted =>
        {
            Some(calibration)
        }
        Ok(_) => None,
        Err(why) => {
            warn(Code::ReplayIncomplete, format_args!("the arm is shown as drawn: {}: {why}", file.display()));
            None
        }
    }
}

/// The online estimates in a belief.jsonl of the same arm next to the recording.
fn belief_beside(recording: &Path, robot: &Robot) -> Option<BeliefLog> {
    let file = recording.with_file_name("belief.jsonl");
    if !file.is_file() {
        return None;
    }
    let read = files::read_text(&file, Size::Text).map_err(|error| error.to_string());
    match read.and_then(|text| BeliefLog::from_jsonl(&text)) {
        Ok(log) if log.beliefs().all(|row| row.offset_rad.len() == robot.n_joints()) => Some(log),
        Ok(_) => None,
        Err(why) => {
            warn(Code::ReplayIncomplete, format_args!("shown without the online belief: {}: {why}", file.display()));
            None
        }
    }
}

/// The nominal arm and its surroundings, from the recording's own attachments or a robot folder.
struct Drawings {
    robot: Robot,
    vehicle: Option<Vehicle>,
    scene: Option<Scene>,
}

impl Drawings {
    fn find(args: &ReplayArgs, recording: &Recording) -> Result<Self> {
        let folder = tempfile::tempdir().context("no temporary folder can be made")?;
        let mut names = Vec::new();
        for (name, bytes) in read_attachments(&args.recording)? {
            // Only plain names: an attachment must not choose its path on disk.
            if Path::new(&name).file_name().is_some_and(|plain| plain.to_str() == Some(&name)) {
                std::fs::write(folder.path().join(&name), bytes).context("an attachment cannot be unpacked")?;
                names.push(name);
            }
        }
        let has = |name: &str| names.iter().any(|n| n == name);
        let file = args.recording.display();
        let attached = || format!("{file}: an attached file does not read; replay it with the armcal that recorded it");
        let robot = match &args.robot {
            Some(folder) => {
                let robot = robot::load(folder)?;
                if !recording.joint_names.is_empty() {
                    check_joints(recording, &robot)?;
                }
                robot
            }
            None if has("robot.toml") => robot::load_attached(folder.path()).with_context(attached)?,
            None => {
                let problem = "carries no drawings of its robot (attachment robot.toml); name its folder with --robot";
                return Err(UsageError::new(Code::UsageInvalid, format!("{file}: {problem}")).into());
            }
        };
        let vehicle = has("vehicle.toml").then(|| robot::load_vehicle(&folder.path().join("vehicle.toml")));
        let vehicle = vehicle.transpose().with_context(attached)?;
        let robot = match &vehicle {
            Some(vehicle) => robot.mounted_on(vehicle)?,
            None => surveyed(recording, &robot).into_owned(),
        };
        let scene = has("scene.toml").then(|| routine::load_scene(&folder.path().join("scene.toml")));
        let scene = scene.transpose().with_context(attached)?;
        Ok(Self { robot, vehicle, scene })
    }
}

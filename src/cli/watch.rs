//! `armcal watch`: recordings followed message by message, complete ones or one that another program is still writing.

mod growing;
mod stationary;
mod told;

use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Result;
use armcal_core::codes::Code;
use clap::Args;

use self::growing::{Patience, follow, opened};
use self::stationary::stationary;
use self::told::{Form, Told};
use crate::cli::belief_text::exit_of;
use crate::cli::calibration_inputs::{CalibrationInputs, load_robot};
use crate::cli::exit::{Exit, UsageError};
use crate::cli::interrupt::Interrupt;
use crate::cli::live_view::{LiveViewArgs, OpenView, ViewOf};
use crate::cli::losses::warn_of_losses;
use crate::cli::named;
use crate::output;
use armcal_belief::calib::check_joints;
use armcal_belief::calib::online::OnlineSettings;
use armcal_core::files;
use armcal_core::log::TopicMap;
use armcal_core::robot::Robot;
use armcal_core::routine::Method;

/// Total time to wait for the viewer, because an existing recording is read faster than a viewer takes it.
const VIEWER_PATIENCE: Duration = Duration::from_secs(20);
/// First and last bytes of a recording that was written to its end.
const MCAP_MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";

/// Follows a recording from its start and goes on as it grows: a line for each minute of the arm's time and each event.
/// Ends with the recording, when nothing new came for a while, or on Ctrl-C. Exits with 4 where the belief ends worse
/// than the task's tolerance, else with 3 where the recording ends cut or damaged.
#[derive(Debug, Args)]
pub(super) struct WatchArgs {
    /// Recordings, one after the other; a single .mcap may still be written by another program, and is waited for
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// Folder of the robot (robot.toml and its URDF), or the name of one that comes with armcal
    #[arg(long, value_name = "DIR", value_parser = named::robot())]
    robot: PathBuf,
    /// Input map (.toml) with topics and frames, for recordings that armcal did not make; they must be whole
    #[arg(long, value_name = "FILE")]
    input: Option<PathBuf>,
    /// Tag map (.toml) in the frame of the arm's base; default: the survey in the recording or robot folder
    #[arg(long, value_name = "FILE")]
    tag_map: Option<PathBuf>,
    /// Task (.toml): tolerance (m) and targets (m) or poses (rad) for the predicted tool error, until the recording
    /// names its own
    #[arg(long, value_name = "FILE")]
    task: Option<PathBuf>,
    /// Declare a failed joint: JOINT=locked, dead, stuck or jumps; repeatable
    #[arg(long, value_name = "JOINT=KIND")]
    failed: Vec<String>,
    /// Assume no drift, take model and scales from the batch of all views, and print the distance of the last estimate
    /// from that batch
    #[arg(long, conflicts_with = "live")]
    stationary: bool,
    /// Write belief.jsonl here at the end
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the lines of belief.jsonl instead of text
    #[arg(long)]
    json: bool,
    /// Seconds without new data after which the recording counts as ended; 0: never
    #[arg(long, default_value_t = 60, value_name = "SECONDS")]
    idle_s: u64,
    #[command(flatten)]
    view: LiveViewArgs,
}

pub(super) fn watch(args: &WatchArgs) -> Result<Exit> {
    let robot = load_robot(&args.robot, &args.failed)?;
    let _lock = args.out.as_deref().map(output::FolderLock::take).transpose()?;
    let given = CalibrationInputs {
        recordings: &args.recordings,
        robot: &robot,
        method: Method::Bundle,
        input: args.input.as_deref(),
        tag_map: args.tag_map.as_deref(),
        prior: None,
        task: args.task.as_deref(),
    };
    given.check_kinds()?;
    let form = if args.json { Form::Json } else { Form::Text };
    if args.stationary {
        return stationary(&given, args.out.as_deref(), form);
    }
    if args.view.live.is_some() && (args.recordings.len() > 1 || args.input.is_some()) {
        let problem = "--live shows one recording that armcal made; leave out --input and the others";
        return Err(UsageError::new(Code::UsageInvalid, problem).into());
    }
    match &args.recordings[..] {
        [one] if args.input.is_none() && (args.view.live.is_some() || !is_whole(one)) => {
            grow(args, &given, one, &robot, Told::new(form))
        }
        _ => {
            let mut told = Told::new(form);
            let settings = OnlineSettings::default();
            let (follower, lost) = given.follow(settings, &mut |follower, events| told.hear(follower, events))?;
            told.end(&follower, args.out.as_deref())?;
            Ok(exit_of(&follower, if lost { Exit::DataLost } else { Exit::Ok }))
        }
    }
}

/// True if its writer finished the recording.
fn is_whole(recording: &Path) -> bool {
    let last_bytes = || {
        let mut file = files::open(recording)?;
        file.seek(SeekFrom::End(-(MCAP_MAGIC.len() as i64)))?;
        let mut end = [0; MCAP_MAGIC.len()];
        file.read_exact(&mut end).map(|()| end)
    };
    last_bytes().is_ok_and(|end| end == *MCAP_MAGIC)
}

fn grow(args: &WatchArgs, given: &CalibrationInputs<'_>, path: &Path, robot: &Robot, mut told: Told) -> Result<Exit> {
    let mut listener = given.listener(OnlineSettings::default())?;
    let map = TopicMap::default();
    let mut patience = Patience::new(args.idle_s, Interrupt::install()?);
    let recording = opened(path, &map, &mut patience)?;
    let view = args.view.open(&ViewOf { robot, vehicle: None, scene: None })?;
    let mut show = view.as_ref().map(|view| view.listener(VIEWER_PATIENCE));
    let (rest, taken_away) = follow(recording, robot, &mut patience, &mut |log_time, message| {
        show.iter_mut().for_each(|show| show(log_time, message));
        listener.push(log_time, message, &mut |follower, events| told.hear(follower, events));
    })?;
    drop(show);
    view.into_iter().for_each(OpenView::end);
    let by_data = if warn_of_losses(&rest) { Exit::DataLost } else { Exit::Ok };
    if !rest.joint_names.is_empty() {
        check_joints(&rest, robot)?;
    }
    let follower = listener.finish(&mut |follower, events| told.hear(follower, events));
    let exit = told.end(&follower, args.out.as_deref()).map(|()| exit_of(&follower, by_data));
    taken_away.map_or(exit, |error| Err(error.into()))
}

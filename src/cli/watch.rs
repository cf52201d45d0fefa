//! `armcal watch`: a recording followed while another program writes it.

use armcal_core::codes::Code;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Result;
use clap::Args;

use crate::cli::belief_text::{belief, exit_of, line, summary};
use crate::cli::calibration_inputs::{CalibrationInputs, load_robot};
use crate::cli::closing::say_wrapped;
use crate::cli::exit::{Exit, UsageError};
use crate::cli::file_kind::expect_recording;
use crate::cli::interrupt::Interrupt;
use crate::cli::live_view::{LiveViewArgs, OpenView, ViewOf};
use crate::cli::losses::warn_of_losses;
use crate::cli::stdout::{note, say, warn};
use crate::output;
use armcal_belief::calib::check_joints;
use armcal_belief::calib::online::{BeliefLine, BeliefLog, Follower, OnlineEvent, OnlineSettings};
use armcal_core::log::{GrowingRecording, Growth, LogError, Recording, TopicMap};
use armcal_core::robot::Robot;
use armcal_core::routine::Method;
use armcal_core::streams::Message;
use armcal_core::time::Stamp;

/// A recording that was there before is read faster than a viewer takes it: it is waited for so long in all.
const VIEWER_PATIENCE: Duration = Duration::from_secs(20);
/// Between two looks at the file.
const POLL: Duration = Duration::from_millis(500);

/// Follows a recording from its start and goes on as it grows: a line for each minute of the arm's time and each event.
/// Ends with the recording, when nothing new came for a while, or on Ctrl-C. Exits with 4 where the belief ends worse
/// than the task's tolerance, else with 3 where the recording ends cut or damaged.
#[derive(Debug, Args)]
pub(super) struct WatchArgs {
    /// Recording (.mcap) that another program may still be writing; armcal waits until it exists
    recording: PathBuf,
    /// Folder of the robot (robot.toml and its URDF)
    #[arg(long, value_name = "DIR")]
    robot: PathBuf,
    /// Task (.toml): tolerance (m) and targets (m) or poses (rad) for the predicted tool error, until the recording
    /// names its own
    #[arg(long, value_name = "FILE")]
    task: Option<PathBuf>,
    /// Tag map (.toml) in the frame of the arm's base; default: the survey in the recording or robot folder
    #[arg(long, value_name = "FILE")]
    tag_map: Option<PathBuf>,
    /// Declare a failed joint: JOINT=locked, dead, stuck or jumps; repeatable
    #[arg(long, value_name = "JOINT=KIND")]
    failed: Vec<String>,
    /// Print the lines of belief.jsonl instead of text
    #[arg(long)]
    json: bool,
    /// Write belief.jsonl here at the end
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seconds without new data after which the recording counts as ended; 0: never
    #[arg(long, default_value_t = 60, value_name = "SECONDS")]
    idle_s: u64,
    #[command(flatten)]
    view: LiveViewArgs,
}

pub(super) fn watch(args: &WatchArgs) -> Result<Exit> {
    expect_recording(&args.recording)?;
    let robot = load_robot(&args.robot, &args.failed)?;
    let _lock = args.out.as_deref().map(output::FolderLock::take).transpose()?;
    let given = CalibrationInputs {
        recordings: &[],
        robot: &robot,
        method: Method::Bundle,
        input: None,
        tag_map: args.tag_map.as_deref(),
        prior: None,
        task: args.task.as_deref(),
    };
    given.check_kinds()?;
    let mut listener = given.listener(OnlineSettings::default())?;
    let form = if args.json { Form::Json } else { Form::Text };
    let mut told = Told { log: BeliefLog::default(), n_told: 0, form, printed: Ok(()) };
    let map = TopicMap::default();
    let mut patience = Patience::new(args.idle_s, Interrupt::install()?);
    let recording = opened(&args.recording, &map, &mut patience)?;
    let view = args.view.open(&ViewOf { robot: &robot, vehicle: None, scene: None })?;
    let mut show = view.as_ref().map(|view| view.listener(VIEWER_PATIENCE));
    let (rest, taken_away) = follow(recording, &robot, &mut patience, &mut |log_time, message| {
        show.iter_mut().for_each(|show| show(log_time, message));
        listener.push(log_time, message, &mut |follower, events| told.hear(follower, events));
    })?;
    drop(show);
    view.into_iter().for_each(OpenView::end);
    let by_data = if warn_of_losses(&rest) { Exit::DataLost } else { Exit::Ok };
    if !rest.joint_names.is_empty() {
        check_joints(&rest, &robot)?;
    }
    let follower = listener.finish(&mut |follower, events| told.hear(follower, events));
    let exit = told.end(&follower, args.out.as_deref()).map(|()| exit_of(&follower, by_data));
    taken_away.map_or(exit, |error| Err(error.into()))
}

/// When to stop waiting.
struct Patience {
    idle: Option<Duration>,
    interrupt: Interrupt,
    last_news: Instant,
    seen: (u64, u64),
}

impl Patience {
    fn new(idle_s: u64, interrupt: Interrupt) -> Self {
        let idle = (idle_s > 0).then_some(Duration::from_secs(idle_s));
        Self { idle, interrupt, last_news: Instant::now(), seen: (0, 0) }
    }

    /// Waits for the next look; `false` where nothing came for too long.
    fn waits(&mut self, seen: (u64, u64)) -> bool {
        if seen != self.seen {
            (self.seen, self.last_news) = (seen, Instant::now());
        }
        if self.idle.is_some_and(|idle| self.last_news.elapsed() >= idle) {
            return false;
        }
        std::thread::sleep(POLL);
        true
    }
}

/// Opens the recording, and waits for it where it does not exist yet.
fn opened<'a>(path: &Path, map: &'a TopicMap, patience: &mut Patience) -> Result<GrowingRecording<'a>> {
    let mut is_said = false;
    loop {
        let error = match GrowingRecording::open(path, map) {
            Err(LogError::Read { path, source }) if source.kind() == std::io::ErrorKind::NotFound => {
                LogError::Read { path, source }
            }
            opened => return Ok(opened?),
        };
        if !std::mem::replace(&mut is_said, true) {
            note(format_args!("note: {} does not exist yet: waiting for it", path.display()));
            let partial = PathBuf::from(format!("{}.partial", path.display()));
            if partial.is_file() {
                note(format_args!("note: a run that is under way writes {}", partial.display()));
            }
        }
        if patience.interrupt.is_requested() {
            return Err(
                UsageError::new(Code::Interrupted, format!("{}: stopped before it began", path.display())).into()
            );
        }
        if !patience.waits((0, 0)) {
            return Err(error.into());
        }
    }
}

/// Hears a recording until it ends, nothing comes any more, or somebody asks to stop. What was heard of one that was
/// taken away meanwhile counts, with the reason.
fn follow(
    mut recording: GrowingRecording<'_>,
    robot: &Robot,
    patience: &mut Patience,
    hear: &mut dyn FnMut(Stamp, &Message),
) -> Result<(Recording, Option<LogError>)> {
    let mut is_checked = false;
    loop {
        let growth = match recording.poll(&mut *hear) {
            Err(error @ (LogError::Truncated { .. } | LogError::Replaced { .. })) => {
                return Ok((recording.stop(), Some(error)));
            }
            growth => growth?,
        };
        if let Some(names) = recording.joint_names().filter(|_| !is_checked) {
            let named =
                Recording { path: recording.path().to_owned(), joint_names: names.to_vec(), ..Recording::default() };
            check_joints(&named, robot)?;
            is_checked = true;
        }
        if growth == Growth::Finished {
            break;
        }
        if patience.interrupt.is_requested() {
            return Ok((recording.stop(), None));
        }
        if growth == Growth::Waiting && !patience.waits(recording.seen()) {
            break;
        }
    }
    if recording.is_out_of_order() {
        let text = "chunks are not in the order of time, or doubled; they were heard as they came";
        warn(Code::ChunksDisordered, format_args!("{}: {text}", recording.path().display()));
    }
    Ok((recording.finish(hear)?, None))
}

/// In which form lines are printed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    Text,
    Json,
}

/// What was believed, and what of it was printed.
struct Told {
    log: BeliefLog,
    n_told: usize,
    form: Form,
    /// That stdout takes it: one that cannot be written is an error at the end.
    printed: Result<()>,
}

impl Told {
    fn hear(&mut self, follower: &Follower, events: Vec<OnlineEvent>) {
        if self.log.hear(follower, events) {
            self.print_new(follower);
        }
    }

    fn print_new(&mut self, follower: &Follower) {
        let new = &self.log.lines[self.n_told..];
        let clock = |nanos| self.log.clock(nanos);
        let mut lines: Vec<String> = match self.form {
            Form::Json => new.iter().map(BeliefLine::to_json).collect(),
            Form::Text => {
                let in_words = |new: &BeliefLine| match new {
                    BeliefLine::Event(event) => format!("{}  {}", clock(event.since_nanos), event.to_line()),
                    BeliefLine::Belief(row) => format!("{}  {}", clock(row.stamp_nanos), line(follower, row)),
                };
                new.iter().map(in_words).collect()
            }
        };
        if let (Form::Text, [], Some(now)) = (self.form, new, follower.conditions().stamp) {
            lines.push(format!("{}  no view yet of a tag whose place is known", clock(now.nanos)));
        }
        self.n_told = self.log.lines.len();
        if self.printed.is_ok() {
            self.printed = lines.iter().try_for_each(|line| say(line));
        }
    }

    /// The last line, the file, and in words how it ended.
    fn end(mut self, follower: &Follower, out: Option<&Path>) -> Result<()> {
        let row = belief(follower)?;
        self.log.end(follower);
        self.print_new(follower);
        let mut ending = summary(follower, &row);
        if let Some(file) = out.map(|out| out.join("belief.jsonl")) {
            output::write_together(&[(&file, self.log.to_jsonl().as_bytes())])?;
            ending += &format!("\nwritten      {}", file.display());
        }
        self.printed?;
        if self.form == Form::Text { say_wrapped(&ending) } else { Ok(()) }
    }
}

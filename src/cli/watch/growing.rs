//! A recording that another program may still be writing: waited for, and read as it grows.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Result;
use armcal_core::codes::Code;

use crate::cli::exit::UsageError;
use crate::cli::interrupt::Interrupt;
use crate::cli::stdout::{note, warn};
use armcal_belief::calib::check_joints;
use armcal_core::log::{GrowingRecording, Growth, LogError, Recording, TopicMap};
use armcal_core::robot::Robot;
use armcal_core::streams::Message;
use armcal_core::time::Stamp;

/// Time between two checks of the file.
const POLL: Duration = Duration::from_millis(500);

/// Conditions for the end of the wait.
pub(super) struct Patience {
    idle: Option<Duration>,
    interrupt: Interrupt,
    last_news: Instant,
    seen: (u64, u64),
}

impl Patience {
    pub fn new(idle_s: u64, interrupt: Interrupt) -> Self {
        let idle = (idle_s > 0).then_some(Duration::from_secs(idle_s));
        Self { idle, interrupt, last_news: Instant::now(), seen: (0, 0) }
    }

    /// Waits for the next check; returns false if nothing came for too long.
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
pub(super) fn opened<'a>(path: &Path, map: &'a TopicMap, patience: &mut Patience) -> Result<GrowingRecording<'a>> {
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

/// Reads a recording until it ends, nothing comes any more, or the user asks to stop. If the file is removed meanwhile,
/// the messages until then count, with the reason.
pub(super) fn follow(
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

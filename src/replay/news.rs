//! New data of a run in progress: the messages so far that drawing needs, and the rows that were not shown yet.

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::rerun::log::{Chunk, ChunkId, RowId};

use crate::ReplayError;
use crate::blueprint::{self, Entry};
use crate::recording::draw_news;
use crate::scene::{ReplayInput, ReplayScene, RunState};
use crate::shown::Shown;
use crate::tracks::{Tracks, Window};
use armcal_belief::calib::surveyed;
use armcal_core::log::{Recording, Stream};
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Scene;
use armcal_core::streams::Message;
use armcal_core::time::Stamp;

/// Time for which all messages are kept, s: the length of the tool's path.
const RECENT_S: f64 = 15.0;
/// Time for which images are kept, s: longer than one is shown.
const IMAGES_S: f64 = 3.0;
/// Spacing of older readings, estimates and temperatures, s; they are kept for viewers that connect late.
const KEPT_S: f64 = 0.25;
/// Delay of moving entities, s: messages of one time arrive one after the other.
const LAG_S: f64 = 0.1;
/// Largest number of drawn times before a viewer connected.
const MAX_TICKS_BEFORE: f64 = 6000.0;
const SUMMARY: &str = "# Live\n\nAs it happens, by the arm's own belief: nothing here knows the truth.\n";

/// Robot, vehicle and scene with which a run is shown.
#[derive(Clone, Debug)]
pub struct LiveDrawings {
    /// Robot with the tags of its vehicle.
    pub robot: Robot,
    /// Vehicle that carries the arm.
    pub vehicle: Option<Vehicle>,
    /// Site of the run.
    pub scene: Option<Scene>,
}

/// Run in progress.
pub(super) struct News {
    drawings: LiveDrawings,
    recording: Recording,
    /// Time up to which all moving entities were shown, s since the first message.
    until_s: Option<f64>,
    shown: Shown,
    /// Paths of the layout's parts.
    layout: Vec<String>,
}

/// Update for a viewer.
pub(super) struct Update {
    /// New layout; `None` if it is unchanged.
    pub layout: Option<Vec<Entry>>,
    pub chunks: Vec<Chunk>,
}

impl News {
    pub fn new(drawings: LiveDrawings) -> Self {
        let (recording, shown, layout) = Default::default();
        Self { drawings, recording, until_s: None, shown, layout }
    }

    pub fn hear(&mut self, log_time: Stamp, message: Message) {
        let messages = &mut self.recording.messages;
        let log_time = messages.last().map_or(log_time, |(last, _)| log_time.max(*last));
        messages.push((log_time, message));
    }

    /// Forgets the shown data, because the next viewer has none.
    pub fn forget_shown(&mut self) {
        self.until_s = None;
        self.shown = Shown::default();
        self.layout.clear();
    }

    /// Returns data that were not shown yet, and marks them as shown; `None` before the first message.
    pub fn take(&mut self) -> Result<Option<Update>, ReplayError> {
        let Some(duration_s) = self.duration_s() else { return Ok(None) };
        self.take_until(duration_s - LAG_S).map(Some)
    }

    /// Returns all remaining data, at the end of the run.
    pub fn take_rest(&mut self) -> Result<Option<Update>, ReplayError> {
        let Some(duration_s) = self.duration_s() else { return Ok(None) };
        self.take_until(duration_s).map(Some)
    }

    fn duration_s(&self) -> Option<f64> {
        let messages = &self.recording.messages;
        let ((first, _), (last, _)) = (messages.first()?, messages.last()?);
        Some(last.since_s(*first))
    }

    fn take_until(&mut self, until_s: f64) -> Result<Update, ReplayError> {
        let LiveDrawings { robot, vehicle, scene } = &self.drawings;
        // A recording says where its tags are, unless the vehicle does.
        let robot = if vehicle.is_some() { Cow::Borrowed(robot) } else { surveyed(&self.recording, robot) };
        let input = ReplayInput {
            recording: &self.recording,
            truth: None,
            robot: &robot,
            vehicle: vehicle.as_ref(),
            scene: scene.as_ref(),
            believed_links: &[],
            tool_beliefs: &[],
            residuals: &[],
            clearance_m: None,
            online: None,
            summary_markdown: Some(SUMMARY),
        };
        let mut tracks = Tracks::new(&self.recording, &robot)?;
        tracks.take_images_in_memory(input.recording);
        tracks.window = match self.until_s {
            Some(after_s) => Window { after_s, until_s: until_s.max(after_s), ..Window::default() },
            None => Window { until_s, max_ticks: MAX_TICKS_BEFORE, ..Window::default() },
        };
        // A window that ends before the first tick has shown nothing.
        self.until_s = (tracks.window.until_s >= 0.0).then_some(tracks.window.until_s);
        let run = ReplayScene {
            tracks,
            truth: None,
            robot: &robot,
            vehicle: input.vehicle,
            scene: input.scene,
            believed_chains: Vec::new(),
            online: None,
            state: RunState::GoesOn,
        };
        let (shown, chunks) =
            draw_news(&run, &input, std::mem::take(&mut self.shown)).into_news().map_err(ReplayError::Live)?;
        self.shown = shown;
        let layout = blueprint::build(&run);
        let paths: Vec<String> = layout.iter().map(|entry| entry.path.clone()).collect();
        let layout = (paths != self.layout).then_some(layout);
        self.layout = paths;
        // Identities follow the clock, so that later chunks are newer to the viewer.
        let chunks = chunks.into_iter().map(|chunk| chunk.clone_as(ChunkId::new(), RowId::new())).collect();
        Ok(Update { layout, chunks })
    }

    /// Drops messages that no later drawing needs.
    pub fn trim(&mut self) {
        let messages = &mut self.recording.messages;
        let (Some((first, _)), Some((last, _))) = (messages.first(), messages.last()) else { return };
        let first = *first;
        let shown = self.until_s.map_or(*last, |until_s| first.plus_s(until_s));
        let (recent, images) = (shown.plus_s(-RECENT_S), shown.plus_s(-IMAGES_S));
        let mut latest = BTreeMap::<Stream, Stamp>::new();
        let mut is_first = true;
        messages.retain(|(at, message)| {
            // The first message defines the start of time.
            if std::mem::take(&mut is_first) {
                return true;
            }
            match message {
                Message::Image(_) => *at >= images,
                Message::JointSensors(_) | Message::JointStates(_) | Message::Temperature(_) => {
                    let last = latest.entry(Stream::of(message)).or_insert(first);
                    let is_kept = *at >= recent || at.since_s(*last) >= KEPT_S;
                    *last = if is_kept { *at } else { *last };
                    is_kept
                }
                Message::Mark(_) | Message::Log(_) | Message::Task(_) | Message::Touch(_) | Message::Survey(_) => true,
                _ => *at >= recent,
            }
        });
    }
}

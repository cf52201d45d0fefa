//! The recording's messages sorted by kind, on the viewer's timeline.

use std::path::Path;

use nalgebra::{Isometry3, UnitQuaternion};

use crate::error::ReplayError;
use armcal_core::log::{LogError, Recording, for_each_image};
use armcal_core::robot::Robot;
use armcal_core::spatial::{Pose, Vehicle, World};
use armcal_core::streams::{
    CameraImage, DetectionRejects, JointAngles, JointCounts, LogLine, Mark, MarkKind, Message, ReachTask,
    TagDetections, Thermometer, ToolTouch,
};
use armcal_core::time::Stamp;

/// Largest difference of a message's own stamp and its log time. With a larger one, its clock is not the recorder's.
const CLOCKS_AGREE_S: f64 = 1.0;
/// Smallest spacing of samples; nearer ones are dropped, because nothing is drawn that fast.
const MIN_SPACING_S: f64 = 0.0095;
/// Smallest spacing of images, which take most of the file.
const MIN_IMAGE_SPACING_S: f64 = 0.095;
/// Largest memory of kept images, bytes; their rate halves at each quarter.
const MAX_IMAGE_BYTES: usize = 96 << 20;
/// Largest number of drawn marks, and of lines of the log.
const MAX_MARKS: usize = 20_000;
/// Largest number of drawn touches, each of which draws the earlier ones again.
const MAX_TOUCHES: usize = 200;
/// Longest recording. Beyond it a wrong log time is likely.
const LONGEST_S: f64 = 7.0 * 24.0 * 3600.0;
/// Rate of moving entities, Hz.
const FRAME_HZ: f64 = 25.0;
/// Time without any message beyond which nothing is drawn, s: a clock was set, or the recorder was off.
pub(super) const GAP_S: f64 = 30.0;
/// Time for which the last data are drawn into a gap, s.
pub(super) const HOLD_S: f64 = 2.0;
/// Largest number of times at which one entity is drawn: one hour of frames. Longer recordings are drawn at lower
/// rates.
const MAX_TICKS: f64 = 90_000.0;

/// Values over time, s, ascending.
#[derive(Clone, Debug)]
pub(super) struct TimeSeries<T> {
    samples: Vec<(f64, T)>,
}

impl<T> Default for TimeSeries<T> {
    fn default() -> Self {
        Self { samples: Vec::new() }
    }
}

impl<T> TimeSeries<T> {
    /// Keeps a sample unless it follows the last one too closely or comes before it.
    pub fn push(&mut self, time_s: f64, value: T) {
        if self.samples.last().is_none_or(|(last_s, _)| time_s - last_s >= MIN_SPACING_S) {
            self.samples.push((time_s, value));
        }
    }

    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    pub fn iter(&self) -> impl Iterator<Item = &(f64, T)> {
        self.samples.iter()
    }

    /// Returns the latest value at `time_s`; the first one before it.
    pub fn at(&self, time_s: f64) -> Option<&T> {
        let after = self.samples.partition_point(|(t, _)| *t <= time_s);
        self.samples.get(after.saturating_sub(1)).map(|(_, value)| value)
    }

    /// Returns the value at `time_s` between its two neighbours, by `blend(before, after, share)`.
    pub fn between(&self, time_s: f64, blend: impl Fn(&T, &T, f64) -> T) -> Option<T> {
        let after = self.samples.partition_point(|(t, _)| *t <= time_s);
        let (t0, before) = self.samples.get(after.saturating_sub(1))?;
        let (t1, next) = self.samples.get(after).unwrap_or_else(|| &self.samples[self.samples.len() - 1]);
        let share = if t1 > t0 { ((time_s - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { 0.0 };
        Some(blend(before, next, share))
    }
}

/// Returns the linear interpolation between two sets of joint angles.
pub(super) fn blend_angles(a: &JointAngles, b: &JointAngles, share: f64) -> JointAngles {
    JointAngles::from_fn(a.len(), |j| a[j] + share * (b[j] - a[j]))
}

/// Returns the interpolation between two poses: a straight line and the shorter turn.
pub(super) fn blend_poses(a: &Isometry3<f64>, b: &Isometry3<f64>, share: f64) -> Isometry3<f64> {
    a.try_lerp_slerp(b, share, 1e-9).unwrap_or(*a)
}

/// A mark on the timeline.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub start_s: f64,
    pub end_s: f64,
    pub kind: MarkKind,
}

/// Interval of times at which moving entities are drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub after_s: f64,
    pub until_s: f64,
    /// Largest number of times at which one entity is drawn.
    pub max_ticks: f64,
}

impl Default for Window {
    fn default() -> Self {
        Self { after_s: f64::NEG_INFINITY, until_s: f64::INFINITY, max_ticks: MAX_TICKS }
    }
}

/// Time at which a moving entity is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tick {
    pub time_s: f64,
    /// False before the window.
    pub is_drawn: bool,
}

/// The recording, sorted by kind.
pub(super) struct Tracks<'a> {
    start: Stamp,
    pub duration_s: f64,
    /// Drawn part: the whole recording, or part of a run in progress.
    pub window: Window,
    /// Spans with messages, s, ascending, with gaps between them.
    covered: Vec<(f64, f64)>,
    pub believed: TimeSeries<JointAngles>,
    pub counts: TimeSeries<JointCounts>,
    pub attitude: TimeSeries<UnitQuaternion<f64>>,
    pub oil_c: TimeSeries<f64>,
    pub water_c: TimeSeries<f64>,
    /// Gap between the jaws, m.
    pub gripper: TimeSeries<f64>,
    pub views: Vec<(f64, &'a TagDetections)>,
    /// Rejected detections.
    pub rejects: Vec<(f64, &'a DetectionRejects)>,
    /// Camera images, ascending.
    pub images: Vec<(f64, CameraImage)>,
    pub task: Option<(f64, &'a ReachTask)>,
    pub marks: Vec<Span>,
    pub touches: Vec<(f64, &'a ToolTouch)>,
    pub log: Vec<(f64, &'a LogLine)>,
}

impl<'a> Tracks<'a> {
    /// Sorts the messages and checks that the joints are those of `robot`.
    pub fn new(recording: &'a Recording, robot: &Robot) -> Result<Self, ReplayError> {
        let path = || recording.path.clone();
        let (Some((start, _)), Some((end, _))) = (recording.messages.first(), recording.messages.last()) else {
            return Err(ReplayError::Empty { path: path() });
        };
        let duration_s = end.since_s(*start);
        if duration_s > LONGEST_S {
            return Err(ReplayError::TooLong { path: path(), got_s: duration_s, limit_s: LONGEST_S });
        }
        let mut tracks = Self {
            start: *start,
            duration_s,
            window: Window::default(),
            covered: covered(recording, *start, duration_s),
            believed: TimeSeries::default(),
            counts: TimeSeries::default(),
            attitude: TimeSeries::default(),
            oil_c: TimeSeries::default(),
            water_c: TimeSeries::default(),
            gripper: TimeSeries::default(),
            views: Vec::new(),
            rejects: Vec::new(),
            images: Vec::new(),
            task: None,
            marks: Vec::new(),
            touches: Vec::new(),
            log: Vec::new(),
        };
        for (log_time, message) in &recording.messages {
            if let Some(got) = joint_count(message).filter(|&n| n != robot.n_joints()) {
                let (robot, expected) = (robot.name.clone(), robot.n_joints());
                return Err(ReplayError::JointCount { path: path(), robot, got, expected });
            }
            tracks.take(*log_time, message);
        }
        tracks.marks.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        Ok(tracks)
    }

    fn take(&mut self, log_time: Stamp, message: &'a Message) {
        let at = |stamp| self.place_s(log_time, stamp);
        match message {
            Message::JointStates(m) => self.believed.push(at(m.stamp), m.angles),
            Message::JointSensors(m) => self.counts.push(at(m.stamp), m.counts),
            Message::Attitude(m) => {
                let turn = Pose::<World, Vehicle>::from_position_quaternion_wxyz([0.0; 3], m.quaternion_wxyz);
                if let Some(turn) = turn {
                    self.attitude.push(at(m.stamp), turn.rotation());
                }
            }
            Message::Temperature(m) => match m.thermometer {
                Thermometer::Oil => self.oil_c.push(at(m.stamp), m.temperature_c),
                Thermometer::Water => self.water_c.push(at(m.stamp), m.temperature_c),
            },
            Message::Gripper(m) => self.gripper.push(at(m.stamp), m.opening_m),
            Message::Detections(m) => self.views.push((at(m.stamp), m)),
            Message::Rejects(m) => self.rejects.push((at(m.stamp), m)),
            Message::Task(m) => self.task = Some((at(m.stamp), m)),
            Message::Mark(m) if self.marks.len() < MAX_MARKS => self.marks.push(self.span(log_time, m)),
            Message::Log(m) if self.log.len() < MAX_MARKS => self.log.push((at(m.stamp), m)),
            Message::Touch(m) if self.touches.len() < MAX_TOUCHES => self.touches.push((at(m.stamp), m)),
            Message::Mark(_)
            | Message::Log(_)
            | Message::JointCommand(_)
            | Message::GripperCommand(_)
            | Message::Pressure(_)
            | Message::Survey(_)
            | Message::Touch(_)
            | Message::Image(_) => {}
        }
    }

    /// Takes the images from the file, where a recording in memory leaves them, unless they follow each other too
    /// closely.
    pub fn take_images(&mut self, file: &Path) -> Result<(), LogError> {
        let (mut images, mut bytes, mut latest_s) = (Vec::<(f64, CameraImage)>::new(), 0, f64::NEG_INFINITY);
        for_each_image(file, |log_time, image| {
            let time_s = self.place_s(log_time, image.stamp);
            let halvings = 4 * bytes / MAX_IMAGE_BYTES;
            let spacing_s = MIN_IMAGE_SPACING_S * (1_u32 << halvings) as f64;
            let is_too_close = halvings > 0 && (time_s - latest_s).abs() < spacing_s;
            if !is_too_close && bytes + image.jpeg.len() <= MAX_IMAGE_BYTES {
                (bytes, latest_s) = (bytes + image.jpeg.len(), time_s);
                images.push((time_s, image));
            }
        })?;
        images.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (time_s, image) in images {
            if self.images.last().is_none_or(|(last_s, _)| time_s - last_s >= MIN_IMAGE_SPACING_S) {
                self.images.push((time_s, image));
            }
        }
        Ok(())
    }

    /// Takes images that are among the messages.
    pub fn take_images_in_memory(&mut self, recording: &Recording) {
        for (log_time, message) in &recording.messages {
            let Message::Image(image) = message else { continue };
            let time_s = self.place_s(*log_time, image.stamp);
            if self.images.last().is_none_or(|(last_s, _)| time_s - last_s >= MIN_IMAGE_SPACING_S) {
                self.images.push((time_s, image.clone()));
            }
        }
    }

    /// Returns the span of a mark, which is logged at the end of its span.
    fn span(&self, log_time: Stamp, mark: &Mark) -> Span {
        let end_s = self.place_s(log_time, mark.end);
        let start_s = (end_s - mark.end.since_s(mark.start)).max(0.0);
        Span { start_s, end_s, kind: mark.kind }
    }

    /// Returns the time of a message: its own stamp if that clock agrees with the recorder's, else its log time.
    pub fn place_s(&self, log_time: Stamp, stamp: Stamp) -> f64 {
        let (logged_s, stamped_s) = (log_time.since_s(self.start), stamp.since_s(self.start));
        let placed_s = if (stamped_s - logged_s).abs() <= CLOCKS_AGREE_S { stamped_s } else { logged_s };
        placed_s.clamp(0.0, self.duration_s)
    }

    /// Returns the log time at a time of the timeline.
    pub fn stamp_at(&self, time_s: f64) -> Stamp {
        self.start.plus_s(time_s)
    }

    /// Returns the times at which moving entities are drawn, s.
    pub fn frames(&self) -> impl Iterator<Item = f64> {
        self.ticks(FRAME_HZ)
    }

    /// Returns times at `rate_hz` from the start to the end, s, without those in gaps.
    pub fn ticks(&self, rate_hz: f64) -> impl Iterator<Item = f64> {
        self.ticks_with_lead(rate_hz, 0).map(|tick| tick.time_s)
    }

    /// Returns the ticks at `rate_hz`, preceded by up to `lead` ticks that were already drawn: some drawings depend on
    /// earlier times.
    pub fn ticks_with_lead(&self, rate_hz: f64, lead: u64) -> impl Iterator<Item = Tick> {
        let rate_hz = self.affordable_hz(rate_hz);
        let Window { after_s, until_s, .. } = self.window;
        let first_drawn = if after_s.is_finite() { (after_s * rate_hz).floor() as u64 + 1 } else { 0 };
        self.covered.iter().flat_map(move |(from_s, to_s)| {
            let first = ((from_s * rate_hz).ceil() as u64).max(first_drawn.saturating_sub(lead));
            let last = (to_s.min(until_s) * rate_hz).floor() as u64;
            // A window may end before the first tick.
            let end = if until_s < 0.0 { first } else { last + 1 };
            (first..end).map(move |i| Tick { time_s: i as f64 / rate_hz, is_drawn: i >= first_drawn })
        })
    }

    /// Returns `rate_hz`, or the largest share of it at which a long recording can be drawn.
    pub fn affordable_hz(&self, rate_hz: f64) -> f64 {
        let Window { after_s, until_s, max_ticks } = self.window;
        let in_window = |(from_s, to_s): &(f64, f64)| (to_s.min(until_s) - from_s.max(after_s)).max(0.0);
        let covered_s: f64 = self.covered.iter().map(in_window).sum();
        rate_hz / (covered_s * rate_hz / max_ticks).ceil().max(1.0)
    }

    /// Returns the starts of the gaps without messages, s.
    pub fn gaps(&self) -> impl Iterator<Item = f64> {
        self.covered.iter().rev().skip(1).rev().map(|(_, to_s)| *to_s)
    }
}

/// Returns the spans with messages at most [`GAP_S`] apart, s since `start`.
fn covered(recording: &Recording, start: Stamp, duration_s: f64) -> Vec<(f64, f64)> {
    let mut spans = vec![(0.0, 0.0)];
    for (log_time, _) in &recording.messages {
        let time_s = log_time.since_s(start);
        match spans.last_mut() {
            Some((_, last_s)) if time_s - *last_s <= GAP_S => *last_s = last_s.max(time_s),
            _ => spans.push((time_s, time_s)),
        }
    }
    spans.iter_mut().for_each(|(_, last_s)| *last_s = (*last_s + HOLD_S).min(duration_s));
    spans
}

fn joint_count(message: &Message) -> Option<usize> {
    match message {
        Message::JointStates(m) => Some(m.angles.len()),
        Message::JointSensors(m) => Some(m.counts.len()),
        _ => None,
    }
}

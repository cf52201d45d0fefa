//! Converts messages, one at a time, to views: spans that a capture marks, unmarked rests, and images of a moving arm.
//!
//! An arm that stays within a few thousandths of a radian rests, and each rest gives one view. During motion, an image
//! gives a view with the readings about its stamp and their rate, if the arm has moved since the last one. A sensor's
//! residual error repeats at the same configuration and must not count twice. Memory is bounded: a window of messages,
//! regardless of the length of the stream.

use crate::follow::constants::view_stream::{
    ABOUT_IMAGE_S, APART_RAD, LONGEST_REST_S, MARK_DELAY_S, MOVES_RAD, REST_RAD, SETTLE_S, SHORTEST_REST_S,
    SLOWEST_RAD_S, WAITING_IMAGES, WINDOW_MESSAGES, WINDOW_S,
};
use std::collections::{BTreeMap, VecDeque};

use crate::views::association::view_of_span;
use crate::views::conditions::apart_rad;
use crate::views::constants::conditions::{CLEAR_SIGMAS, MIN_READINGS_OF_RATE};
use crate::views::view::{FASTEST_RAD_S, View};
use armcal_core::joints::{JointAngles, JointCounts, MAX_JOINTS};
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointSensorSample, Mark, MarkKind, Message, TagDetections};
use armcal_core::time::Stamp;

/// Converts the messages of an arm to views as they come.
#[derive(Clone)]
pub struct ViewStream {
    robot: Robot,
    sensors: ArmSensors,
    window: VecDeque<(Stamp, Message)>,
    last: Option<Stamp>,
    rest: Option<Rest>,
    /// Span of a rest that ended and waits for a mark.
    ended: Option<(Stamp, Stamp)>,
    /// Stamps of images of a moving arm that wait for readings.
    images: VecDeque<Stamp>,
    /// Travel at the last view of a moving arm.
    moved_at: Option<JointAngles>,
    /// End of the processed spans.
    used_until: Stamp,
    n_views: u32,
}

/// A rest: an arm within [`REST_RAD`] of its initial configuration.
#[derive(Clone, Copy)]
struct Rest {
    since: Stamp,
    anchor: JointAngles,
    /// True if a view was made of it.
    is_used: bool,
}

impl ViewStream {
    /// Returns a stream for `robot`, with the tags around it.
    #[must_use]
    pub fn new(robot: Robot) -> Self {
        Self {
            sensors: ArmSensors::nominal(&robot),
            robot,
            window: VecDeque::new(),
            last: None,
            rest: None,
            ended: None,
            images: VecDeque::new(),
            moved_at: None,
            used_until: Stamp { nanos: i64::MIN },
            n_views: 0,
        }
    }

    /// Takes in a message. Returns the views that are complete with it.
    pub fn push(&mut self, log_time: Stamp, message: &Message) -> Vec<View> {
        let mut views = Vec::new();
        match message {
            Message::JointSensors(sample) if is_usable(sample, &self.robot) => {
                self.keep(log_time, message);
                self.read(sample, &mut views);
            }
            Message::Detections(detections) => {
                self.keep(log_time, message);
                let is_resting = self.rest.is_some_and(|rest| detections.stamp.since_s(rest.since) > SETTLE_S);
                if !is_resting && !detections.tags.is_empty() {
                    self.images.push_back(detections.stamp);
                    let n_over = self.images.len().saturating_sub(WAITING_IMAGES);
                    self.images.drain(..n_over);
                }
            }
            Message::Rejects(_) | Message::Temperature(_) | Message::Pressure(_) => self.keep(log_time, message),
            Message::Mark(Mark { start, end, kind: MarkKind::Capture { pose_idx, .. } }) => {
                views.extend(self.marked(*start, *end, *pose_idx));
            }
            _ => {}
        }
        views
    }

    /// Returns the views that are complete when no more messages come.
    pub fn finish(&mut self) -> Vec<View> {
        let mut views: Vec<View> = self.ended.take().and_then(|span| self.rested(span)).into_iter().collect();
        if let (Some(rest), Some(last)) = (self.rest, self.last)
            && !rest.is_used
        {
            self.rest = Some(Rest { is_used: true, ..rest });
            views.extend(self.rested((rest.since, last)));
        }
        views
    }

    fn keep(&mut self, log_time: Stamp, message: &Message) {
        self.window.push_back((log_time, message.clone()));
        let is_old = |(stamp, _): &(Stamp, Message)| log_time.since_s(*stamp) > WINDOW_S;
        while self.window.len() > WINDOW_MESSAGES || self.window.front().is_some_and(is_old) {
            self.window.pop_front();
        }
    }

    fn read(&mut self, sample: &JointSensorSample, views: &mut Vec<View>) {
        let JointSensorSample { stamp, counts } = sample;
        if self.last.is_some_and(|last| *stamp <= last) {
            return;
        }
        self.last = Some(*stamp);
        let has_moved = self.rest.is_none_or(|rest| self.leaves(&rest, counts));
        if has_moved {
            if let Some(rest) = self.rest.filter(|rest| !rest.is_used) {
                self.ended = Some((rest.since, *stamp));
            }
            let anchor = self.sensors.travel_rad(counts);
            self.rest = Some(Rest { since: *stamp, anchor, is_used: false });
        }
        if self.ended.is_some_and(|(_, end)| stamp.since_s(end) > MARK_DELAY_S) {
            views.extend(self.ended.take().and_then(|span| self.rested(span)));
        }
        if let Some(rest) = self.rest.filter(|rest| !rest.is_used && stamp.since_s(rest.since) > LONGEST_REST_S) {
            self.rest = Some(Rest { is_used: true, ..rest });
            views.extend(self.rested((rest.since, *stamp)));
        }
        while self.images.front().is_some_and(|image| stamp.since_s(*image) > ABOUT_IMAGE_S) {
            let image = self.images.pop_front();
            views.extend(image.and_then(|image| self.moving(image)));
        }
    }

    fn leaves(&self, rest: &Rest, counts: &JointCounts) -> bool {
        self.sensors.models.iter().enumerate().any(|(joint, model)| {
            let spec = &model.spec;
            let noise_rad = spec.noise_std_counts.max(0.5) / spec.counts_per_rad.abs();
            let by_rad = apart_rad(spec, model.nominal_travel_rad(counts[joint]), rest.anchor[joint]);
            by_rad.abs() > REST_RAD + CLEAR_SIGMAS * noise_rad
        })
    }

    /// Returns the view of a marked span, unless it was processed already.
    fn marked(&mut self, start: Stamp, end: Stamp, pose_idx: u32) -> Option<View> {
        if start < self.used_until {
            return None;
        }
        self.ended = self.ended.filter(|(_, rest_end)| *rest_end <= start);
        self.rest = self.rest.map(|rest| Rest { is_used: rest.is_used || rest.since < end, ..rest });
        self.view(pose_idx, (start, end))
    }

    /// Returns the view of a rest; `None` if it is short or was processed already.
    fn rested(&mut self, (since, end): (Stamp, Stamp)) -> Option<View> {
        let (start, end) = (since.plus_s(SETTLE_S).max(self.used_until), end.plus_s(-0.1));
        if end.since_s(start) < SHORTEST_REST_S {
            return None;
        }
        let view = self.view(self.n_views, (start, end))?;
        (!view.tags.is_empty() || view.gripper_tag.is_some()).then_some(view)
    }

    fn view(&mut self, pose_idx: u32, span: (Stamp, Stamp)) -> Option<View> {
        if self.images_move(span) {
            return None;
        }
        self.window.make_contiguous();
        let view = view_of_span(self.window.as_slices().0, &self.robot, pose_idx, span)?;
        self.used_until = span.1;
        self.n_views += 1;
        // An arm settles from both sides: only motion shows to which side its sensors' shafts are turned.
        Some(View { approach: [0.0; MAX_JOINTS], ..view })
    }

    /// True if the images show a motion that no sensor shows: one may have failed. Most of the tags decide, because an
    /// id may be misread.
    fn images_move(&self, (start, end): (Stamp, Stamp)) -> bool {
        let mut seen: BTreeMap<u32, [[[f64; 2]; 4]; 2]> = BTreeMap::new();
        for (_, message) in &self.window {
            let Message::Detections(TagDetections { stamp, tags, .. }) = message else { continue };
            for tag in tags.iter().filter(|_| (start..=end).contains(stamp)) {
                seen.entry(tag.id).or_insert([tag.corners_px; 2])[1] = tag.corners_px;
            }
        }
        let [fx, fy] = self.robot.camera.lens.focal_px();
        let far_px = MOVES_RAD * fx.max(fy);
        let moves = |[first, last]: &&[[[f64; 2]; 4]; 2]| {
            first.iter().zip(last).any(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1]) > far_px)
        };
        let n_twice = seen.values().filter(|[first, last]| first != last).count();
        2 * seen.values().filter(moves).count() > n_twice
    }

    /// Returns the view of one image of a moving arm.
    fn moving(&mut self, image: Stamp) -> Option<View> {
        let (start, end) = (image.plus_s(-ABOUT_IMAGE_S), image.plus_s(ABOUT_IMAGE_S));
        if start < self.used_until {
            return None;
        }
        let belongs = |(_, message): &&(Stamp, Message)| match message {
            Message::JointSensors(sample) => sample.stamp >= start && sample.stamp <= end,
            Message::Detections(detections) => detections.stamp == image,
            Message::Temperature(_) | Message::Pressure(_) => true,
            _ => false,
        };
        let about: Vec<(Stamp, Message)> = self.window.iter().filter(belongs).cloned().collect();
        let mut view = view_of_span(&about, &self.robot, self.n_views, (start, end))?;
        let is_slow_enough = view.rate_rad_s.iter().all(|rate| rate.abs() < FASTEST_RAD_S);
        let is_usable =
            view.n_readings >= MIN_READINGS_OF_RATE && is_moving(&view) && is_slow_enough && !view.tags.is_empty();
        if !is_usable || !self.is_apart(&view.travel_rad) {
            return None;
        }
        at_image(&mut view, &about, image);
        for (approach, rate) in view.approach.iter_mut().zip(view.rate_rad_s.iter()) {
            // The sign of a slower rate is noise.
            *approach = if rate.abs() < 0.5 * SLOWEST_RAD_S { 0.0 } else { rate.signum() };
        }
        self.moved_at = Some(view.travel_rad);
        self.used_until = image;
        self.n_views += 1;
        Some(view)
    }

    fn is_apart(&self, travel_rad: &JointAngles) -> bool {
        let Some(before) = self.moved_at else { return true };
        let models = self.sensors.models.iter().enumerate();
        let moved = |(joint, model): (usize, &armcal_core::sensor::SensorModel)| {
            apart_rad(&model.spec, travel_rad[joint], before[joint]).abs() > APART_RAD
        };
        models.take(self.robot.n_seen_joints()).any(moved)
    }
}

/// Moves the readings' mean along their line to the time of the image: it lies at the mean of their own stamps.
fn at_image(view: &mut View, about: &[(Stamp, Message)], image: Stamp) {
    let readings = about.iter().filter_map(|(_, message)| match message {
        Message::JointSensors(sample) => Some(image.since_s(sample.stamp)),
        _ => None,
    });
    let (sum_s, n) = readings.fold((0.0, 0), |(sum_s, n), late_s| (sum_s + late_s, n + 1));
    let late_s = sum_s / f64::from(n.max(1));
    view.travel_rad = JointAngles::from_fn(view.travel_rad.len(), |j| view.travel_rad[j] + view.rate_rad_s[j] * late_s);
}

/// True if a joint moved during the view.
pub(crate) fn is_moving(view: &View) -> bool {
    view.rate_rad_s.iter().any(|rate| rate.abs() > SLOWEST_RAD_S)
}

/// True if the readings are of this arm and finite.
fn is_usable(sample: &JointSensorSample, robot: &Robot) -> bool {
    sample.counts.len() == robot.n_joints() && sample.counts.iter().all(|counts| counts.is_finite())
}

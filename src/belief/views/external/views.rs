//! Conversion of tag messages to views: all detections while the arm stood still form one view.

use crate::views::constants::external_views::{
    ATTITUDE_WITHIN_S, MIN_MEAN_UP, RATE_SIGMAS, REST_RATE_RAD_S, SAME_POSE_SIGMAS,
};
use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use crate::views::conditions::ConditionHistory;
use crate::views::external::landmarks::{Averaged, PlainLandmark, average, average_board};
use crate::views::external::pairing::{RATE_WINDOW_S, TravelSample, TravelSeries};
use crate::views::motion::Motion;
use crate::views::view::{FASTEST_RAD_S, ObservationRejection, TagObservation, View};
use armcal_core::input::{AttitudeReading, ExternalRecording, InputMap, RawMeasurement, TagFrame, WhileMoving};
use armcal_core::robot::Robot;
use armcal_core::streams::JointAngles;
use armcal_core::time::Stamp;

/// A view, the hash of its first message, and the first and last reading that it comes from.
pub(crate) struct MadeView {
    pub view: View,
    pub first: [u8; 32],
    readings: (usize, usize),
}

/// Views of one recording.
#[derive(Default)]
pub(crate) struct RecordingViews {
    pub views: Vec<MadeView>,
    /// Hashes of all messages that the views come from.
    pub digests: Vec<[u8; 32]>,
    pub ids_seen: Vec<u32>,
    pub rejected: BTreeMap<ObservationRejection, usize>,
}

/// A tag message with its joint reading.
struct PairedFrame<'a> {
    frame: &'a TagFrame,
    paired: TravelSample,
}

/// Builder of the views of one camera.
struct Maker<'a> {
    robot: &'a Robot,
    /// Number of the camera.
    camera: usize,
    plain: PlainLandmark,
    while_moving: WhileMoving,
    travels: TravelSeries<'a>,
    recording: &'a ExternalRecording,
    conditions: ConditionHistory,
    /// Standard deviation of a reading of each joint that moves the camera, rad.
    noise_rad: Vec<f64>,
    out: RecordingViews,
}

impl RecordingViews {
    pub fn of(recording: &ExternalRecording, map: &InputMap, robot: &Robot, plain: PlainLandmark) -> Self {
        let mut all = Self::default();
        let cameras = std::iter::once(&recording.frames).chain(&recording.further_frames);
        for (camera, frames) in cameras.enumerate().filter(|(_, frames)| !frames.is_empty()) {
            let of_camera = Maker::new(recording, map, (robot, camera), plain).views(frames);
            all.views.extend(of_camera.views);
            all.digests.extend(of_camera.digests);
            all.ids_seen.extend(of_camera.ids_seen);
            for (why, n) in of_camera.rejected {
                *all.rejected.entry(why).or_default() += n;
            }
        }
        all.count_cameras();
        all
    }

    /// Counts the cameras with a view of each pose: views of two cameras that share readings are of one pose.
    fn count_cameras(&mut self) {
        let spans: Vec<_> = self.views.iter().map(|made| (made.view.camera, made.readings)).collect();
        for MadeView { view, readings: (from, to), .. } in &mut self.views {
            let is_shared =
                |(camera, (a, b)): &&(usize, (usize, usize))| *camera != view.camera && a <= to && &*from <= b;
            let others: BTreeSet<usize> = spans.iter().filter(is_shared).map(|(camera, _)| *camera).collect();
            view.n_cameras = 1 + others.len();
        }
    }
}

impl<'a> Maker<'a> {
    fn new(
        recording: &'a ExternalRecording,
        map: &InputMap,
        (robot, camera): (&'a Robot, usize),
        plain: PlainLandmark,
    ) -> Self {
        let moving = &robot.sensors[..robot.n_joints_seen_by(robot.camera_at(camera))];
        Self {
            robot,
            camera,
            plain,
            while_moving: map.while_moving,
            travels: TravelSeries::new(recording, robot, map.max_gap_s),
            recording,
            conditions: ConditionHistory::of_external(&recording.conditions),
            noise_rad: moving.iter().map(|spec| spec.noise_std_counts / spec.counts_per_rad.abs()).collect(),
            out: RecordingViews::default(),
        }
    }

    fn views(mut self, frames: &'a [TagFrame]) -> RecordingViews {
        let mut group: Vec<PairedFrame<'_>> = Vec::new();
        for frame in frames {
            let Some(paired) = self.travels.at(frame.stamp) else {
                self.reject(ObservationRejection::NoReadings, frame.tags.len());
                continue;
            };
            let is_moving = self.is_moving(&paired);
            let is_too_fast = paired.rate_rad_s.is_some_and(|rate| rate.iter().any(|rate| rate.abs() > FASTEST_RAD_S));
            if is_moving && (self.while_moving == WhileMoving::LeaveOut || is_too_fast) {
                self.reject(ObservationRejection::ArmMoving, frame.tags.len());
                self.close(&mut group);
                continue;
            }
            let next = PairedFrame { frame, paired };
            if !self.belongs(&group, &next) {
                self.close(&mut group);
            }
            group.push(next);
        }
        self.close(&mut group);
        self.out
    }
}

impl Maker<'_> {
    fn reject(&mut self, why: ObservationRejection, n: usize) {
        *self.out.rejected.entry(why).or_default() += n;
    }

    /// Returns true if the arm is moving, which only a continuous stream of readings can show.
    fn is_moving(&self, paired: &TravelSample) -> bool {
        let Some(rate) = paired.rate_rad_s else { return false };
        // Noise of two readings over twice the window.
        let of_noise = |noise_rad: f64| noise_rad * std::f64::consts::FRAC_1_SQRT_2 / RATE_WINDOW_S;
        self.noise_rad
            .iter()
            .zip(rate.iter())
            .any(|(noise, rate)| rate.abs() > REST_RATE_RAD_S + RATE_SIGMAS * of_noise(*noise))
    }

    fn is_same_pose(&self, a: &JointAngles, b: &JointAngles) -> bool {
        let close = |joint: usize, noise: f64| self.travels.difference(a, b, joint).abs() <= SAME_POSE_SIGMAS * noise;
        self.noise_rad.iter().enumerate().all(|(joint, noise)| close(joint, *noise))
    }

    /// Returns true if the arm has stood still since the group began, which only a continuous stream can show.
    /// Otherwise each reading is a pose that somebody recorded, and detections near it belong to that pose.
    fn belongs(&self, group: &[PairedFrame<'_>], next: &PairedFrame<'_>) -> bool {
        let (Some(first), Some(last)) = (group.first(), group.last()) else { return true };
        if !(last.paired.is_continuous && next.paired.is_continuous) {
            return last.paired.readings == next.paired.readings;
        }
        let pose = &first.paired.travel_rad;
        let between = last.paired.readings.1..next.paired.readings.0.max(last.paired.readings.1);
        self.is_same_pose(&next.paired.travel_rad, pose)
            && self.travels.travel_rad[between].iter().all(|travel| self.is_same_pose(travel, pose))
    }

    /// Makes a view of the group, and empties the group.
    fn close(&mut self, group: &mut Vec<PairedFrame<'_>>) {
        let frames = std::mem::take(group);
        let (Some(first), Some(last)) = (frames.first(), frames.last()) else { return };
        let (travel_rad, n_readings) = self.mean_travel(&frames);
        let mut view = View::of_reading(0, last.frame.stamp, travel_rad);
        (view.n_readings, view.camera) = (n_readings, self.camera);
        let mut heard = Vec::new();
        view.conditions = self.conditions.over_noting(first.frame.stamp, last.frame.stamp, &mut heard);
        view.conditions.stamp = Some(last.frame.stamp);
        let rates: Vec<JointAngles> = frames.iter().filter_map(|frame| frame.paired.rate_rad_s).collect();
        if !rates.is_empty() {
            let mean = |j: usize| rates.iter().map(|rate| rate[j]).sum::<f64>() / rates.len() as f64;
            view.rate_rad_s = JointAngles::from_fn(travel_rad.len(), mean);
        }
        view.motion = self.motion(&frames);
        self.add_tags(&mut view, &frames);
        if view.tags.is_empty() {
            return;
        }
        let mut deciding = Vec::new();
        if self.while_moving == WhileMoving::Use {
            // An arm settles from both sides, so that the side is known only in motion. The rate of a slower joint has
            // the sign of its noise.
            for (approach, rate) in view.approach.iter_mut().zip(view.rate_rad_s.iter()) {
                *approach = if rate.abs() < REST_RATE_RAD_S { 0.0 } else { rate.signum() };
            }
        } else if first.paired.is_continuous {
            view.approach = self.travels.approach(first.paired.readings.0, &travel_rad, &mut deciding);
        }
        view.up = self.up_over(first.frame.stamp, last.frame.stamp);
        self.out.digests.extend(deciding.into_iter().map(|idx| self.travels.readings[idx].digest));
        for frame in &frames {
            let (from, to) = frame.paired.readings;
            self.out.digests.extend(&frame.frame.digests);
            self.out.digests.extend(self.travels.readings[from..=to].iter().map(|reading| reading.digest));
        }
        self.out.digests.extend(heard.into_iter().map(|idx| self.recording.conditions[idx].digest));
        let (from, to) = (first.paired.readings.0, last.paired.readings.1);
        self.out.digests.extend(self.travels.readings[from..=to].iter().map(|reading| reading.digest));
        self.out.views.push(MadeView { view, first: first.frame.digests[0], readings: (from, to) });
    }

    /// Returns the readings around the one image of a view of a moving arm.
    fn motion(&self, frames: &[PairedFrame<'_>]) -> Option<Motion> {
        let [PairedFrame { frame, paired }] = frames else { return None };
        if self.while_moving != WhileMoving::Use || !self.is_moving(paired) {
            return None;
        }
        let now_rad = &paired.travel_rad;
        Motion::new(|s| {
            let at = self.travels.at(frame.stamp.plus_s(s))?;
            let unwrapped = |j: usize| now_rad[j] + self.travels.difference(&at.travel_rad, now_rad, j);
            Some((JointAngles::from_fn(now_rad.len(), unwrapped), at.rate_rad_s?))
        })
    }

    /// Returns the mean direction against gravity over the span, else the nearest in time; `None` without an attitude
    /// near enough.
    fn up_over(&mut self, start: Stamp, end: Stamp) -> Option<Vector3<f64>> {
        let attitudes = &self.recording.attitudes;
        let from = attitudes.partition_point(|attitude| attitude.stamp < start);
        let to = attitudes.partition_point(|attitude| attitude.stamp <= end).max(from);
        let distance_s = |attitude: &AttitudeReading| start.since_s(attitude.stamp).max(attitude.stamp.since_s(end));
        let beside = [from.checked_sub(1), Some(to)].into_iter().flatten().filter(|idx| *idx < attitudes.len());
        let nearest = beside.min_by(|a, b| distance_s(&attitudes[*a]).total_cmp(&distance_s(&attitudes[*b])));
        let used = match nearest.filter(|idx| from == to && distance_s(&attitudes[*idx]) <= ATTITUDE_WITHIN_S) {
            Some(idx) => &attitudes[idx..=idx],
            None => &attitudes[from..to],
        };
        self.out.digests.extend(used.iter().map(|attitude| attitude.digest));
        let sum: Vector3<f64> = used.iter().map(|attitude| attitude.up).sum();
        sum.try_normalize(MIN_MEAN_UP * used.len() as f64)
    }

    /// Returns the mean travel over the readings during the group; for one frame between two readings, the interpolated
    /// travel.
    fn mean_travel(&self, frames: &[PairedFrame<'_>]) -> (JointAngles, usize) {
        let first = &frames[0].paired.travel_rad;
        let (start, end) = (frames[0].frame.stamp, frames[frames.len() - 1].frame.stamp);
        let (from, to) = (frames[0].paired.readings.0, frames[frames.len() - 1].paired.readings.1);
        let is_within = |idx: &usize| (start..=end).contains(&self.travels.readings[*idx].stamp);
        let within: Vec<&JointAngles> =
            (from..=to).filter(is_within).map(|idx| &self.travels.travel_rad[idx]).collect();
        let paired = || frames.iter().map(|frame| &frame.paired.travel_rad).collect::<Vec<_>>();
        let (all, n_readings) = match within.len() {
            0 => (paired(), 1),
            n => (within, n),
        };
        let mean = |j: usize| all.iter().map(|t| self.travels.difference(t, first, j)).sum::<f64>() / all.len() as f64;
        (JointAngles::from_fn(first.len(), |j| first[j] + mean(j)), n_readings)
    }

    fn add_tags(&mut self, view: &mut View, frames: &[PairedFrame<'_>]) {
        let mut by_id: BTreeMap<u32, Vec<RawMeasurement>> = BTreeMap::new();
        for observation in frames.iter().flat_map(|frame| &frame.frame.tags) {
            if let Some(id) = observation.id.or(self.plain.id) {
                by_id.entry(id).or_default().push(observation.seen);
            }
        }
        let camera = self.robot.camera_at(self.camera);
        for (id, seen) in by_id {
            self.out.ids_seen.push(id);
            let Some(tag_idx) = self.robot.tags.iter().position(|tag| tag.id == id) else {
                self.reject(ObservationRejection::UnknownTag, seen.len());
                continue;
            };
            let (averaged, n_apart) = match self.plain.board.filter(|_| self.plain.id == Some(id)) {
                Some(board) => {
                    let (averaged, n_apart) = average_board(&seen, camera, board);
                    (averaged.map(Some), n_apart)
                }
                None => average(&seen, camera, self.robot.tags[tag_idx].size_m),
            };
            if n_apart > 0 {
                self.reject(ObservationRejection::InconsistentFrame, n_apart);
            }
            match averaged {
                Ok(Some(Averaged { center_in_camera_m, measured })) => {
                    view.tags.push(TagObservation { id, tag_idx, center_in_camera_m, measured });
                }
                Ok(None) => {}
                Err(why) => self.reject(why, 1),
            }
        }
    }
}

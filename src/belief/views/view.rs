//! A view: averaged data of an arm at rest, and all views of a recording.

pub(crate) use crate::views::constants::view::FASTEST_RAD_S;
use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector3};

use crate::views::motion::Motion;
use armcal_core::input::TagNoise;
use armcal_core::optics::{solve_square, square_corners};
use armcal_core::robot::Robot;
use armcal_core::sensor::Conditions;
use armcal_core::streams::{JointAngles, MAX_JOINTS, ReachTask, RejectReason};
use armcal_core::time::Stamp;

/// Averaged data of an arm at rest that looks at tags.
#[derive(Clone, Debug)]
pub struct View {
    /// Number of the view in its capture mark, 0 under other marks; by time in external recordings.
    pub pose_idx: u32,
    /// End of the capture mark; the stamp of the last image in external recordings.
    pub end: Stamp,
    /// Mean travel of each joint from the middle of its range by the datasheet, rad.
    pub travel_rad: JointAngles,
    /// Number of readings in that mean.
    pub n_readings: usize,
    /// Rate of the travel over the view, rad/s.
    pub rate_rad_s: JointAngles,
    /// Readings around the view, if the arm moved in a continuous stream of them.
    pub motion: Option<Motion>,
    /// Direction in which each joint last moved before the view: -1, 1, or 0 if unknown.
    pub approach: [f64; MAX_JOINTS],
    /// True for joints without a usable reading in this view: `travel_rad` is then only a guess.
    pub is_free: [bool; MAX_JOINTS],
    /// Oil temperature, pressure and time of the readings.
    pub conditions: Conditions,
    /// Unit vector against gravity in the base frame, from an attitude sensor; `None`: the direction of robot.toml.
    pub up: Option<Vector3<f64>>,
    /// Number of the robot's camera that saw the tags.
    pub camera: usize,
    /// Number of cameras with a view of this pose; they share the joints' errors there.
    pub n_cameras: usize,
    /// Surveyed tags that were seen, in the order of their ids, each once.
    pub tags: Vec<TagObservation>,
    /// Corners of the tag on the gripper, if the robot has one and it was seen.
    pub gripper_tag: Option<MeanCorners>,
}

impl View {
    /// Returns the view without the tags of unknown pose; `None` if nothing is left of it.
    #[must_use]
    pub(crate) fn of_known_tags(&self, robot: &Robot) -> Option<Self> {
        let mut view = self.clone();
        view.tags.retain(|seen| robot.tags[seen.tag_idx].is_known());
        (!view.tags.is_empty() || view.gripper_tag.is_some()).then_some(view)
    }

    /// Returns true if readings and tags equal those of `other` to the bit, as in no second measurement.
    fn repeats(&self, other: &Self) -> bool {
        let of_tag = |seen: &TagObservation| (seen.tag_idx, seen.center_in_camera_m);
        self.travel_rad == other.travel_rad
            && self.camera == other.camera
            && !self.tags.is_empty()
            && self.tags.iter().map(of_tag).eq(other.tags.iter().map(of_tag))
    }

    /// Takes the readings of `by_s` later; if these are not known, moves the travel at the rates of the view.
    pub(crate) fn read_later(&mut self, by_s: f64) {
        if let Some((change_rad, rate_rad_s)) = self.motion.take().and_then(|motion| motion.later(by_s)) {
            self.travel_rad = JointAngles::from_fn(change_rad.len(), |j| self.travel_rad[j] + change_rad[j]);
            self.rate_rad_s = rate_rad_s;
            return;
        }
        for (travel_rad, rate_rad_s) in self.travel_rad.iter_mut().zip(self.rate_rad_s.iter()) {
            *travel_rad += rate_rad_s * by_s;
        }
    }

    /// Computes the tags' positions in the first camera's frame with the lens of `robot`; keeps those that it cannot
    /// show as a square.
    pub(crate) fn see_through(&mut self, robot: &Robot) {
        for tag in &mut self.tags {
            let TagMeasurement::Corners(seen) = &tag.measured else { continue };
            let size_m = robot.tags[tag.tag_idx].size_m;
            if let Ok(solved) = solve_square(&robot.camera_at(self.camera).lens, size_m, &seen.corners_px) {
                tag.center_in_camera_m = solved.camera_from_tag.origin().vector();
            }
        }
    }

    /// Returns true if the tag with that index is in the view.
    pub(crate) fn sees(&self, tag_idx: usize) -> bool {
        self.tags.iter().any(|seen| seen.tag_idx == tag_idx)
    }

    /// Returns a view of one reading of an arm at rest under unknown conditions, without tags.
    #[must_use]
    pub fn of_reading(pose_idx: u32, end: Stamp, travel_rad: JointAngles) -> Self {
        Self {
            pose_idx,
            end,
            travel_rad,
            n_readings: 1,
            rate_rad_s: JointAngles::zeros(travel_rad.len()),
            motion: None,
            approach: [0.0; MAX_JOINTS],
            is_free: [false; MAX_JOINTS],
            conditions: Conditions::default(),
            up: None,
            camera: 0,
            n_cameras: 1,
            tags: Vec::new(),
            gripper_tag: None,
        }
    }
}

/// Corners of one tag, averaged over the frames of a view.
#[derive(Clone, Copy, Debug)]
pub struct MeanCorners {
    /// Mean over the frames, raw pixels.
    pub corners_px: [[f64; 2]; 4],
    /// Number of averaged frames.
    pub n_frames: usize,
    /// Sum over frames and the eight coordinates of the squared deviation from the mean, with `8 (n_frames - 1)`
    /// degrees of freedom.
    pub scatter_px2: f64,
}

/// One inner corner of a board, averaged over the frames of a view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardPoint {
    /// Position in the board's frame, m; z is zero.
    pub on_board: Point3<f64>,
    /// Mean over the frames, raw pixels.
    pub pixel: [f64; 2],
    /// Number of averaged frames.
    pub n_frames: usize,
}

/// Corners of a board, averaged over the frames of a view.
#[derive(Clone, Debug)]
pub struct BoardPoints {
    /// Four or more corners, not on a line.
    pub points: Arc<[BoardPoint]>,
    /// Pose estimated from these points only.
    pub camera_from_board: Isometry3<f64>,
    /// Sum over frames and coordinates of the squared deviation from the mean.
    pub scatter_px2: f64,
    /// Degrees of freedom of `scatter_px2`.
    pub n_free: usize,
}

/// Measurement of a tag or landmark in a view.
#[derive(Clone, Debug)]
pub enum TagMeasurement {
    /// Corners of the tag in the image.
    Corners(MeanCorners),
    /// Position of the tag in the camera frame, and no more.
    Position,
    /// Pose `camera_from_tag`.
    Pose(Isometry3<f64>),
    /// Corners of a board in the image.
    Board(BoardPoints),
}

/// One tag in one view.
#[derive(Clone, Debug)]
pub struct TagObservation {
    /// Number of the tag, or the number that stands for a named landmark.
    pub id: u32,
    /// Index into the robot's surveyed tags.
    pub tag_idx: usize,
    /// Centre of the tag in the camera frame, m.
    pub center_in_camera_m: Vector3<f64>,
    /// Measured corners, position or pose.
    pub measured: TagMeasurement,
}

impl TagObservation {
    /// Returns the corners, if the recording has them.
    #[must_use]
    pub fn corners(&self) -> Option<&MeanCorners> {
        match &self.measured {
            TagMeasurement::Corners(seen) => Some(seen),
            TagMeasurement::Position | TagMeasurement::Pose(_) | TagMeasurement::Board(_) => None,
        }
    }

    /// Returns points in the tag's frame, m, and their positions in the image, px. The points are those of a tag of
    /// `size_m` or of a board; empty if the recording has no pixels.
    #[must_use]
    pub fn points(&self, size_m: f64) -> Vec<(Point3<f64>, [f64; 2])> {
        match &self.measured {
            TagMeasurement::Corners(seen) => square_corners(size_m).into_iter().zip(seen.corners_px).collect(),
            TagMeasurement::Board(seen) => seen.points.iter().map(|point| (point.on_board, point.pixel)).collect(),
            TagMeasurement::Position | TagMeasurement::Pose(_) => Vec::new(),
        }
    }

    /// Returns true if pixels were measured.
    #[must_use]
    pub fn is_in_pixels(&self) -> bool {
        matches!(self.measured, TagMeasurement::Corners(_) | TagMeasurement::Board(_))
    }
}

/// Reason why a detection was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ObservationRejection {
    /// The robot's survey does not know this id.
    UnknownTag,
    /// The corners are not those of a square seen from its front.
    NotASquare,
    /// The corners run the other way round, as in a mirror, or their sides cross.
    CornerOrder,
    /// A corner has no bearing in the lens model.
    OutOfView,
    /// The mark's span holds no joint readings.
    NoReadings,
    /// In some frame of a view a tag lies elsewhere than in most: a misread id of another tag.
    InconsistentFrame,
    /// The arm was moving.
    ArmMoving,
    /// The view has the same numbers as another one: the same data, recorded twice.
    RepeatedView,
    /// The observation does not fit the others.
    Outlier,
    /// The detector itself rejected the tag.
    Detector(RejectReason),
}

impl ObservationRejection {
    /// Returns the name of the reason in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::UnknownTag => "unknown_tag",
            Self::NotASquare => "not_a_square",
            Self::CornerOrder => "corner_order",
            Self::OutOfView => "out_of_view",
            Self::NoReadings => "no_joint_readings",
            Self::InconsistentFrame => "inconsistent_frame",
            Self::Outlier => "outlier",
            Self::ArmMoving => "arm_moving",
            Self::RepeatedView => "repeated_view",
            Self::Detector(reason) => reason.name(),
        }
    }

    /// Advice for a recording that lost all detections for this reason.
    pub(crate) fn remedy(self) -> &'static str {
        match self {
            Self::UnknownTag => "give a tag map that has the tags' ids",
            Self::NotASquare => {
                "check which columns or fields hold the corners, and the lens in [camera] of robot.toml"
            }
            Self::CornerOrder => {
                "state the order in which the corners are recorded (tags.corner_order of the input map, of a table \
                 tags.columns.corner_order), and check that u counts to the right and v down"
            }
            Self::OutOfView => "check model, resolution and distortion of the lens in [camera] of robot.toml",
            Self::NoReadings => "check that joint readings and tags are of the same time",
            Self::InconsistentFrame | Self::Outlier => "check the tag ids, and that no id is used twice",
            Self::ArmMoving => "record while the arm stands still",
            Self::RepeatedView => "record each pose once more instead of copying its rows",
            Self::Detector(_) => "check the images: light, focus, size of the tags",
        }
    }
}

/// Views of a recording, and the other data that a calibration uses.
#[derive(Clone, Debug, Default)]
pub struct CaptureData {
    /// Views that the fit uses.
    pub fit: Vec<View>,
    /// Views marked as held out; `bundle` also fits them, and cross-validates all.
    pub held_out: Vec<View>,
    /// Views in which only one joint moved, by that joint, in the order of time.
    pub identify: BTreeMap<u32, Vec<View>>,
    /// Readings at nominal end stops, in the order of time.
    pub stops: Vec<(Stamp, EndStopReading)>,
    /// Contacts of the tool with surveyed surfaces, in the order of time.
    pub touches: Vec<Touch>,
    /// First task of the recording; `None` if it has none.
    pub task: Option<ReachTask>,
    /// Joint angles by the datasheet at the arm's last rest for each target of the task, by the target's number.
    pub rests: BTreeMap<u32, JointAngles>,
    /// Number of capture marks, including those without a view; number of views in external recordings.
    pub n_marks: usize,
    /// Number of detections by reason, over all views.
    pub rejected: BTreeMap<ObservationRejection, usize>,
    /// Ids seen in any view, unknown ones included; ascending, each once.
    pub ids_seen: Vec<u32>,
    /// The smallest column and row of any corner, px; at most zero.
    pub smallest_px: [f64; 2],
    /// The largest column and row of any corner, px; zero without corners.
    pub largest_px: [f64; 2],
    /// Stated noise of tag positions and poses, if any.
    pub tag_noise: Option<TagNoise>,
    /// Names of landmarks that are no numbered tags, by the number that stands for them.
    pub landmark_names: BTreeMap<u32, String>,
    /// Lowest and highest oil temperature over the captured spans, C.
    pub oil_c: Option<(f64, f64)>,
    /// Lowest and highest water temperature over the captured spans, C.
    pub water_c: Option<(f64, f64)>,
    /// Lowest and highest absolute pressure over the captured spans, Pa.
    pub pressure_pa: Option<(f64, f64)>,
    /// Indices of the recording's messages that were used, ascending.
    pub used: Vec<usize>,
    /// Indices of further messages that only sensors with terms use, ascending: thermometers near the views, readings
    /// before them.
    pub used_for_terms: Vec<usize>,
}

/// Task, and the configurations in which the arm rested at its targets.
#[derive(Clone, Copy, Debug)]
pub struct TaskRests<'a> {
    /// Targets and tolerance.
    pub task: &'a ReachTask,
    /// Configuration at each target, by the target's number; targets without a rest are absent.
    pub rests: &'a BTreeMap<u32, JointAngles>,
    /// Views of the arm, at which it was, too.
    pub views: &'a [View],
}

impl CaptureData {
    /// Returns the task with its rests; `None` without a task.
    #[must_use]
    pub fn task_rests(&self) -> Option<TaskRests<'_>> {
        Some(TaskRests { task: self.task.as_ref()?, rests: &self.rests, views: &self.fit })
    }

    /// Widens `smallest_px` and `largest_px` to contain these corners.
    pub(crate) fn note_corners(&mut self, corners_px: &[[f64; 2]]) {
        for corner in corners_px {
            self.smallest_px = std::array::from_fn(|axis| self.smallest_px[axis].min(corner[axis]));
            self.largest_px = std::array::from_fn(|axis| self.largest_px[axis].max(corner[axis]));
        }
    }

    /// Removes all views except those of the first camera; returns the number of removed views.
    pub fn keep_first_camera(&mut self) -> usize {
        let n_before = self.fit.len() + self.held_out.len();
        self.fit.retain(|view| view.camera == 0);
        self.held_out.retain(|view| view.camera == 0);
        for view in self.fit.iter_mut().chain(&mut self.held_out) {
            view.n_cameras = 1;
        }
        n_before - self.fit.len() - self.held_out.len()
    }

    /// Removes views that repeat an earlier one: they would count, and be held out, as if they added information.
    pub(crate) fn leave_out_repeated(&mut self) {
        let all: Vec<&View> = self.fit.iter().chain(&self.held_out).collect();
        let repeats = |(k, view): (usize, &&View)| all[..k].iter().any(|earlier| view.repeats(earlier));
        let repeats: Vec<bool> = all.iter().enumerate().map(repeats).collect();
        let n_tags: usize =
            all.iter().zip(&repeats).filter(|(_, repeats)| **repeats).map(|(view, _)| view.tags.len()).sum();
        let mut repeats = repeats.into_iter();
        for views in [&mut self.fit, &mut self.held_out] {
            views.retain(|_| repeats.next() == Some(false));
        }
        if n_tags > 0 {
            self.reject(ObservationRejection::RepeatedView, n_tags);
        }
    }

    pub(crate) fn reject(&mut self, why: ObservationRejection, n: usize) {
        *self.rejected.entry(why).or_default() += n;
    }

    /// Sorts everything into an order that does not depend on when it was marked.
    pub(crate) fn sort(&mut self) {
        self.stops.sort_by_key(|(end, _)| *end);
        self.touches.sort_by_key(|touch| touch.view.end);
        self.fit.sort_by_key(|view| view.pose_idx);
        self.held_out.sort_by_key(|view| view.pose_idx);
        for views in self.identify.values_mut() {
            views.sort_by_key(|view| view.end);
        }
        self.used.sort_unstable();
        self.used.dedup();
        self.used_for_terms.sort_unstable();
        self.used_for_terms.dedup();
        self.used_for_terms.retain(|idx| self.used.binary_search(idx).is_err());
        self.ids_seen.sort_unstable();
        self.ids_seen.dedup();
    }

    /// Returns the number of rejected detections under each reason's name; detector and estimator share names.
    #[must_use]
    pub fn rejected_by_reason(&self) -> BTreeMap<String, usize> {
        let mut counts = BTreeMap::new();
        for (why, n) in &self.rejected {
            *counts.entry(why.name().to_owned()).or_default() += n;
        }
        counts
    }
}

/// Contact of the tool's tip with a surveyed plane, from readings at rest: `normal . (tool - point) = radius`.
#[derive(Clone, Debug)]
pub struct Touch {
    pub surface: String,
    /// Point on the surface, base frame.
    pub point_m: Vector3<f64>,
    /// Normal out of the surface, base frame.
    pub normal: Vector3<f64>,
    pub tip_radius_m: f64,
    /// Standard deviation along the normal.
    pub std_m: f64,
    /// Readings and conditions; the tags are not used.
    pub view: View,
}

/// Readings of one joint that stood at a nominal stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndStopReading {
    /// Index of the joint, base first.
    pub joint: usize,
    /// Nominal angle of the stop.
    pub angle_rad: f64,
    /// Mean travel of the joint from the middle of its range by the datasheet.
    pub travel_rad: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::stats::stream_rng;
    use armcal_core::time::SIMULATION_EPOCH;
    use rand::RngExt;

    /// Joints that swing: a straight line misses what they read 60 ms later, the readings about the view do not.
    #[test]
    fn readings_of_a_swinging_arm_are_taken_at_another_time() {
        let mut worst = [0.0_f64; 3];
        for seed in 0..20 {
            let mut rng = stream_rng(seed, "swings");
            let mut draw = |from: f64, to: f64| JointAngles::from_fn(6, |_| rng.random_range(from..to));
            let (swing_rad, turn_rad_s, phase_rad) = (draw(0.1, 0.3), draw(1.0, 1.6), draw(-3.0, 3.0));
            let angle = |s: f64| JointAngles::from_fn(6, |j| swing_rad[j] * (turn_rad_s[j] * s + phase_rad[j]).sin());
            let rate = |s: f64| {
                JointAngles::from_fn(6, |j| swing_rad[j] * turn_rad_s[j] * (turn_rad_s[j] * s + phase_rad[j]).cos())
            };
            for by_s in [-0.19, -0.06, 0.0, 0.003, 0.06, 0.19] {
                let mut view = View::of_reading(0, SIMULATION_EPOCH, angle(0.0));
                view.rate_rad_s = rate(0.0);
                let mut straight = view.clone();
                view.motion = Motion::new(|s| Some((angle(s), rate(s))));
                [&mut view, &mut straight].into_iter().for_each(|view| view.read_later(by_s));
                worst[0] = worst[0].max(view.travel_rad.max_abs_difference(&angle(by_s)));
                worst[1] = worst[1].max(view.rate_rad_s.max_abs_difference(&rate(by_s)));
                worst[2] = worst[2].max(straight.travel_rad.max_abs_difference(&angle(by_s)));
            }
        }
        let [travel_rad, rate_rad_s, straight_rad] = worst;
        assert!(travel_rad < 2e-5 && rate_rad_s < 4e-5, "{travel_rad} rad, {rate_rad_s} rad/s");
        assert!(straight_rad > 1e-3, "{straight_rad} rad");
    }
}

//! From messages to views: which readings and which corners belong to one standing arm.
//!
//! A capture mark gives the span by the joint sensors' clock. Readings in it are averaged as travel (never as raw
//! words, which wrap), corners of one tag over the frames in it; the arm stands still there, so a camera clock that is
//! some ten milliseconds late changes nothing.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::{Isometry3, Vector3};

use crate::calib::methods::EndStopReading;
use crate::calib::views::conditions::{ConditionHistory, TravelRate};
use crate::calib::views::frame_consensus::agreeing_mean;
use armcal_core::log::Recording;
use armcal_core::optics::{SquareError, SquarePose, solve_square};
use armcal_core::robot::{FailedJoint, Robot};
use armcal_core::sensor::{ArmSensors, Conditions};
use armcal_core::streams::{
    CaptureSet, JointAngles, MAX_JOINTS, Mark, MarkKind, Message, ReachTask, RecordedSurvey, RejectReason,
    TagDetections, Thermometer,
};
use armcal_core::time::Stamp;

/// A standing arm looking at tags.
#[derive(Clone, Debug)]
pub struct View {
    pub pose_idx: u32,
    pub end: Stamp,
    /// Mean travel of each joint from the middle of its range by the datasheet, rad.
    pub travel_rad: JointAngles,
    /// How many readings that mean has.
    pub n_readings: usize,
    /// How fast the travel changed over the view, rad/s.
    pub rate_rad_s: JointAngles,
    /// The way that each joint moved last before the view: -1, 1, or 0 where that is not known.
    pub approach: [f64; MAX_JOINTS],
    /// Joints whose reading says nothing in this view: `travel_rad` is then but a guess.
    pub is_free: [bool; MAX_JOINTS],
    /// Under which the readings were taken.
    pub conditions: Conditions,
    pub tags: Vec<TagObservation>,
    /// The tag on the gripper, where the robot has one and it was seen.
    pub gripper_tag: Option<MeanCorners>,
}

impl View {
    /// One reading of an arm at rest, nothing known of its surroundings, no tags yet.
    #[must_use]
    pub fn of_reading(pose_idx: u32, end: Stamp, travel_rad: JointAngles) -> Self {
        Self {
            pose_idx,
            end,
            travel_rad,
            n_readings: 1,
            rate_rad_s: JointAngles::zeros(travel_rad.len()),
            approach: [0.0; MAX_JOINTS],
            is_free: [false; MAX_JOINTS],
            conditions: Conditions::default(),
            tags: Vec::new(),
            gripper_tag: None,
        }
    }
}

/// Corners of one tag, averaged over the frames of a view.
#[derive(Clone, Copy, Debug)]
pub struct MeanCorners {
    pub corners_px: [[f64; 2]; 4],
    pub n_frames: usize,
    /// Sum over frames and the eight coordinates of the squared deviation from the mean; it has `8 (n_frames - 1)` degrees of freedom.
    pub scatter_px2: f64,
}

/// What a view tells of a tag or landmark.
#[derive(Clone, Copy, Debug)]
pub enum TagMeasurement {
    /// Its corners in the image.
    Corners(MeanCorners),
    /// Its position in the camera frame, and no more.
    Position,
    /// `camera_from_tag`.
    Pose(Isometry3<f64>),
}

/// One tag in one view.
#[derive(Clone, Copy, Debug)]
pub struct TagObservation {
    pub id: u32,
    /// Index into the robot's surveyed tags.
    pub tag_idx: usize,
    /// The tag's centre in the camera frame, m.
    pub center_in_camera_m: Vector3<f64>,
    pub measured: TagMeasurement,
}

impl TagObservation {
    /// Its corners, where the recording has them.
    #[must_use]
    pub fn corners(&self) -> Option<&MeanCorners> {
        match &self.measured {
            TagMeasurement::Corners(seen) => Some(seen),
            TagMeasurement::Position | TagMeasurement::Pose(_) => None,
        }
    }
}

/// Why a detection was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ObservationRejection {
    /// The robot's survey does not know this id.
    UnknownTag,
    /// The corners are not those of a square seen from its front.
    NotASquare,
    /// A corner has no bearing in the lens model.
    OutOfView,
    /// The mark's span holds no joint readings.
    NoReadings,
    /// In some frame of a view a tag lies elsewhere than in most: one of them is another tag, misread.
    InconsistentFrame,
    /// The arm was on its way.
    ArmMoving,
    /// It does not agree with what all other sightings say.
    Outlier,
    /// The detector itself did not believe it.
    Detector(RejectReason),
}

impl ObservationRejection {
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::UnknownTag => "unknown_tag",
            Self::NotASquare => "not_a_square",
            Self::OutOfView => "out_of_view",
            Self::NoReadings => "no_joint_readings",
            Self::InconsistentFrame => "inconsistent_frame",
            Self::Outlier => "outlier",
            Self::ArmMoving => "arm_moving",
            Self::Detector(reason) => reason.name(),
        }
    }
}

/// All that calibration takes from a recording.
#[derive(Clone, Debug, Default)]
pub struct CaptureData {
    pub fit: Vec<View>,
    pub held_out: Vec<View>,
    /// Views in which only one joint moved, by that joint; in the order of time.
    pub identify: BTreeMap<u32, Vec<View>>,
    /// Readings at nominal end stops, in the order of time.
    pub stops: Vec<(Stamp, EndStopReading)>,
    pub task: Option<ReachTask>,
    pub n_marks: usize,
    pub rejected: BTreeMap<ObservationRejection, usize>,
    pub ids_seen: Vec<u32>,
    /// Names of landmarks that are no numbered tags, by the number that stands for them.
    pub landmark_names: BTreeMap<u32, String>,
    /// Lowest and highest reading over the captured spans, C.
    pub oil_c: Option<(f64, f64)>,
    pub water_c: Option<(f64, f64)>,
    pub pressure_pa: Option<(f64, f64)>,
    /// Indices of the recording's messages that were used, ascending.
    pub used: Vec<usize>,
    /// Those beyond them that only sensors with terms rest on: thermometers near the views, readings before them. Ascending.
    pub used_for_terms: Vec<usize>,
}

impl CaptureData {
    /// How many were rejected under each name; what the detector and the estimator reject alike has one.
    #[must_use]
    pub fn rejected_by_reason(&self) -> BTreeMap<String, usize> {
        let mut counts = BTreeMap::new();
        for (why, n) in &self.rejected {
            *counts.entry(why.name().to_owned()).or_default() += n;
        }
        counts
    }
}

/// Corners that fit a square worse than this are no tag: three times the worst that the lens prior allows.
const MAX_SQUARE_RMS_PX: f64 = 3.0;

/// The survey that a recording carries, and its index among the messages; the earliest, should there be several.
fn recorded_survey(recording: &Recording) -> Option<(usize, &RecordedSurvey)> {
    let surveys = recording.messages.iter().enumerate().filter_map(|(idx, (_, message))| match message {
        Message::Survey(survey) => Some((idx, survey)),
        _ => None,
    });
    surveys.min_by_key(|(_, survey)| survey.stamp)
}

/// `robot` with the tags that the recording says were around it; with those of its own file where it says nothing.
#[must_use]
pub fn surveyed<'a>(recording: &Recording, robot: &'a Robot) -> Cow<'a, Robot> {
    match recorded_survey(recording) {
        Some((_, recorded)) => Cow::Owned(robot.clone().with_survey(recorded.survey())),
        None => Cow::Borrowed(robot),
    }
}

/// `robot` of which the joints have failed that the recording says have.
#[must_use]
pub(crate) fn declared_failed(recording: &Recording, robot: &Robot) -> Robot {
    let failed: Vec<FailedJoint> = recording
        .messages
        .iter()
        .filter_map(|(_, message)| match message {
            Message::Mark(Mark { kind: MarkKind::Failed(failed), .. }) => Some(*failed),
            _ => None,
        })
        .filter(|failed| failed.joint < robot.n_joints())
        .collect();
    robot.clone().with_failed(&failed)
}

/// Collects the captured views of `recording`; `robot` as [`surveyed`] gives it.
#[must_use]
pub fn associate(recording: &Recording, robot: &Robot) -> CaptureData {
    associate_within(recording, robot, None)
}

/// Collects the views that were captured within a span by the joint sensors' clock; `None` is the whole recording.
///
/// Views of `identify` marks count wherever they lie before the span's end: what they tell of a sensor stays true.
#[must_use]
pub fn associate_within(recording: &Recording, robot: &Robot, span: Option<(Stamp, Stamp)>) -> CaptureData {
    let mut data = CaptureData::default();
    let sensors = ArmSensors::nominal(robot);
    let index = Index::new(recording);
    let (from, to) = span.unwrap_or((Stamp { nanos: i64::MIN }, Stamp { nanos: i64::MAX }));
    let surroundings = ConditionHistory::heard_until(recording, to);
    let recorded = recorded_survey(recording);
    for (idx, message) in recording.messages.iter().map(|(_, m)| m).enumerate() {
        match message {
            Message::Task(task) if data.task.is_none() => {
                data.task = Some(task.clone());
                data.used.push(idx);
            }
            Message::Survey(_) if recorded.is_some_and(|(at, _)| at == idx) => data.used.push(idx),
            Message::Mark(mark) if mark.end <= to => match mark.kind {
                MarkKind::Capture { set, pose_idx } if mark.start >= from => {
                    data.n_marks += 1;
                    data.used.push(idx);
                    let Some(mut view) = index.view(mark, pose_idx, robot, &sensors, &mut data) else { continue };
                    view.conditions = surroundings.over_noting(mark.start, mark.end, &mut data.used_for_terms);
                    view.approach = index.approach(mark, &view.travel_rad, &sensors, &mut data.used_for_terms);
                    match set {
                        CaptureSet::Fit => data.fit.push(view),
                        CaptureSet::HeldOut => data.held_out.push(view),
                    }
                }
                MarkKind::Failed(_) => data.used.push(idx),
                MarkKind::Identify { joint_idx } => {
                    data.used.push(idx);
                    if let Some(view) = index.view(mark, 0, robot, &sensors, &mut data) {
                        data.identify.entry(joint_idx).or_default().push(view);
                    }
                }
                MarkKind::Stop { joint_idx, angle_rad } if mark.start >= from => {
                    data.used.push(idx);
                    let joint = joint_idx as usize;
                    if let Some(view) = index.view(mark, 0, robot, &sensors, &mut data)
                        && let Some(&travel_rad) = view.travel_rad.get(joint)
                    {
                        data.stops.push((mark.end, EndStopReading { joint, angle_rad, travel_rad }));
                    }
                }
                _ => {}
            },
            _ => {}
        }
    }
    data.stops.sort_by_key(|(end, _)| *end);
    // A view's meaning does not depend on when it was marked; sorting makes the result independent of that order, too.
    data.fit.sort_by_key(|view| view.pose_idx);
    data.held_out.sort_by_key(|view| view.pose_idx);
    for views in data.identify.values_mut() {
        views.sort_by_key(|view| view.end);
    }
    data.used.sort_unstable();
    data.used.dedup();
    data.used_for_terms.sort_unstable();
    data.used_for_terms.dedup();
    data.used_for_terms.retain(|idx| data.used.binary_search(idx).is_err());
    data.ids_seen.sort_unstable();
    data.ids_seen.dedup();
    data
}

/// Messages of a recording sorted by their own stamps.
pub(crate) struct Index<'a> {
    pub(crate) messages: &'a [(Stamp, Message)],
    pub(crate) by_stamp: Vec<(Stamp, usize)>,
}

impl<'a> Index<'a> {
    fn new(recording: &'a Recording) -> Self {
        let mut by_stamp: Vec<(Stamp, usize)> = recording
            .messages
            .iter()
            .enumerate()
            .filter_map(|(idx, (_, message))| {
                let stamp = match message {
                    Message::JointSensors(sample) => sample.stamp,
                    Message::Detections(detections) => detections.stamp,
                    Message::Rejects(rejects) => rejects.stamp,
                    Message::Temperature(sample) => sample.stamp,
                    Message::Pressure(sample) => sample.stamp,
                    _ => return None,
                };
                Some((stamp, idx))
            })
            .collect();
        by_stamp.sort_unstable();
        Self { messages: &recording.messages, by_stamp }
    }

    fn span(&self, mark: &Mark) -> &[(Stamp, usize)] {
        let from = self.by_stamp.partition_point(|(stamp, _)| *stamp < mark.start);
        let to = self.by_stamp.partition_point(|(stamp, _)| *stamp <= mark.end);
        &self.by_stamp[from..to.max(from)]
    }

    fn view(
        &self,
        mark: &Mark,
        pose_idx: u32,
        robot: &Robot,
        sensors: &ArmSensors,
        data: &mut CaptureData,
    ) -> Option<View> {
        let mut travel_sum = JointAngles::zeros(robot.n_joints());
        let mut n_readings = 0usize;
        let mut slope = TravelRate::over(mark);
        let mut frames: BTreeMap<u32, Vec<[[f64; 2]; 4]>> = BTreeMap::new();
        for &(_, idx) in self.span(mark) {
            match &self.messages[idx].1 {
                Message::JointSensors(sample) => {
                    let travel_rad = sensors.travel_rad(&sample.counts);
                    for (sum, travel_rad) in travel_sum.iter_mut().zip(travel_rad.iter()) {
                        *sum += travel_rad;
                    }
                    slope.add(sample.stamp, &travel_rad, sensors);
                    n_readings += 1;
                }
                Message::Detections(detections) => add_corners(detections, &mut frames),
                Message::Rejects(rejects) => {
                    for reject in &rejects.rejects {
                        *data.rejected.entry(ObservationRejection::Detector(reject.reason)).or_default() += 1;
                    }
                }
                Message::Temperature(sample) => {
                    let range = match sample.thermometer {
                        Thermometer::Oil => &mut data.oil_c,
                        Thermometer::Water => &mut data.water_c,
                    };
                    widen(range, sample.temperature_c);
                }
                Message::Pressure(sample) => widen(&mut data.pressure_pa, sample.pressure_pa),
                _ => continue,
            }
            data.used.push(idx);
        }
        if n_readings == 0 {
            *data.rejected.entry(ObservationRejection::NoReadings).or_default() += frames.len().max(1);
            return None;
        }
        let travel_rad = JointAngles::from_fn(robot.n_joints(), |j| travel_sum[j] / n_readings as f64);
        let rate_rad_s = slope.rad_s(robot.n_joints());
        let mut view = View { n_readings, rate_rad_s, ..View::of_reading(pose_idx, mark.end, travel_rad) };
        for (id, frames) in frames {
            data.ids_seen.push(id);
            let (seen, n_apart) = agreeing_mean(&frames, robot.camera.corner_std_px);
            if n_apart > 0 {
                *data.rejected.entry(ObservationRejection::InconsistentFrame).or_default() += n_apart;
            }
            let Some(seen) = seen else { continue };
            let taken = match &robot.gripper_tag {
                Some(tag) if tag.id == id => {
                    check_square(robot, tag.size_m, &seen).map(|_| view.gripper_tag = Some(seen))
                }
                _ => tag_view(robot, id, &seen).map(|tag| view.tags.push(tag)),
            };
            if let Err(rejection) = taken {
                *data.rejected.entry(rejection).or_default() += 1;
            }
        }
        Some(view)
    }
}

fn add_corners(detections: &TagDetections, frames: &mut BTreeMap<u32, Vec<[[f64; 2]; 4]>>) {
    for tag in &detections.tags {
        frames.entry(tag.id).or_default().push(tag.corners_px);
    }
}

fn tag_view(robot: &Robot, id: u32, seen: &MeanCorners) -> Result<TagObservation, ObservationRejection> {
    let tag_idx = robot.tags.iter().position(|tag| tag.id == id).ok_or(ObservationRejection::UnknownTag)?;
    let solved = check_square(robot, robot.tags[tag_idx].size_m, seen)?;
    let center_in_camera_m = solved.camera_from_tag.origin().vector();
    Ok(TagObservation { id, tag_idx, center_in_camera_m, measured: TagMeasurement::Corners(*seen) })
}

/// The tag's pose by its corners, if they are those of a square of that size.
pub(crate) fn check_square(robot: &Robot, size_m: f64, seen: &MeanCorners) -> Result<SquarePose, ObservationRejection> {
    let solved = solve_square(&robot.camera.lens, size_m, &seen.corners_px).map_err(|e| match e {
        SquareError::OutOfView => ObservationRejection::OutOfView,
        SquareError::Degenerate => ObservationRejection::NotASquare,
    })?;
    if solved.rms_px > MAX_SQUARE_RMS_PX { Err(ObservationRejection::NotASquare) } else { Ok(solved) }
}

fn widen(range: &mut Option<(f64, f64)>, value: f64) {
    let (low, high) = range.unwrap_or((value, value));
    *range = Some((low.min(value), high.max(value)));
}

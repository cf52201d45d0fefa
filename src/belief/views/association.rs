//! Conversion of messages to views: the readings and corners of one arm at rest.
//!
//! A capture mark gives the span by the joint sensors' clock. Readings in it are averaged as travel (never as raw
//! words, which wrap), and the corners of one tag over its frames. The arm is at rest there, so that a camera clock
//! late by about 10 ms changes nothing.

pub(crate) use crate::views::constants::association::MAX_SQUARE_RMS_PX;
use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::views::conditions::{ConditionHistory, TravelRate};
use crate::views::dropouts::replace_dropouts;
use crate::views::frame_consensus::agreeing_mean;
use crate::views::message_index::MessageIndex;
use crate::views::view::{
    CaptureData, EndStopReading, MeanCorners, ObservationRejection, TagMeasurement, TagObservation, Touch, View,
};
use armcal_core::log::Recording;
use armcal_core::optics::{SquareError, SquarePose, solve_square};
use armcal_core::robot::{CameraSpec, FailedJoint, Robot};
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{
    CaptureSet, JointAngles, Mark, MarkKind, Message, PriorSource, RecordedSurvey, TagDetections, Thermometer,
    ToolTouch,
};
use armcal_core::time::Stamp;

/// Returns the survey in a recording, and its index among the messages; the earliest if there are several.
fn recorded_survey(recording: &Recording) -> Option<(usize, &RecordedSurvey)> {
    let surveys = recording.messages.iter().enumerate().filter_map(|(idx, (_, message))| match message {
        Message::Survey(survey) => Some((idx, survey)),
        _ => None,
    });
    surveys.min_by_key(|(_, survey)| survey.stamp)
}

/// Returns `robot` with the tags that the recording states; with those of its own file if the recording states none.
#[must_use]
pub fn surveyed<'a>(recording: &Recording, robot: &'a Robot) -> Cow<'a, Robot> {
    match recorded_survey(recording) {
        Some((_, recorded)) => Cow::Owned(robot.clone().with_survey(recorded.survey(robot))),
        None => Cow::Borrowed(robot),
    }
}

/// Returns `robot` with the joints marked as failed that the recording declares by the end of `span`; `None` means all
/// of it.
#[must_use]
pub(crate) fn declared_failed(recording: &Recording, robot: &Robot, span: Option<(Stamp, Stamp)>) -> Robot {
    let failed: Vec<FailedJoint> = recording
        .messages
        .iter()
        .filter_map(|(_, message)| match message {
            Message::Mark(Mark { end, kind: MarkKind::Failed(failed), .. }) => {
                span.is_none_or(|(_, to)| *end <= to).then_some(*failed)
            }
            _ => None,
        })
        .filter(|failed| failed.joint < robot.n_joints())
        .collect();
    robot.clone().with_failed(&failed)
}

/// Collects the captured views of `recording`; `robot` is as [`surveyed`] returns it.
#[must_use]
pub fn associate(recording: &Recording, robot: &Robot) -> CaptureData {
    associate_within(recording, robot, None)
}

/// Collects the views captured within a span by the joint sensors' clock; `None` means the whole recording.
///
/// Views of `identify` marks count anywhere before the span's end, because a sensor's scale does not change.
#[must_use]
pub fn associate_within(recording: &Recording, robot: &Robot, span: Option<(Stamp, Stamp)>) -> CaptureData {
    let (from, to) = span.unwrap_or((Stamp { nanos: i64::MIN }, Stamp { nanos: i64::MAX }));
    let mut association = Association {
        robot,
        sensors: ArmSensors::nominal(robot),
        index: MessageIndex::heard_until(&recording.messages, to),
        conditions: ConditionHistory::heard_until(recording, to),
        from,
        data: CaptureData::default(),
        rested: BTreeMap::new(),
    };
    let recorded = recorded_survey(recording);
    for (idx, message) in recording.messages.iter().map(|(_, m)| m).enumerate() {
        match message {
            Message::Task(task) if association.data.task.is_none() => {
                association.data.task = Some(task.clone());
                association.data.used.push(idx);
            }
            Message::Survey(_) if recorded.is_some_and(|(at, _)| at == idx) => association.data.used.push(idx),
            Message::Touch(touch) if touch.stamp.plus_s(touch.duration_s) <= to => association.add_touch(idx, touch),
            Message::Mark(mark) if mark.end <= to => association.add_mark(idx, mark),
            _ => {}
        }
    }
    association.data.sort();
    association.data
}

/// Returns the view of the span `start ..= end` among `messages`, which also contain earlier readings. `None` if the
/// span has no joint readings.
pub(crate) fn view_of_span(
    messages: &[(Stamp, Message)],
    robot: &Robot,
    pose_idx: u32,
    (start, end): (Stamp, Stamp),
) -> Option<View> {
    let conditions = ConditionHistory::of_messages(messages, Stamp { nanos: i64::MAX });
    let mut association = Association {
        robot,
        sensors: ArmSensors::nominal(robot),
        index: MessageIndex::heard_until(messages, Stamp { nanos: i64::MAX }),
        conditions,
        from: start,
        data: CaptureData::default(),
        rested: BTreeMap::new(),
    };
    let mark = Mark { start, end, kind: MarkKind::Capture { set: CaptureSet::Fit, pose_idx } };
    association.add_mark(0, &mark);
    association.data.fit.pop()
}

/// State while the views of a recording are collected.
struct Association<'a> {
    robot: &'a Robot,
    sensors: ArmSensors,
    index: MessageIndex<'a>,
    conditions: ConditionHistory,
    from: Stamp,
    data: CaptureData,
    /// End of the last rest at each target.
    rested: BTreeMap<u32, Stamp>,
}

impl Association<'_> {
    fn add_mark(&mut self, idx: usize, mark: &Mark) {
        match mark.kind {
            MarkKind::Capture { set, pose_idx } if mark.start >= self.from => {
                self.data.n_marks += 1;
                self.data.used.push(idx);
                let Some(mut view) = self.view(mark, pose_idx) else { return };
                let used = &mut self.data.used_for_terms;
                view.conditions = self.conditions.over_noting(mark.start, mark.end, used);
                view.approach = self.index.approach(mark, &view.travel_rad, &self.sensors, used);
                match set {
                    CaptureSet::Fit => self.data.fit.push(view),
                    CaptureSet::HeldOut => self.data.held_out.push(view),
                }
            }
            MarkKind::Failed(_) => self.data.used.push(idx),
            MarkKind::Reach { target_idx, .. } => self.add_rest(idx, mark, target_idx),
            MarkKind::Identify { joint_idx } => {
                self.data.used.push(idx);
                if let Some(view) = self.view(mark, 0) {
                    self.data.identify.entry(joint_idx).or_default().push(view);
                }
            }
            MarkKind::Stop { joint_idx, angle_rad } if mark.start >= self.from => {
                self.data.used.push(idx);
                let joint = joint_idx as usize;
                if let Some(view) = self.view(mark, 0)
                    && let Some(&travel_rad) = view.travel_rad.get(joint)
                {
                    self.data.stops.push((mark.end, EndStopReading { joint, angle_rad, travel_rad }));
                }
            }
            _ => {}
        }
    }

    /// Notes where the arm rested at a target: the last of several rests, regardless of the calibration that it
    /// followed.
    fn add_rest(&mut self, idx: usize, mark: &Mark, target_idx: u32) {
        if self.rested.get(&target_idx).is_some_and(|last| *last > mark.end) {
            return;
        }
        let readings = self.index.span(mark).iter().filter_map(|&(_, idx)| match &self.index.messages[idx].1 {
            Message::JointSensors(sample) => Some((idx, self.sensors.angles(&sample.counts))),
            _ => None,
        });
        let (read, mut angles): (Vec<usize>, Vec<JointAngles>) = readings.unzip();
        replace_dropouts(&mut angles);
        if angles.is_empty() {
            return;
        }
        let mean = |j: usize| angles.iter().map(|angles| angles[j]).sum::<f64>() / angles.len() as f64;
        self.data.rests.insert(target_idx, JointAngles::from_fn(self.robot.n_joints(), mean));
        self.rested.insert(target_idx, mark.end);
        self.data.used.push(idx);
        self.data.used.extend(read);
    }

    fn add_touch(&mut self, idx: usize, touch: &ToolTouch) {
        if touch.stamp < self.from {
            return;
        }
        self.data.used.push(idx);
        let (start, end) = (touch.stamp, touch.stamp.plus_s(touch.duration_s));
        // Neither phase nor kind is used.
        let span = Mark { start, end, kind: MarkKind::Calibrate(PriorSource::Fresh) };
        let Some(mut view) = self.view(&span, 0) else { return };
        view.tags.clear();
        let used = &mut self.data.used_for_terms;
        view.conditions = self.conditions.over_noting(start, end, used);
        view.approach = self.index.approach(&span, &view.travel_rad, &self.sensors, used);
        self.data.touches.push(Touch {
            surface: touch.surface.clone(),
            point_m: touch.point_m.into(),
            normal: Vector3::from(touch.normal).normalize(),
            tip_radius_m: touch.tip_radius_m,
            std_m: touch.std_m,
            view,
        });
    }

    /// Returns the view of a mark's span; `None` if no joint was read in it.
    fn view(&mut self, mark: &Mark, pose_idx: u32) -> Option<View> {
        let n_joints = self.robot.n_joints();
        let (mut stamps, mut readings) = (Vec::new(), Vec::new());
        let mut frames: BTreeMap<u32, Vec<[[f64; 2]; 4]>> = BTreeMap::new();
        let (index, data) = (&self.index, &mut self.data);
        for &(_, idx) in index.span(mark) {
            match &index.messages[idx].1 {
                Message::JointSensors(sample) => {
                    stamps.push(sample.stamp);
                    readings.push(self.sensors.travel_rad(&sample.counts));
                }
                Message::Detections(detections) => add_corners(detections, &mut frames),
                Message::Rejects(rejects) => {
                    for reject in &rejects.rejects {
                        data.reject(ObservationRejection::Detector(reject.reason), 1);
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
        let n_readings = readings.len();
        if n_readings == 0 {
            data.reject(ObservationRejection::NoReadings, frames.len().max(1));
            return None;
        }
        replace_dropouts(&mut readings);
        let mean = |j: usize| readings.iter().map(|travel_rad| travel_rad[j]).sum::<f64>() / n_readings as f64;
        let travel_rad = JointAngles::from_fn(n_joints, mean);
        let mut rate = TravelRate::over(mark);
        stamps.iter().zip(&readings).for_each(|(stamp, travel_rad)| rate.add(*stamp, travel_rad, &self.sensors));
        let rate_rad_s = rate.rad_s(n_joints);
        let mut view = View { n_readings, rate_rad_s, ..View::of_reading(pose_idx, mark.end, travel_rad) };
        for (id, frames) in frames {
            self.add_observation(&mut view, id, &frames);
        }
        Some(view)
    }

    /// Adds the tag `id`, whose corners were detected in `frames`.
    fn add_observation(&mut self, view: &mut View, id: u32, frames: &[[[f64; 2]; 4]]) {
        let (robot, data) = (self.robot, &mut self.data);
        data.ids_seen.push(id);
        let (corners, n_apart) = agreeing_mean(frames, robot.camera.corner_std_px);
        if n_apart > 0 {
            data.reject(ObservationRejection::InconsistentFrame, n_apart);
        }
        let Some(corners) = corners else { return };
        data.note_corners(&corners.corners_px);
        let added = match &robot.gripper_tag {
            Some(tag) if tag.id == id => {
                check_square(&robot.camera, tag.size_m, &corners).map(|_| view.gripper_tag = Some(corners))
            }
            _ => tag_observation(robot, id, &corners).map(|tag| view.tags.push(tag)),
        };
        if let Err(rejection) = added {
            data.reject(rejection, 1);
        }
    }
}

fn add_corners(detections: &TagDetections, frames: &mut BTreeMap<u32, Vec<[[f64; 2]; 4]>>) {
    for tag in &detections.tags {
        frames.entry(tag.id).or_default().push(tag.corners_px);
    }
}

fn tag_observation(robot: &Robot, id: u32, seen: &MeanCorners) -> Result<TagObservation, ObservationRejection> {
    let tag_idx = robot.tags.iter().position(|tag| tag.id == id).ok_or(ObservationRejection::UnknownTag)?;
    let solved = check_square(&robot.camera, robot.tags[tag_idx].size_m, seen)?;
    let center_in_camera_m = solved.camera_from_tag.origin().vector();
    Ok(TagObservation { id, tag_idx, center_in_camera_m, measured: TagMeasurement::Corners(*seen) })
}

/// Returns the tag's pose if its corners are those of a square of that size. Checks their order first, because a wrong
/// order would also fit a square seen from its edge.
pub(crate) fn check_square(
    camera: &CameraSpec,
    size_m: f64,
    seen: &MeanCorners,
) -> Result<SquarePose, ObservationRejection> {
    if turns_right(&seen.corners_px) {
        return Err(ObservationRejection::CornerOrder);
    }
    let solved = solve_square(&camera.lens, size_m, &seen.corners_px).map_err(|e| match e {
        SquareError::OutOfView => ObservationRejection::OutOfView,
        SquareError::Degenerate => ObservationRejection::NotASquare,
    })?;
    if solved.rms_px > MAX_SQUARE_RMS_PX { Err(ObservationRejection::NotASquare) } else { Ok(solved) }
}

/// Returns true if the corners turn right. Seen from the front, they run counterclockwise with v downwards: each turn
/// from side to side is to the left.
pub(crate) fn turns_right(corners_px: &[[f64; 2]; 4]) -> bool {
    let side = |k: usize| [0, 1].map(|axis| corners_px[(k + 1) % 4][axis] - corners_px[k % 4][axis]);
    let turns = [0, 1, 2, 3].map(|k| {
        let ([u, v], [to_u, to_v]) = (side(k), side(k + 1));
        u * to_v - v * to_u
    });
    turns.iter().filter(|turn| **turn > 0.0).count() >= 2
}

fn widen(range: &mut Option<(f64, f64)>, value: f64) {
    let (low, high) = range.unwrap_or((value, value));
    *range = Some((low.min(value), high.max(value)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_that_run_the_other_way_round_or_cross_are_told_from_other_shapes() {
        let square = [[10.0, 30.0], [30.0, 30.0], [30.0, 10.0], [10.0, 10.0]];
        let in_order = |order: [usize; 4]| turns_right(&order.map(|k| square[k]));
        for order in [[3, 2, 1, 0], [0, 3, 2, 1], [3, 2, 0, 1], [0, 2, 1, 3]] {
            assert!(in_order(order), "{order:?}");
        }
        assert!(!in_order([1, 2, 3, 0]));
        let dented = [[10.0, 30.0], [30.0, 30.0], [14.0, 26.0], [10.0, 10.0]];
        assert!(!turns_right(&dented));
    }
}

//! From the bytes of ROS messages to messages, or to the reason why not.

use std::collections::BTreeSet;

use serde::Deserialize;

use super::cdr;
use super::error::DecodeRejection;
use super::ros::{self, Time};
use super::topics::Stream;
use crate::robot::{FailedJoint, FailedKind};
use crate::streams::{
    Attitude, CameraImage, CaptureSet, DetectionReject, DetectionRejects, GripperCommand, GripperSample, JointAngles,
    JointCommand, JointCounts, JointSensorSample, JointStateBelief, LogLevel, LogLine, MAX_JOINTS, Mark, MarkKind,
    Message, Phase, PressureSample, PriorSource, ReachAttempt, ReachTask, RecordedSurvey, RecordedTag, RejectReason,
    TagDetection, TagDetections, TemperatureSample, Thermometer,
};
use crate::time::Stamp;

/// How far a quaternion's length may be from 1. Float32 senders are within 1e-6; a zero quaternion is far off.
const QUATERNION_LENGTH_TOLERANCE: f64 = 0.01;

/// Names that a topic's joint messages began with; `None` before the first.
pub(super) type FirstNames = Option<Vec<String>>;

/// `sensor_msgs/msg/JointState` that borrows its texts from the file's bytes.
#[derive(Deserialize)]
struct JointStateView<'a> {
    stamp: Time,
    #[serde(borrow)]
    _frame_id: &'a str,
    #[serde(borrow)]
    name: Vec<&'a str>,
    position: Vec<f64>,
    _velocity: Vec<f64>,
    _effort: Vec<f64>,
}

/// Decodes and checks one message of `stream`. Every number that it gives back is finite.
///
/// # Errors
/// [`Rejection`], whatever the bytes are.
pub(super) fn decode_message(stream: Stream, bytes: &[u8], names: &mut FirstNames) -> Result<Message, DecodeRejection> {
    Ok(match stream {
        Stream::JointSensors => {
            let joints = joints(bytes, names)?;
            let counts = JointCounts::from_slice(&joints.position);
            Message::JointSensors(JointSensorSample { stamp: joints.stamp.try_into()?, counts })
        }
        Stream::JointCommands => {
            let joints = joints(bytes, names)?;
            let counts = JointCounts::from_slice(&joints.position);
            Message::JointCommand(JointCommand { stamp: joints.stamp.try_into()?, counts })
        }
        Stream::JointStates => {
            let joints = joints(bytes, names)?;
            let angles = JointAngles::from_slice(&joints.position);
            Message::JointStates(JointStateBelief { stamp: joints.stamp.try_into()?, angles })
        }
        Stream::Detections => Message::Detections(detections(&cdr::decode(bytes)?)?),
        Stream::Rejects => Message::Rejects(rejects(&cdr::decode(bytes)?)?),
        Stream::Images => Message::Image(image(cdr::decode(bytes)?)?),
        Stream::OilTemperature => Message::Temperature(temperature(&cdr::decode(bytes)?, Thermometer::Oil)?),
        Stream::WaterTemperature => Message::Temperature(temperature(&cdr::decode(bytes)?, Thermometer::Water)?),
        Stream::DepthPressure => Message::Pressure(pressure(&cdr::decode(bytes)?)?),
        Stream::VehicleImu => Message::Attitude(attitude(&cdr::decode(bytes)?)?),
        Stream::GripperState => {
            let (stamp, opening_m) = gripper(&cdr::decode(bytes)?)?;
            Message::Gripper(GripperSample { stamp, opening_m })
        }
        Stream::GripperCommand => {
            let (stamp, opening_m) = gripper(&cdr::decode(bytes)?)?;
            Message::GripperCommand(GripperCommand { stamp, opening_m })
        }
        Stream::Task => Message::Task(task(&cdr::decode(bytes)?)?),
        Stream::TagSurvey => Message::Survey(survey(&cdr::decode(bytes)?)?),
        Stream::Marks => Message::Mark(mark(&cdr::decode(bytes)?)?),
        Stream::Log => Message::Log(log_line(cdr::decode(bytes)?)?),
    })
}

fn finite(field: &'static str, values: impl IntoIterator<Item = f64>) -> Result<(), DecodeRejection> {
    if values.into_iter().all(f64::is_finite) { Ok(()) } else { Err(DecodeRejection::NotFinite { field }) }
}

fn joints<'a>(bytes: &'a [u8], names: &mut FirstNames) -> Result<JointStateView<'a>, DecodeRejection> {
    let joints: JointStateView<'a> = cdr::decode(bytes)?;
    let n = joints.position.len();
    if n > MAX_JOINTS {
        return Err(DecodeRejection::TooManyJoints { got: n });
    }
    if n == 0 {
        return Err(DecodeRejection::NoJoints);
    }
    if let Some(first) = names.as_ref().filter(|first| first.len() != n) {
        return Err(DecodeRejection::JointCount { got: n, expected: first.len() });
    }
    if joints.name.len() != n {
        return Err(DecodeRejection::NameCount { names: joints.name.len(), positions: n });
    }
    if names.as_ref().is_some_and(|first| *first != joints.name) {
        return Err(DecodeRejection::NamesChanged);
    }
    finite("position", joints.position.iter().copied())?;
    names.get_or_insert_with(|| joints.name.iter().map(|name| (*name).to_owned()).collect());
    Ok(joints)
}

fn detections(m: &ros::AprilTagDetectionArray) -> Result<TagDetections, DecodeRejection> {
    let tags = m.detections.iter().map(detection).collect::<Result<_, _>>()?;
    Ok(TagDetections { stamp: m.header.stamp.try_into()?, tags })
}

fn detection(tag: &ros::AprilTagDetection) -> Result<TagDetection, DecodeRejection> {
    let corners_px = tag.corners.map(|corner| [corner.x, corner.y]);
    finite("corners", corners_px.into_iter().flatten())?;
    finite("decision_margin", [f64::from(tag.decision_margin)])?;
    Ok(TagDetection {
        id: u32::try_from(tag.id).map_err(|_| DecodeRejection::NegativeTagId)?,
        corners_px,
        decision_margin: f64::from(tag.decision_margin),
    })
}

fn rejects(m: &ros::DetectionRejects) -> Result<DetectionRejects, DecodeRejection> {
    let reject = |r: &ros::DetectionReject| -> Result<DetectionReject, DecodeRejection> {
        let corners_px = r.corners.map(|corner| [corner.x, corner.y]);
        finite("corners", corners_px.into_iter().flatten())?;
        let reason = RejectReason::ALL.into_iter().find(|reason| reason.name() == r.reason);
        Ok(DetectionReject { id: r.id, corners_px, reason: reason.ok_or(DecodeRejection::UnknownReason)? })
    };
    let rejects = m.rejects.iter().map(reject).collect::<Result<_, _>>()?;
    Ok(DetectionRejects { stamp: m.header.stamp.try_into()?, rejects })
}

fn image(m: ros::CompressedImage) -> Result<CameraImage, DecodeRejection> {
    if m.format != "jpeg" && !m.format.contains("jpeg") {
        return Err(DecodeRejection::ImageFormat);
    }
    Ok(CameraImage { stamp: m.header.stamp.try_into()?, jpeg: m.data })
}

fn variance(value: f64) -> Result<f64, DecodeRejection> {
    finite("variance", [value])?;
    if value < 0.0 { Err(DecodeRejection::NegativeVariance) } else { Ok(value) }
}

fn temperature(m: &ros::Temperature, thermometer: Thermometer) -> Result<TemperatureSample, DecodeRejection> {
    finite("temperature", [m.temperature])?;
    Ok(TemperatureSample {
        stamp: m.header.stamp.try_into()?,
        thermometer,
        temperature_c: m.temperature,
        variance_c2: variance(m.variance)?,
    })
}

fn pressure(m: &ros::FluidPressure) -> Result<PressureSample, DecodeRejection> {
    finite("fluid_pressure", [m.fluid_pressure])?;
    Ok(PressureSample {
        stamp: m.header.stamp.try_into()?,
        pressure_pa: m.fluid_pressure,
        variance_pa2: variance(m.variance)?,
    })
}

fn orientation(quaternion: &ros::Quaternion) -> Result<[f64; 4], DecodeRejection> {
    let wxyz = quaternion.wxyz();
    finite("orientation", wxyz)?;
    let length = wxyz.iter().map(|c| c * c).sum::<f64>().sqrt();
    if (length - 1.0).abs() > QUATERNION_LENGTH_TOLERANCE {
        return Err(DecodeRejection::QuaternionLength);
    }
    Ok(wxyz)
}

fn attitude(m: &ros::Imu) -> Result<Attitude, DecodeRejection> {
    if m.orientation_covariance[0] < 0.0 {
        return Err(DecodeRejection::NoOrientation);
    }
    let quaternion_wxyz = orientation(&m.orientation)?;
    let angular_velocity_rad_s = m.angular_velocity.into();
    let specific_force_m_s2 = m.linear_acceleration.into();
    finite("angular_velocity", angular_velocity_rad_s)?;
    finite("linear_acceleration", specific_force_m_s2)?;
    let stamp = m.header.stamp.try_into()?;
    Ok(Attitude { stamp, quaternion_wxyz, angular_velocity_rad_s, specific_force_m_s2 })
}

/// One joint by any name: its position is the gap between the jaws, m.
fn gripper(m: &ros::JointState) -> Result<(Stamp, f64), DecodeRejection> {
    let [opening_m] = m.position[..] else {
        return Err(DecodeRejection::JointCount { got: m.position.len(), expected: 1 });
    };
    finite("position", [opening_m])?;
    Ok((m.header.stamp.try_into()?, opening_m))
}

fn task(m: &ros::ReachTask) -> Result<ReachTask, DecodeRejection> {
    let targets_m: Vec<[f64; 3]> = m.targets.iter().copied().map(Into::into).collect();
    finite("targets", targets_m.iter().flatten().copied())?;
    finite("tolerance_m", [m.tolerance_m])?;
    if m.tolerance_m <= 0.0 {
        return Err(DecodeRejection::Tolerance);
    }
    Ok(ReachTask { stamp: m.header.stamp.try_into()?, targets_m, tolerance_m: m.tolerance_m })
}

/// A survey is used whole or not at all: one tag at a wrong place would spoil the rest.
fn survey(m: &ros::TagSurvey) -> Result<RecordedSurvey, DecodeRejection> {
    let tags = m.tags.iter().map(surveyed_tag).collect::<Result<Vec<_>, _>>()?;
    let ids: BTreeSet<u32> = tags.iter().map(|tag| tag.id).collect();
    if ids.len() != tags.len() {
        return Err(DecodeRejection::TagTwice);
    }
    if !ids.contains(&m.base_tag) {
        return Err(DecodeRejection::NoBaseTag);
    }
    Ok(RecordedSurvey { stamp: m.header.stamp.try_into()?, base_tag: m.base_tag, tags })
}

fn surveyed_tag(tag: &ros::SurveyedTag) -> Result<RecordedTag, DecodeRejection> {
    let position_m = tag.pose.position.into();
    finite("position", position_m)?;
    finite("size_m", [tag.size_m])?;
    // Infinite where nothing is known of the tag's place.
    let is_unknown = tag.position_std_m == f64::INFINITY && tag.rotation_std_rad == f64::INFINITY;
    if !is_unknown {
        finite("standard deviation", [tag.position_std_m, tag.rotation_std_rad])?;
    }
    if tag.size_m <= 0.0 {
        return Err(DecodeRejection::TagSize);
    }
    if tag.position_std_m < 0.0 || tag.rotation_std_rad < 0.0 {
        return Err(DecodeRejection::NegativeVariance);
    }
    Ok(RecordedTag {
        id: tag.id,
        size_m: tag.size_m,
        position_m,
        quaternion_wxyz: orientation(&tag.pose.orientation)?,
        position_std_m: tag.position_std_m,
        rotation_std_rad: tag.rotation_std_rad,
    })
}

fn mark(m: &ros::Mark) -> Result<Mark, DecodeRejection> {
    let kind = match m.kind.as_str() {
        "capture_fit" => MarkKind::Capture { set: CaptureSet::Fit, pose_idx: m.index },
        "capture_held_out" => MarkKind::Capture { set: CaptureSet::HeldOut, pose_idx: m.index },
        "identify" => MarkKind::Identify { joint_idx: m.index },
        "calibrate" => MarkKind::Calibrate(PriorSource::Fresh),
        "recalibrate" => MarkKind::Calibrate(PriorSource::Warm),
        "reach_before" => MarkKind::Reach { attempt: ReachAttempt::Before, target_idx: m.index },
        "reach_after" => MarkKind::Reach { attempt: ReachAttempt::After, target_idx: m.index },
        "touch" => MarkKind::Touch { target_idx: m.index },
        "phase_plan" => MarkKind::Phase(Phase::Plan),
        "phase_move" => MarkKind::Phase(Phase::Move),
        "phase_settle" => MarkKind::Phase(Phase::Settle),
        "phase_capture" => MarkKind::Phase(Phase::Capture),
        "phase_calibrate" => MarkKind::Phase(Phase::Calibrate),
        "phase_reach" => MarkKind::Phase(Phase::Reach),
        "phase_wait" => MarkKind::Phase(Phase::Wait),
        "phase_done" => MarkKind::Phase(Phase::Done),
        other if other.starts_with("failed_") => MarkKind::Failed(failed_joint(other, m.index)?),
        other => MarkKind::Stop { joint_idx: m.index, angle_rad: stop_angle_rad(other)? },
    };
    let mark = Mark { start: m.start.try_into()?, end: m.end.try_into()?, kind };
    if mark.end < mark.start { Err(DecodeRejection::MarkSpan) } else { Ok(mark) }
}

/// `failed_KIND`.
fn failed_joint(kind: &str, index: u32) -> Result<FailedJoint, DecodeRejection> {
    let kind = kind.strip_prefix("failed_").and_then(FailedKind::of_name).ok_or(DecodeRejection::MarkKind)?;
    Ok(FailedJoint { joint: index as usize, kind })
}

/// `stop ANGLE`.
fn stop_angle_rad(kind: &str) -> Result<f64, DecodeRejection> {
    let angle = kind.strip_prefix("stop ").and_then(|angle| angle.parse::<f64>().ok());
    angle.filter(|angle| angle.is_finite()).ok_or(DecodeRejection::MarkKind)
}

/// Levels between the named ones fall to the lower name.
fn log_line(m: ros::Log) -> Result<LogLine, DecodeRejection> {
    let level = match m.level {
        0..=19 => LogLevel::Debug,
        20..=29 => LogLevel::Info,
        30..=39 => LogLevel::Warn,
        40.. => LogLevel::Error,
    };
    Ok(LogLine { stamp: m.stamp.try_into()?, level, name: m.name, text: m.msg })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::encode::encode_message;
    use crate::log::samples;

    fn bytes_of(value: &impl serde::Serialize) -> Vec<u8> {
        let mut bytes = Vec::new();
        cdr::encode(value, &mut bytes).unwrap();
        bytes
    }

    fn joint_state(names: &[&str], position: &[f64]) -> Vec<u8> {
        let name = names.iter().map(|&name| name.into()).collect();
        bytes_of(&ros::JointState { name, position: position.to_vec(), ..Default::default() })
    }

    /// As of a tag of which only the size is known.
    fn unknown_place(tag: &mut ros::SurveyedTag) {
        (tag.position_std_m, tag.rotation_std_rad) = (f64::INFINITY, f64::INFINITY);
    }

    #[test]
    fn every_message_round_trips_through_its_bytes() {
        let mut bytes = Vec::new();
        for message in samples::one_of_each() {
            encode_message(&message, &samples::header(), &mut bytes).unwrap();
            assert_eq!(decode_message(Stream::of(&message), &bytes, &mut None), Ok(message));
        }
    }

    #[test]
    fn joint_names_and_count_are_fixed_by_the_first_message() {
        let mut names = None;
        let mut decode = |n: &[&str], p: &[f64]| decode_message(Stream::JointSensors, &joint_state(n, p), &mut names);
        assert_eq!(decode(&["a", "b"], &[1.0, f64::NAN]), Err(DecodeRejection::NotFinite { field: "position" }));
        assert!(decode(&["a", "b"], &[1.0, 2.0]).is_ok());
        assert_eq!(decode(&["a"], &[1.0]), Err(DecodeRejection::JointCount { got: 1, expected: 2 }));
        assert_eq!(decode(&["a", "c"], &[1.0, 2.0]), Err(DecodeRejection::NamesChanged));
        assert_eq!(decode(&[], &[1.0, 2.0]), Err(DecodeRejection::NameCount { names: 0, positions: 2 }));
        assert_eq!(decode(&["a"; 9], &[0.0; 9]), Err(DecodeRejection::TooManyJoints { got: 9 }));
        assert_eq!(decode(&[], &[]), Err(DecodeRejection::NoJoints));
        assert!(decode(&["a", "b"], &[3.0, 4.0]).is_ok());
    }

    #[test]
    fn values_that_no_sensor_gives_are_rejected() {
        let mut imu = ros::Imu::default();
        assert_eq!(attitude(&imu), Err(DecodeRejection::QuaternionLength));
        imu.orientation.w = 1.0;
        assert!(attitude(&imu).is_ok());
        imu.linear_acceleration.z = f64::INFINITY;
        assert_eq!(attitude(&imu), Err(DecodeRejection::NotFinite { field: "linear_acceleration" }));
        imu.orientation_covariance[0] = -1.0;
        assert_eq!(attitude(&imu), Err(DecodeRejection::NoOrientation));

        let hot = ros::Temperature { temperature: f64::NAN, ..Default::default() };
        assert_eq!(temperature(&hot, Thermometer::Oil), Err(DecodeRejection::NotFinite { field: "temperature" }));
        let tag = ros::AprilTagDetection { id: -1, ..Default::default() };
        assert_eq!(detection(&tag), Err(DecodeRejection::NegativeTagId));
        let survey_of = |edit: fn(&mut ros::TagSurvey)| {
            let mut tag = ros::SurveyedTag { id: 3, size_m: 0.1, ..Default::default() };
            tag.pose.orientation.w = 1.0;
            let mut m = ros::TagSurvey {
                base_tag: 3,
                tags: vec![tag.clone(), ros::SurveyedTag { id: 4, ..tag }],
                ..Default::default()
            };
            edit(&mut m);
            survey(&m).map(|m| m.tags.len())
        };
        assert_eq!(survey_of(|_| ()), Ok(2));
        assert_eq!(survey_of(|m| m.base_tag = 5), Err(DecodeRejection::NoBaseTag));
        assert_eq!(survey_of(|m| m.tags[1].id = 3), Err(DecodeRejection::TagTwice));
        assert_eq!(survey_of(|m| m.tags[1].size_m = 0.0), Err(DecodeRejection::TagSize));
        assert_eq!(survey_of(|m| m.tags[0].position_std_m = -1.0), Err(DecodeRejection::NegativeVariance));
        assert_eq!(survey_of(|m| m.tags.iter_mut().for_each(unknown_place)), Ok(2));
        assert!(survey_of(|m| m.tags[0].position_std_m = f64::INFINITY).is_err(), "half of a pose");
        assert!(survey_of(|m| m.tags[0].rotation_std_rad = f64::NAN).is_err());
        assert_eq!(survey_of(|m| m.tags[0].pose.orientation.w = 0.0), Err(DecodeRejection::QuaternionLength));
        assert_eq!(
            survey_of(|m| m.tags[0].pose.position.x = f64::NAN),
            Err(DecodeRejection::NotFinite { field: "position" })
        );
        for kind in ["nap", "stop", "stop ", "stop inf", "stop 1.0 rad"] {
            let kind = ros::Mark { kind: kind.into(), ..Default::default() };
            assert_eq!(mark(&kind), Err(DecodeRejection::MarkKind));
        }
        let kind = ros::Mark { kind: "stop -3.6296".into(), index: 4, ..Default::default() };
        assert_eq!(mark(&kind).map(|m| m.kind), Ok(MarkKind::Stop { joint_idx: 4, angle_rad: -3.6296 }));
    }

    #[test]
    fn flipped_bits_and_cut_bytes_never_panic() {
        let (mut bytes, mut accepted) = (Vec::new(), 0);
        for message in samples::one_of_each() {
            let stream = Stream::of(&message);
            encode_message(&message, &samples::header(), &mut bytes).unwrap();
            for at in 0..bytes.len() * 8 {
                let mut damaged = bytes.clone();
                damaged[at / 8] ^= 1 << (at % 8);
                accepted += u32::from(decode_message(stream, &damaged, &mut None).is_ok());
                let _ = decode_message(stream, &damaged[..at / 8], &mut None);
            }
        }
        assert!(accepted > 0);
    }
}

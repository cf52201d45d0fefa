//! From messages to the bytes of their ROS form.

use std::borrow::Cow;

use serde::Serialize;

use super::cdr;
use super::error::EncodeError;
use super::ros::{self, PixelPoint, Quaternion, Time};
use super::writer::RecordingHeader;
use crate::robot::FailedJoint;
use crate::streams::{
    Attitude, CameraImage, CaptureSet, DetectionRejects, LogLevel, LogLine, Mark, MarkKind, Message, Phase,
    PressureSample, PriorSource, ReachAttempt, ReachTask, RecordedSurvey, RecordedTag, TagDetection, TagDetections,
    TemperatureSample,
};
use crate::time::Stamp;

/// `sensor_msgs/msg/JointState` that borrows: joint samples come a thousand times a second.
#[derive(Serialize)]
struct JointStateView<'a> {
    stamp: Time,
    frame_id: &'a str,
    name: &'a [String],
    position: &'a [f64],
    velocity: &'a [f64],
    effort: &'a [f64],
}

/// Name of the one joint on the gripper's topics.
const GRIPPER_JOINT: &str = "gripper";

/// Encodes `message` into `out`, whose former content goes.
///
/// # Errors
/// [`EncodeError`] when a count, stamp or id has no ROS form.
pub(super) fn encode_message(
    message: &Message,
    header: &RecordingHeader,
    out: &mut Vec<u8>,
) -> Result<(), EncodeError> {
    match message {
        Message::JointSensors(m) => joints(m.stamp, &m.counts, header, out),
        Message::JointCommand(m) => joints(m.stamp, &m.counts, header, out),
        Message::JointStates(m) => joints(m.stamp, &m.angles, header, out),
        Message::Detections(m) => Ok(cdr::encode(&detections(m, header)?, out)?),
        Message::Rejects(m) => Ok(cdr::encode(&rejects(m, header)?, out)?),
        Message::Image(m) => Ok(cdr::encode(&image(m, header)?, out)?),
        Message::Temperature(m) => Ok(cdr::encode(&temperature(m, header)?, out)?),
        Message::Pressure(m) => Ok(cdr::encode(&pressure(m, header)?, out)?),
        Message::Attitude(m) => Ok(cdr::encode(&attitude(m, header)?, out)?),
        Message::Gripper(m) => Ok(cdr::encode(&gripper(m.stamp, m.opening_m)?, out)?),
        Message::GripperCommand(m) => Ok(cdr::encode(&gripper(m.stamp, m.opening_m)?, out)?),
        Message::Task(m) => Ok(cdr::encode(&task(m, header)?, out)?),
        Message::Survey(m) => Ok(cdr::encode(&survey(m, header)?, out)?),
        Message::Mark(m) => Ok(cdr::encode(&mark(m)?, out)?),
        Message::Log(m) => Ok(cdr::encode(&log_line(m)?, out)?),
    }
}

fn joints(stamp: Stamp, position: &[f64], header: &RecordingHeader, out: &mut Vec<u8>) -> Result<(), EncodeError> {
    let name = header.joint_names.as_slice();
    if position.len() != name.len() {
        return Err(EncodeError::JointCount { got: position.len(), expected: name.len() });
    }
    let stamp = stamp.try_into()?;
    let view = JointStateView { stamp, frame_id: "", name, position, velocity: &[], effort: &[] };
    Ok(cdr::encode(&view, out)?)
}

fn ros_header(stamp: Stamp, frame_id: &str) -> Result<ros::Header, EncodeError> {
    Ok(ros::Header { stamp: stamp.try_into()?, frame_id: frame_id.to_owned() })
}

fn detections(m: &TagDetections, header: &RecordingHeader) -> Result<ros::AprilTagDetectionArray, EncodeError> {
    Ok(ros::AprilTagDetectionArray {
        header: ros_header(m.stamp, &header.camera_frame)?,
        detections: m.tags.iter().map(|tag| detection(tag, &header.tag_family)).collect::<Result<_, _>>()?,
    })
}

/// The centre is the mean of the corners; goodness, hamming distance and homography are not kept in our messages: zeros.
fn detection(tag: &TagDetection, family: &str) -> Result<ros::AprilTagDetection, EncodeError> {
    let mean = |axis: usize| tag.corners_px.iter().map(|corner| corner[axis]).sum::<f64>() / 4.0;
    Ok(ros::AprilTagDetection {
        family: family.to_owned(),
        id: i32::try_from(tag.id).map_err(|_| EncodeError::TagId { id: tag.id })?,
        hamming: 0,
        goodness: 0.0,
        decision_margin: tag.decision_margin as f32,
        centre: PixelPoint { x: mean(0), y: mean(1) },
        corners: tag.corners_px.map(|[x, y]| PixelPoint { x, y }),
        homography: [0.0; 9],
    })
}

fn rejects(m: &DetectionRejects, header: &RecordingHeader) -> Result<ros::DetectionRejects, EncodeError> {
    let reject = |r: &crate::streams::DetectionReject| ros::DetectionReject {
        id: r.id,
        reason: r.reason.name().to_owned(),
        corners: r.corners_px.map(|[x, y]| PixelPoint { x, y }),
    };
    Ok(ros::DetectionRejects {
        header: ros_header(m.stamp, &header.camera_frame)?,
        rejects: m.rejects.iter().map(reject).collect(),
    })
}

fn image(m: &CameraImage, header: &RecordingHeader) -> Result<ros::CompressedImage, EncodeError> {
    let header = ros_header(m.stamp, &header.camera_frame)?;
    Ok(ros::CompressedImage { header, format: "jpeg".to_owned(), data: m.jpeg.clone() })
}

fn temperature(m: &TemperatureSample, header: &RecordingHeader) -> Result<ros::Temperature, EncodeError> {
    let header = ros_header(m.stamp, &header.vehicle_frame)?;
    Ok(ros::Temperature { header, temperature: m.temperature_c, variance: m.variance_c2 })
}

fn pressure(m: &PressureSample, header: &RecordingHeader) -> Result<ros::FluidPressure, EncodeError> {
    let header = ros_header(m.stamp, &header.vehicle_frame)?;
    Ok(ros::FluidPressure { header, fluid_pressure: m.pressure_pa, variance: m.variance_pa2 })
}

/// Covariances stay zero: in ROS, "unknown".
fn attitude(m: &Attitude, header: &RecordingHeader) -> Result<ros::Imu, EncodeError> {
    Ok(ros::Imu {
        header: ros_header(m.stamp, &header.vehicle_frame)?,
        orientation: Quaternion::from_wxyz(m.quaternion_wxyz),
        angular_velocity: m.angular_velocity_rad_s.into(),
        linear_acceleration: m.specific_force_m_s2.into(),
        ..ros::Imu::default()
    })
}

/// The jaws as one joint: its position is the gap between them.
fn gripper(stamp: Stamp, opening_m: f64) -> Result<ros::JointState, EncodeError> {
    Ok(ros::JointState {
        header: ros_header(stamp, "")?,
        name: vec![GRIPPER_JOINT.to_owned()],
        position: vec![opening_m],
        ..ros::JointState::default()
    })
}

fn task(m: &ReachTask, header: &RecordingHeader) -> Result<ros::ReachTask, EncodeError> {
    Ok(ros::ReachTask {
        header: ros_header(m.stamp, &header.base_frame)?,
        targets: m.targets_m.iter().copied().map(Into::into).collect(),
        tolerance_m: m.tolerance_m,
    })
}

fn survey(m: &RecordedSurvey, header: &RecordingHeader) -> Result<ros::TagSurvey, EncodeError> {
    let tag = |tag: &RecordedTag| ros::SurveyedTag {
        id: tag.id,
        size_m: tag.size_m,
        pose: ros::Pose { position: tag.position_m.into(), orientation: Quaternion::from_wxyz(tag.quaternion_wxyz) },
        position_std_m: tag.position_std_m,
        rotation_std_rad: tag.rotation_std_rad,
    };
    Ok(ros::TagSurvey {
        header: ros_header(m.stamp, &header.base_frame)?,
        base_tag: m.base_tag,
        tags: m.tags.iter().map(tag).collect(),
    })
}

fn mark(m: &Mark) -> Result<ros::Mark, EncodeError> {
    let (kind, index) = mark_kind(m.kind);
    Ok(ros::Mark { start: m.start.try_into()?, end: m.end.try_into()?, kind: kind.into_owned(), index })
}

/// Name and index of a mark in the file; `decode` has the inverse.
fn mark_kind(kind: MarkKind) -> (Cow<'static, str>, u32) {
    let (name, index) = match kind {
        // The one kind with a number that is no index: in the text, so that the message's form stays what it was.
        MarkKind::Stop { joint_idx, angle_rad } => return (format!("stop {angle_rad}").into(), joint_idx),
        MarkKind::Capture { set: CaptureSet::Fit, pose_idx } => ("capture_fit", pose_idx),
        MarkKind::Capture { set: CaptureSet::HeldOut, pose_idx } => ("capture_held_out", pose_idx),
        MarkKind::Identify { joint_idx } => ("identify", joint_idx),
        MarkKind::Failed(FailedJoint { joint, kind }) => {
            return (format!("failed_{}", kind.name()).into(), joint as u32);
        }
        MarkKind::Calibrate(PriorSource::Fresh) => ("calibrate", 0),
        MarkKind::Calibrate(PriorSource::Warm) => ("recalibrate", 0),
        MarkKind::Reach { attempt: ReachAttempt::Before, target_idx } => ("reach_before", target_idx),
        MarkKind::Reach { attempt: ReachAttempt::After, target_idx } => ("reach_after", target_idx),
        MarkKind::Touch { target_idx } => ("touch", target_idx),
        MarkKind::Phase(phase) => {
            let name = match phase {
                Phase::Plan => "phase_plan",
                Phase::Move => "phase_move",
                Phase::Settle => "phase_settle",
                Phase::Capture => "phase_capture",
                Phase::Calibrate => "phase_calibrate",
                Phase::Reach => "phase_reach",
                Phase::Wait => "phase_wait",
                Phase::Done => "phase_done",
            };
            (name, 0)
        }
    };
    (name.into(), index)
}

fn log_line(m: &LogLine) -> Result<ros::Log, EncodeError> {
    let level = match m.level {
        LogLevel::Debug => 10,
        LogLevel::Info => 20,
        LogLevel::Warn => 30,
        LogLevel::Error => 40,
    };
    Ok(ros::Log { stamp: m.stamp.try_into()?, level, name: m.name.clone(), msg: m.text.clone(), ..ros::Log::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::samples;

    #[test]
    fn borrowed_joint_state_has_the_bytes_of_the_owned_one() {
        let header = samples::header();
        let stamp = Stamp { nanos: 1_500_000_000 };
        let mut borrowed = Vec::new();
        joints(stamp, &[1.0, 2.0, 3.0], &header, &mut borrowed).unwrap();
        let owned = ros::JointState {
            header: ros_header(stamp, "").unwrap(),
            name: header.joint_names.clone(),
            position: vec![1.0, 2.0, 3.0],
            ..ros::JointState::default()
        };
        let mut expected = Vec::new();
        cdr::encode(&owned, &mut expected).unwrap();
        assert_eq!(borrowed, expected);
    }

    #[test]
    fn wrong_joint_count_is_refused() {
        let error = joints(Stamp::default(), &[1.0], &samples::header(), &mut Vec::new()).unwrap_err();
        assert!(matches!(error, EncodeError::JointCount { got: 1, expected: 3 }));
    }
}

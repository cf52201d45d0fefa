//! Messages for the tests of this folder.

use super::header::RecordingHeader;
use super::writer::RecordingWriter;
use crate::robot::{FailedJoint, FailedKind};
use crate::streams::{
    Attitude, CameraImage, CaptureSet, DetectionReject, DetectionRejects, GripperCommand, GripperSample, JointAngles,
    JointCommand, JointCounts, JointSensorSample, JointStateBelief, LogLevel, LogLine, Mark, MarkKind, Message, Phase,
    PressureSample, PriorSource, ReachAttempt, ReachTask, RecordedSurvey, RecordedTag, RejectReason, Sink,
    TagDetection, TagDetections, TemperatureSample, Thermometer, ToolTouch,
};
use crate::time::{SIMULATION_EPOCH, Stamp};
use std::path::Path;

pub fn header() -> RecordingHeader {
    RecordingHeader::new(["base_yaw", "shoulder", "elbow"].map(String::from).to_vec())
}

fn marks(stamp: Stamp) -> Vec<Message> {
    let kinds = [
        MarkKind::Capture { set: CaptureSet::Fit, pose_idx: 3 },
        MarkKind::Capture { set: CaptureSet::HeldOut, pose_idx: 4 },
        MarkKind::Identify { joint_idx: 2 },
        MarkKind::Stop { joint_idx: 1, angle_rad: -2.064_400_000_000_1 },
        MarkKind::Failed(FailedJoint { joint: 2, kind: FailedKind::Dead }),
        MarkKind::Calibrate(PriorSource::Fresh),
        MarkKind::Calibrate(PriorSource::Warm),
        MarkKind::Reach { attempt: ReachAttempt::Before, target_idx: 5 },
        MarkKind::Reach { attempt: ReachAttempt::After, target_idx: 6 },
        MarkKind::Touch { target_idx: 6 },
    ];
    let phases = [
        Phase::Plan,
        Phase::Move,
        Phase::Settle,
        Phase::Capture,
        Phase::Calibrate,
        Phase::Reach,
        Phase::Wait,
        Phase::Done,
    ];
    let kinds = kinds.into_iter().chain(phases.map(MarkKind::Phase));
    kinds.map(|kind| Message::Mark(Mark { start: stamp, end: stamp.plus_s(0.5), kind })).collect()
}

/// Returns every variant and sub-variant of [`Message`].
pub fn one_of_each() -> Vec<Message> {
    let stamp = SIMULATION_EPOCH.plus_s(1.25);
    let corners_px = [[10.5, 20.25], [30.0, 21.0], [31.0, 1.0], [9.0, 0.5]];
    let tag = TagDetection { id: 7, corners_px, decision_margin: 61.5 };
    let temperature = |thermometer| {
        Message::Temperature(TemperatureSample { stamp, thermometer, temperature_c: 41.3, variance_c2: 0.04 })
    };
    let log = |level| Message::Log(LogLine { stamp, level, name: "arm".into(), text: "µ settled".into() });
    let tag_at = |id, x_m| RecordedTag {
        id,
        size_m: 0.15,
        position_m: [x_m, -0.4, 0.123_456_789],
        quaternion_wxyz: [0.1, 0.7, -0.1, 0.7],
        position_std_m: 0.001,
        rotation_std_rad: 0.0035,
    };
    let targets_m = vec![[1.0, 0.2, -0.3], [0.9, 0.0, 0.1]];
    let mut messages = vec![
        Message::JointSensors(JointSensorSample { stamp, counts: JointCounts::from_slice(&[1.0, 2047.5, 4095.0]) }),
        Message::JointCommand(JointCommand { stamp, counts: JointCounts::from_slice(&[-1.0, 0.1, 4095.0]) }),
        Message::JointStates(JointStateBelief { stamp, angles: JointAngles::from_slice(&[0.1, -0.2, 3.0]) }),
        Message::Detections(TagDetections { stamp, tags: vec![tag.clone(), TagDetection { id: 8, ..tag }] }),
        Message::Detections(TagDetections { stamp, tags: vec![] }),
        Message::Rejects(DetectionRejects {
            stamp,
            rejects: RejectReason::ALL.map(|reason| DetectionReject { id: 9, corners_px, reason }).to_vec(),
        }),
        Message::Image(CameraImage { stamp, jpeg: vec![0xff, 0xd8, 0, 7, 0xff, 0xd9] }),
        temperature(Thermometer::Oil),
        temperature(Thermometer::Water),
        Message::Pressure(PressureSample { stamp, pressure_pa: 2.0e7, variance_pa2: 1.0e4 }),
        Message::Attitude(Attitude {
            stamp,
            quaternion_wxyz: [0.5, -0.5, 0.5, 0.5],
            angular_velocity_rad_s: [0.01, 0.02, -0.03],
            specific_force_m_s2: [0.0, 0.1, 9.81],
        }),
        Message::Gripper(GripperSample { stamp, opening_m: 0.0985 }),
        Message::GripperCommand(GripperCommand { stamp, opening_m: 0.1 }),
        Message::Task(ReachTask { stamp, targets_m, tolerance_m: 0.01, poses: Vec::new() }),
        Message::Touch(ToolTouch {
            stamp,
            duration_s: 0.5,
            surface: "toe plate".to_owned(),
            point_m: [1.3, 0.4, -1.0],
            normal: [0.0, -0.6, 0.8],
            tip_radius_m: 0.04,
            std_m: 0.001,
        }),
        Message::Survey(RecordedSurvey {
            stamp,
            link: None,
            base_tag: 12,
            tags: vec![tag_at(3, 1.1), tag_at(12, -0.2)],
        }),
    ];
    messages.extend(marks(stamp));
    messages.extend([LogLevel::Debug, LogLevel::Info, LogLevel::Warn, LogLevel::Error].map(log));
    messages
}

/// Returns `n` steps of one joint sample each, with one of the other messages every tenth step. Numbers vary so that
/// chunks do not compress to almost nothing.
pub fn stream(n: usize) -> Vec<(Stamp, Message)> {
    // The other messages that are read back by default.
    let others: Vec<_> = one_of_each().into_iter().filter(|m| !matches!(m, Message::Image(_))).collect();
    let mut messages = Vec::new();
    let mut state = 1_u64;
    for step in 0..n {
        let stamp = SIMULATION_EPOCH.plus_s(step as f64 * 1e-3);
        let counts = JointCounts::from_fn(3, |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / 4096.0
        });
        messages.push((stamp, Message::JointSensors(JointSensorSample { stamp, counts })));
        if step % 10 == 0 {
            messages.push((stamp, others[step / 10 % others.len()].clone()));
        }
    }
    messages
}

/// Writes `messages` to `path`, ending a chunk after every `per_chunk`.
pub fn write(path: &Path, messages: &[(Stamp, Message)], per_chunk: usize) {
    let mut writer = RecordingWriter::create(path, header()).unwrap();
    for part in messages.chunks(per_chunk) {
        for (log_time, message) in part {
            writer.record(*log_time, message).unwrap();
        }
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
}

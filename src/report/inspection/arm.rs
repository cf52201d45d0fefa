//! Contents of armcal's own topics, read without a robot.

use std::collections::BTreeMap;

use serde::Serialize;

use armcal_core::log::Recording;
use armcal_core::streams::{CaptureSet, Mark, MarkKind, Message, ReachAttempt, Thermometer};

/// Joints, views, tags, task and ranges.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ArmContents {
    /// Joint names from the joint messages, base first.
    pub joints: Vec<String>,
    pub joint_readings: u64,
    /// Number of `capture_fit` marks; `views_held_out` counts `capture_held_out`.
    pub views_fit: u64,
    pub views_held_out: u64,
    /// Number of `reach_before` marks; `reaches_after` counts `reach_after`.
    pub reaches_before: u64,
    pub reaches_after: u64,
    /// Number of messages with detections, including those without any tag.
    pub detection_frames: u64,
    pub tags: Vec<TagSeen>,
    /// Number of detections that the detector rejected, by reason.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub detections_rejected: BTreeMap<String, u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub task: Option<TaskSeen>,
    /// Lowest and highest oil temperature, degC.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub oil_c: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub water_c: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pressure_pa: Option<[f64; 2]>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct TagSeen {
    pub id: u32,
    pub detections: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TaskSeen {
    pub targets_m: Vec<[f64; 3]>,
    pub tolerance_m: f64,
}

#[derive(Default)]
pub(super) struct Collector {
    joint_readings: u64,
    captures: [u64; 2],
    reaches: [u64; 2],
    frames: u64,
    tags: BTreeMap<u32, u64>,
    detections_rejected: BTreeMap<String, u64>,
    oil_c: Option<[f64; 2]>,
    water_c: Option<[f64; 2]>,
    pressure_pa: Option<[f64; 2]>,
}

impl Collector {
    pub fn take(&mut self, message: &Message) {
        match message {
            Message::JointSensors(_) => self.joint_readings += 1,
            Message::Rejects(rejects) => {
                for reject in &rejects.rejects {
                    *self.detections_rejected.entry(reject.reason.name().to_owned()).or_default() += 1;
                }
            }
            Message::Detections(detections) => {
                self.frames += 1;
                for tag in &detections.tags {
                    *self.tags.entry(tag.id).or_default() += 1;
                }
            }
            Message::Mark(mark) => match mark.kind {
                MarkKind::Capture { set: CaptureSet::Fit, .. } => self.captures[0] += 1,
                MarkKind::Capture { set: CaptureSet::HeldOut, .. } => self.captures[1] += 1,
                MarkKind::Reach { attempt: ReachAttempt::Before, .. } => self.reaches[0] += 1,
                MarkKind::Reach { attempt: ReachAttempt::After, .. } => self.reaches[1] += 1,
                MarkKind::Phase(_)
                | MarkKind::Stop { .. }
                | MarkKind::Identify { .. }
                | MarkKind::Failed(_)
                | MarkKind::Calibrate(_)
                | MarkKind::Touch { .. } => {}
            },
            Message::Temperature(sample) => match sample.thermometer {
                Thermometer::Oil => widen(&mut self.oil_c, sample.temperature_c),
                Thermometer::Water => widen(&mut self.water_c, sample.temperature_c),
            },
            Message::Pressure(sample) => widen(&mut self.pressure_pa, sample.pressure_pa),
            _ => {}
        }
    }

    /// Finishes the counts; `recording` holds at least the task.
    pub fn finish(self, recording: &Recording) -> ArmContents {
        let task = recording.messages.iter().find_map(|(_, message)| match message {
            Message::Task(task) => Some(TaskSeen { targets_m: task.targets_m.clone(), tolerance_m: task.tolerance_m }),
            _ => None,
        });
        ArmContents {
            joints: recording.joint_names.clone(),
            joint_readings: self.joint_readings,
            views_fit: self.captures[0],
            views_held_out: self.captures[1],
            reaches_before: self.reaches[0],
            reaches_after: self.reaches[1],
            detection_frames: self.frames,
            detections_rejected: self.detections_rejected,
            tags: self.tags.into_iter().map(|(id, detections)| TagSeen { id, detections }).collect(),
            task,
            oil_c: self.oil_c,
            water_c: self.water_c,
            pressure_pa: self.pressure_pa,
        }
    }
}

fn widen(range: &mut Option<[f64; 2]>, value: f64) {
    let [low, high] = range.unwrap_or([value, value]);
    *range = Some([low.min(value), high.max(value)]);
}

/// True if the message marks a captured view; views in which a single joint moved count.
pub(crate) fn is_capture(message: &Message) -> bool {
    matches!(message, Message::Mark(Mark { kind: MarkKind::Capture { .. } | MarkKind::Identify { .. }, .. }))
}

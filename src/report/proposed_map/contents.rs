//! What of a recording an input map may name.

use std::collections::{BTreeMap, BTreeSet};

use armcal_core::log::ros::{AprilTagDetection, AprilTagDetectionArray, JointState, TfMessage};
use armcal_core::log::{RawMessage, decode};

/// Messages of a topic that are decoded.
const MAX_SAMPLES: u64 = 1000;
/// Topics, and names or frames of one topic, that are kept.
const MAX_NAMES: usize = 2000;

/// What a topic may be for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Joints,
    Transforms,
    Detections,
    Images,
    CameraInfo,
    Temperature,
    Pressure,
    Attitude,
    Other,
}

impl Kind {
    fn of(schema: &str) -> Self {
        match schema.rsplit('/').next().unwrap_or_default() {
            "JointState" => Self::Joints,
            "TFMessage" => Self::Transforms,
            "AprilTagDetectionArray" => Self::Detections,
            "Image" | "CompressedImage" => Self::Images,
            "CameraInfo" => Self::CameraInfo,
            "Temperature" => Self::Temperature,
            "FluidPressure" => Self::Pressure,
            "Imu" => Self::Attitude,
            _ => Self::Other,
        }
    }
}

/// One topic.
#[derive(Debug)]
pub(super) struct Topic {
    pub kind: Kind,
    pub messages: u64,
    /// Names of joints.
    pub joints: BTreeSet<String>,
    /// The largest position of a joint.
    pub largest: f64,
    /// Parent and child of each transform.
    pub frames: BTreeSet<(String, String)>,
    /// Numbers of detected tags, or of a board's corners.
    pub ids: BTreeSet<i32>,
    /// Detections that have an outline, as tags do.
    pub outlines: u64,
}

/// The topics of a recording, by name.
#[derive(Debug, Default)]
pub(super) struct Contents {
    pub topics: BTreeMap<String, Topic>,
}

impl Contents {
    pub fn take(&mut self, raw: &RawMessage<'_>) {
        if !self.topics.contains_key(raw.topic()) {
            if self.topics.len() >= MAX_NAMES {
                return;
            }
            let is_cdr = raw.channel.message_encoding == "cdr";
            let kind = if is_cdr { Kind::of(raw.schema_name()) } else { Kind::Other };
            let (joints, frames, ids) = Default::default();
            let topic = Topic { kind, messages: 0, joints, largest: 0.0, frames, ids, outlines: 0 };
            self.topics.insert(raw.topic().to_owned(), topic);
        }
        let Some(topic) = self.topics.get_mut(raw.topic()) else { return };
        topic.messages += 1;
        if topic.messages <= MAX_SAMPLES {
            topic.look_into(raw.data);
        }
    }

    pub fn of_kind(&self, kind: Kind) -> impl Iterator<Item = (&String, &Topic)> {
        self.topics.iter().filter(move |(_, topic)| topic.kind == kind)
    }
}

/// A corner of a board is a detection without one: nothing but its centre is a place in the image.
fn has_outline(tag: &AprilTagDetection) -> bool {
    tag.corners.iter().any(|corner| *corner != tag.corners[0])
}

impl Topic {
    /// Whether all that was detected there are places without an outline: corners of a board.
    pub fn has_board_corners(&self) -> bool {
        !self.ids.is_empty() && self.outlines == 0
    }

    fn look_into(&mut self, data: &[u8]) {
        match self.kind {
            Kind::Joints => {
                if let Ok(message) = decode::<JointState>(data) {
                    let room = MAX_NAMES.saturating_sub(self.joints.len());
                    self.joints.extend(message.name.into_iter().take(room));
                    let finite = message.position.into_iter().filter(|value| value.is_finite());
                    self.largest = finite.map(f64::abs).fold(self.largest, f64::max);
                }
            }
            Kind::Transforms => {
                if let Ok(message) = decode::<TfMessage>(data) {
                    let room = MAX_NAMES.saturating_sub(self.frames.len());
                    let plain = |frame: &str| frame.strip_prefix('/').unwrap_or(frame).to_owned();
                    let pairs = message.transforms.iter().take(room);
                    self.frames.extend(pairs.map(|t| (plain(&t.header.frame_id), plain(&t.child_frame_id))));
                }
            }
            Kind::Detections => {
                if let Ok(message) = decode::<AprilTagDetectionArray>(data) {
                    let room = MAX_NAMES.saturating_sub(self.ids.len());
                    self.ids.extend(message.detections.iter().take(room).map(|tag| tag.id));
                    self.outlines += message.detections.iter().filter(|tag| has_outline(tag)).count() as u64;
                }
            }
            _ => {}
        }
    }
}

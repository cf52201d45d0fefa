//! Contents of a recording that an input map may name.

use std::collections::{BTreeMap, BTreeSet};

use armcal_core::input::{StreamTimes, header_stamp, lens_of_camera_info};
use armcal_core::log::ros::{
    AprilTagDetection, CameraInfo, CompressedImage, FluidPressure, Image, Imu, JointState, Temperature, TfMessage,
    decode_detections,
};
use armcal_core::log::{RawMessage, RosMessage, decode, is_type};
use armcal_core::time::Stamp;

use crate::report::inspection::MAX_SAMPLES;

/// Number of one topic's times that are kept: 16 bytes each.
const MAX_TIMES: usize = 2_000_000;
/// Number of topics, and of names or frames of one topic, that are kept.
const MAX_NAMES: usize = 2000;

/// Possible use of a topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Kind {
    Joints,
    Transforms,
    Detections,
    Images,
    CameraInfo,
    Temperature,
    Pressure,
    Attitude,
    #[default]
    Other,
}

impl Kind {
    fn of(schema: &str) -> Self {
        let kinds = [
            (JointState::SCHEMA, Self::Joints),
            (TfMessage::SCHEMA, Self::Transforms),
            (Image::SCHEMA, Self::Images),
            (CompressedImage::SCHEMA, Self::Images),
            (CameraInfo::SCHEMA, Self::CameraInfo),
            (Temperature::SCHEMA, Self::Temperature),
            (FluidPressure::SCHEMA, Self::Pressure),
            (Imu::SCHEMA, Self::Attitude),
        ];
        match kinds.into_iter().find(|(known, _)| is_type(schema, known.name)) {
            Some((_, kind)) => kind,
            None if decode_detections(schema, &[]).is_some() => Self::Detections,
            None => Self::Other,
        }
    }
}

/// Contents of one topic.
#[derive(Debug, Default)]
pub(super) struct Topic {
    pub kind: Kind,
    /// Name of the messages' type, with the encoding where that is not read.
    pub schema: String,
    pub is_cdr: bool,
    pub messages: u64,
    /// Names of joints.
    pub joints: BTreeSet<String>,
    /// The largest position of any joint, and of each by name.
    pub largest: f64,
    pub largest_of: BTreeMap<String, f64>,
    /// Messages with names and no positions.
    pub without_positions: u64,
    /// Parent and child of each transform.
    pub frames: BTreeSet<(String, String)>,
    /// Numbers of detected tags, or of a board's corners.
    pub ids: BTreeSet<i32>,
    /// Number of detections that have an outline, as tags do.
    pub outlines: u64,
    /// Frame of the first message that names one.
    pub frame: String,
    /// Image size of the first usable lens, px; otherwise the reason that the first lens is unusable.
    pub lens: Option<Result<[u32; 2], String>>,
    /// The highest column and row of a corner, px.
    pub extent_px: [f64; 2],
    stamps: Vec<Stamp>,
    log_times: Vec<Stamp>,
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
            let encoding = raw.channel.message_encoding.as_str();
            let (kind, schema) = match encoding {
                "cdr" => (Kind::of(raw.schema_name()), raw.schema_name().to_owned()),
                _ => (Kind::Other, format!("{} as {encoding}", raw.schema_name())),
            };
            let topic = Topic { kind, schema, is_cdr: encoding == "cdr", ..Topic::default() };
            self.topics.insert(raw.topic().to_owned(), topic);
        }
        let Some(topic) = self.topics.get_mut(raw.topic()) else { return };
        topic.messages += 1;
        topic.note_time(raw);
        if topic.messages <= MAX_SAMPLES {
            topic.look_into(raw.data);
        }
    }

    pub fn of_kind(&self, kind: Kind) -> impl Iterator<Item = (&String, &Topic)> {
        self.topics.iter().filter(move |(_, topic)| topic.kind == kind)
    }
}

/// True if the tag has an outline. A board's corner is a detection without one: only its centre is a place in the
/// image.
fn has_outline(tag: &AprilTagDetection) -> bool {
    tag.corners.iter().any(|corner| *corner != tag.corners[0])
}

impl Topic {
    /// True if no detection has an outline: they are corners of a board.
    pub fn has_board_corners(&self) -> bool {
        !self.ids.is_empty() && self.outlines == 0
    }

    /// Times of all messages so far, to compare clocks.
    pub fn times(&self, name: &str) -> StreamTimes {
        StreamTimes { topic: name.to_owned(), stamps: self.stamps.clone(), log_times: self.log_times.clone() }
    }

    fn note_time(&mut self, raw: &RawMessage<'_>) {
        // A message of transforms begins with their count.
        let skip = match self.kind {
            Kind::Joints | Kind::Detections | Kind::Images => 0,
            Kind::Transforms => 4,
            _ => return,
        };
        if self.stamps.len() < MAX_TIMES
            && let Some(time) = header_stamp(raw.data, skip)
        {
            let stamp = Stamp::try_from(time).ok().filter(|stamp| stamp.nanos != 0);
            self.stamps.push(stamp.unwrap_or(raw.log_time()));
            self.log_times.push(raw.log_time());
        }
    }

    fn note_frame(&mut self, frame: String) {
        if self.frame.is_empty() {
            self.frame = frame;
        }
    }

    fn look_into(&mut self, data: &[u8]) {
        match self.kind {
            Kind::Joints => {
                if let Ok(message) = decode::<JointState>(data) {
                    self.look_into_joints(message);
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
            Kind::Detections => self.look_into_detections(data),
            Kind::Images => {
                let frame = |data: &[u8]| match is_type(&self.schema, Image::SCHEMA.name) {
                    true => decode::<Image>(data).map(|image| image.header.frame_id),
                    false => decode::<CompressedImage>(data).map(|image| image.header.frame_id),
                };
                if self.frame.is_empty()
                    && let Ok(frame) = frame(data)
                {
                    self.note_frame(frame);
                }
            }
            Kind::CameraInfo => {
                if let Ok(info) = decode::<CameraInfo>(data) {
                    let lens = lens_of_camera_info(&info).map(|lens| lens.resolution_px());
                    if !matches!(self.lens, Some(Ok(_))) && (lens.is_ok() || self.lens.is_none()) {
                        self.lens = Some(lens);
                    }
                    self.note_frame(info.header.frame_id);
                }
            }
            _ => {}
        }
    }

    fn look_into_joints(&mut self, message: JointState) {
        if message.position.is_empty() {
            self.without_positions += 1;
        }
        if message.position.len() != message.name.len() {
            return;
        }
        for (name, position) in message.name.into_iter().zip(message.position) {
            let room = self.joints.len() < MAX_NAMES || self.joints.contains(&name);
            if position.is_finite() {
                self.largest = self.largest.max(position.abs());
            }
            if room && position.is_finite() {
                let largest = self.largest_of.entry(name.clone()).or_default();
                *largest = largest.max(position.abs());
            }
            if room {
                self.joints.insert(name);
            }
        }
    }

    fn look_into_detections(&mut self, data: &[u8]) {
        let Some(Ok(message)) = decode_detections(&self.schema, data) else { return };
        let room = MAX_NAMES.saturating_sub(self.ids.len());
        self.ids.extend(message.detections.iter().take(room).map(|tag| tag.id));
        self.outlines += message.detections.iter().filter(|tag| has_outline(tag)).count() as u64;
        for corner in message.detections.iter().flat_map(|tag| &tag.corners) {
            self.extent_px = [self.extent_px[0].max(corner.x), self.extent_px[1].max(corner.y)];
        }
        self.note_frame(message.header.frame_id);
    }
}

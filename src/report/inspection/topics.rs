//! Counts by topic, and possible uses of topics that are not armcal's.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use crate::report::proposed_map::joint_units::MAX_RAD;
use armcal_core::input::{ONE_SENDER, TwoSenders, two_senders};
use armcal_core::log::ros::{JointState, TfMessage, decode_detections};
use armcal_core::log::{RawMessage, decode};
use armcal_core::log::{Stream, topics};
use armcal_core::time::Stamp;

/// Counts and type of one topic.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TopicContents {
    pub topic: String,
    /// Name of the messages' type; empty where the file declares none.
    pub schema: String,
    /// Encoding of the messages: `cdr`, `ros1`, `json`, `protobuf` or another.
    pub encoding: String,
    pub messages: u64,
    /// Size of the uncompressed messages, bytes.
    pub bytes: u64,
    /// Lowest and highest log time, nanoseconds since the Unix epoch.
    pub time_nanos: [u64; 2],
    /// Mean rate over the topic's own span, Hz; `None` for fewer than two messages or a span of zero.
    pub rate_hz: Option<f64>,
    /// Content that armcal's own recordings have on a topic of that name and type.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known_as: Option<&'static str>,
    /// Possible use of a topic that is not armcal's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub may_be: Option<String>,
    /// Two senders of the same joints that differ.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub two_senders: Option<String>,
}

/// Number of a topic's messages that are decoded, here and for an input map.
pub(in crate::report) const MAX_SAMPLES: u64 = 1000;
/// Number of names that are listed per topic.
const MAX_NAMES: usize = 12;

/// Types that an input map may name, in addition to those of detections.
const READ: [&str; 5] = [
    "sensor_msgs/JointState",
    "tf2_msgs/TFMessage",
    "sensor_msgs/CameraInfo",
    "sensor_msgs/Image",
    "sensor_msgs/CompressedImage",
];

#[derive(Default)]
struct Seen {
    schema: String,
    encoding: String,
    messages: u64,
    bytes: u64,
    first_nanos: u64,
    last_nanos: u64,
    names: BTreeSet<String>,
    /// Joint names in the order of the message.
    joints: Vec<String>,
    largest: f64,
    /// Stamp and positions of messages with these joints.
    positions: Vec<(Stamp, Vec<f64>)>,
}

/// Collects counts and samples from every message of a file.
#[derive(Default)]
pub(super) struct Collector {
    /// Contents of each topic; one topic may have several types.
    seen: BTreeMap<String, Vec<Seen>>,
}

impl Collector {
    pub fn take(&mut self, raw: &RawMessage<'_>) {
        if !self.seen.contains_key(raw.topic()) {
            self.seen.insert(raw.topic().to_owned(), Vec::new());
        }
        let Some(types) = self.seen.get_mut(raw.topic()) else { return };
        let (schema, encoding) = (raw.schema_name(), raw.channel.message_encoding.as_str());
        let known = types.iter().position(|seen| seen.schema == schema && seen.encoding == encoding);
        let known = known.unwrap_or_else(|| {
            let first_nanos = raw.log_time_nanos;
            types.push(Seen { schema: schema.into(), encoding: encoding.into(), first_nanos, ..Seen::default() });
            types.len() - 1
        });
        let seen = &mut types[known];
        seen.messages += 1;
        seen.bytes += raw.data.len() as u64;
        seen.first_nanos = seen.first_nanos.min(raw.log_time_nanos);
        seen.last_nanos = seen.last_nanos.max(raw.log_time_nanos);
        if seen.messages <= MAX_SAMPLES && encoding == "cdr" {
            seen.look_into(&plain(schema), raw);
        }
    }

    pub fn time_nanos(&self) -> Option<[u64; 2]> {
        let first = self.seen.values().flatten().map(|seen| seen.first_nanos).min()?;
        let last = self.seen.values().flatten().map(|seen| seen.last_nanos).max()?;
        Some([first, last])
    }

    pub fn finish(self) -> Vec<TopicContents> {
        let of_topic =
            |(topic, types): (String, Vec<Seen>)| types.into_iter().map(move |seen| seen.finish(topic.clone()));
        self.seen.into_iter().flat_map(of_topic).collect()
    }
}

/// Returns `sensor_msgs/JointState` for `sensor_msgs/msg/JointState`.
fn plain(schema: &str) -> String {
    schema.replace("/msg/", "/")
}

impl Seen {
    fn look_into(&mut self, schema: &str, raw: &RawMessage<'_>) {
        let data = raw.data;
        match schema {
            "sensor_msgs/JointState" => {
                if let Ok(message) = decode::<JointState>(data) {
                    let size = |value: &f64| if value.is_finite() { value.abs() } else { 0.0 };
                    self.largest = message.position.iter().map(size).fold(self.largest, f64::max);
                    if self.joints.is_empty() {
                        self.joints = message.name.clone();
                    }
                    let is_finite = message.position.iter().all(|value| value.is_finite());
                    if message.name == self.joints && message.position.len() == message.name.len() && is_finite {
                        let stamp = Stamp::try_from(message.header.stamp).ok().filter(|stamp| stamp.nanos != 0);
                        self.positions.push((stamp.unwrap_or(raw.log_time()), message.position));
                    }
                }
            }
            "tf2_msgs/TFMessage" => {
                if let Ok(message) = decode::<TfMessage>(data) {
                    let name = |t: &armcal_core::log::ros::TransformStamped| {
                        format!("{} to {}", t.header.frame_id, t.child_frame_id)
                    };
                    self.names.extend(message.transforms.iter().map(name));
                }
            }
            _ => {
                if let Some(Ok(message)) = decode_detections(schema, data) {
                    self.names.extend(message.detections.iter().map(|tag| tag.id.to_string()));
                }
            }
        }
    }

    /// The joint whose values by two senders differ most, in words; `None` where numbers are no angles in rad.
    fn two_senders(&mut self) -> Option<String> {
        if self.largest > MAX_RAD {
            return None;
        }
        self.positions.sort_by_key(|(stamp, _)| *stamp);
        let stamps: Vec<Stamp> = self.positions.iter().map(|(stamp, _)| *stamp).collect();
        let of_joint = |(k, joint): (usize, &String)| {
            let values: Vec<f64> = self.positions.iter().map(|(_, position)| position[k]).collect();
            Some((joint.clone(), two_senders(&stamps, &values, 0.0, Some(std::f64::consts::TAU))?))
        };
        let found = self.joints.iter().enumerate().filter_map(of_joint);
        let (joint, TwoSenders { apart, within_s }) = found.max_by(|(_, a), (_, b)| a.apart.total_cmp(&b.apart))?;
        Some(format!(
            "has two senders that differ: {joint} by {apart:.3} rad within {:.0} ms; {ONE_SENDER}",
            1e3 * within_s
        ))
    }

    fn finish(mut self, topic: String) -> TopicContents {
        let span_s = (self.last_nanos - self.first_nanos) as f64 * 1e-9;
        let rate_hz = (self.messages > 1 && span_s > 0.0).then(|| (self.messages - 1) as f64 / span_s);
        TopicContents {
            known_as: known_as(&topic, &self.schema),
            may_be: self.may_be(&plain(&self.schema)),
            two_senders: self.two_senders(),
            messages: self.messages,
            bytes: self.bytes,
            time_nanos: [self.first_nanos, self.last_nanos],
            rate_hz,
            topic,
            schema: self.schema,
            encoding: self.encoding,
        }
    }

    fn may_be(&self, schema: &str) -> Option<String> {
        // Foxglove's type names have dots.
        let (_, name) = schema.rsplit_once(['/', '.']).unwrap_or(("", schema));
        let may_be = match name {
            "JointState" | "JointStates" => self.joint_sensors(),
            "DynamicJointState" => "joint sensors".to_owned(),
            "AprilTagDetectionArray" | "AprilTagDetections" | "ArucoMarkers" | "FiducialArray" => {
                with_names("detections of tags", "ids", &self.names)
            }
            "TFMessage" | "FrameTransform" | "FrameTransforms" | "tfMessage" => {
                with_names("poses of a camera, tags or links", "frames", &self.names)
            }
            "CameraInfo" | "CameraCalibration" => "a camera's lens".to_owned(),
            "Image" | "CompressedImage" | "RawImage" | "CompressedVideo" => {
                "images; `calibrate --input` searches png, jpeg and 8-bit images for tags".to_owned()
            }
            _ => return None,
        };
        let is_read = READ.contains(&schema) || decode_detections(schema, &[]).is_some();
        Some(if is_read { may_be } else { format!("{may_be}; armcal does not read the type {schema}") })
    }

    fn joint_sensors(&self) -> String {
        let joints = match self.joints.len() {
            0 => return "joint sensors".to_owned(),
            n if n > MAX_NAMES => format!("{n} joints, {} ..", self.joints[..MAX_NAMES].join(", ")),
            n => format!("{n} joints, {}", self.joints.join(", ")),
        };
        let unit = if self.largest > MAX_RAD { "raw counts or degrees" } else { "radians" };
        format!("joint sensors: {joints}; values look like {unit}, largest {:.4}", self.largest)
    }
}

fn with_names(what: &str, of: &str, names: &BTreeSet<String>) -> String {
    if names.is_empty() {
        return what.to_owned();
    }
    let told: Vec<&str> = names.iter().take(MAX_NAMES).map(String::as_str).collect();
    let more = if names.len() > MAX_NAMES { ", .." } else { "" };
    format!("{what}: {of} {}{more}", told.join(", "))
}

fn known_as(topic: &str, schema: &str) -> Option<&'static str> {
    if let Some(stream) = Stream::ALL.into_iter().find(|stream| stream.topic() == topic) {
        return (plain(stream.schema().name) == plain(schema)).then_some(match stream {
            Stream::JointSensors => "joint readings, counts",
            Stream::JointCommands => "set-points, counts",
            Stream::JointStates => "estimated angles",
            Stream::Detections => "tag detections",
            Stream::Rejects => "rejected candidates of tags",
            Stream::Images => "camera images",
            Stream::OilTemperature => "oil temperature",
            Stream::WaterTemperature => "water temperature",
            Stream::DepthPressure => "depth",
            Stream::VehicleImu => "vehicle attitude",
            Stream::GripperState => "gap between the jaws",
            Stream::GripperCommand => "commanded gap between the jaws",
            Stream::Task => "reach task",
            Stream::TagSurvey => "tag survey",
            Stream::Touch => "touches of surveyed surfaces",
            Stream::Marks => "marks of views and phases",
            Stream::Log => "log",
        });
    }
    match topic {
        topics::ROBOT_DESCRIPTION => Some("URDF, for viewers"),
        topics::CAMERA_INFO => Some("lens, for viewers"),
        topics::TF_STATIC => Some("static frames, for viewers"),
        topics::SCENE => Some("tags and targets, for viewers"),
        topics::IMAGE_MARKS => Some("tags in images, for viewers"),
        _ => None,
    }
}

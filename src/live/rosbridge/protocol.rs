//! Messages of a rosbridge: one JSON object each, with its operation in `op`.

use serde_json::{Value, json};

use super::json::{from_json, spell_as_ros1};
use crate::connection::Rosbridge;
use crate::messages::{BOOL, Bool, Command};
use crate::topics::{Content, contents, read};
use crate::{Connection, Heard, LiveError};
use armcal_core::log::encode;
use armcal_core::log::ros::{AprilTagDetectionArray, CompressedImage, FluidPressure, Imu, JointState, Temperature};
use armcal_core::log::{RosMessage, Stream};
use armcal_core::text::printable;

/// Largest number of values in one message: each takes many bytes of memory for two of text.
const MAX_VALUES: usize = 4 << 20;
/// Largest number of keys in one message: each takes ten times as much memory as a value.
const MAX_KEYS: usize = 200_000;
/// Largest number of characters that are repeated from a text of the other side.
const MAX_SHOWN: usize = 200;

/// Number of messages of a topic that the bridge keeps for us while the line is slow; older ones are dropped.
const QUEUE_LENGTH: usize = 10;
/// Id that marks our own call among the answers.
const STOP_ID: &str = "armcal_stop";

/// Message of the bridge.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Said {
    /// Message on a topic.
    Heard(Content, Heard),
    /// Error or warning of the bridge itself, for people.
    Complaint(String),
    /// Any other valid message.
    Nothing,
}

/// Reader of the bridge's messages.
pub(crate) struct Listener {
    topics: Vec<(Content, String)>,
    names: Vec<String>,
    ros: u32,
}

impl Listener {
    /// Builds the reader; `names` are the driver's, in the robot's order of joints.
    pub fn new(connection: &Connection, bridge: &Rosbridge, names: &[String]) -> Self {
        let topics = contents(connection).into_iter().map(|(content, topic)| (content, topic.to_owned()));
        Self { topics: topics.collect(), names: names.to_vec(), ros: bridge.ros }
    }

    /// Reads one message of the bridge, of any operation.
    pub fn read(&self, text: &str) -> Said {
        let n_bytes = |wanted: u8| text.bytes().filter(|byte| *byte == wanted).count();
        if n_bytes(b',') >= MAX_VALUES {
            return Said::Complaint(format!("it sent a message of {MAX_VALUES} values or more"));
        }
        if n_bytes(b':') >= MAX_KEYS {
            return Said::Complaint(format!("it sent a message of {MAX_KEYS} keys or more"));
        }
        let message: Value = match serde_json::from_str(text) {
            Ok(message) => message,
            Err(error) => return Said::Complaint(format!("it sent what is no JSON: {error}")),
        };
        match message["op"].as_str() {
            Some("publish") => self.published(&message),
            Some("status") => status(&message),
            Some("service_response") => answer(&message),
            op => {
                Said::Complaint(format!("it sent an operation that was not asked for: {}", shown(op.unwrap_or("none"))))
            }
        }
    }

    fn published(&self, message: &Value) -> Said {
        let topic = message["topic"].as_str().unwrap_or("none");
        let Some((content, _)) = self.topics.iter().find(|(_, own)| own == topic) else {
            return Said::Complaint(format!("it sent a message of a topic that was not asked for: {}", shown(topic)));
        };
        let bytes = self.check_spelling(&message["msg"]).and_then(|()| recoded(*content, &message["msg"]));
        let heard = match bytes {
            Ok(bytes) => read(*content, &bytes, &self.names),
            Err(why) => Heard::Unusable(format!("{topic}: {why}")),
        };
        Said::Heard(*content, if let Heard::Unusable(why) = heard { Heard::Unusable(shown(&why)) } else { heard })
    }

    /// Checks that the bridge's ROS is the configured one before any set-point is sent: the wrong one would not
    /// understand the spelling.
    fn check_spelling(&self, message: &Value) -> Result<(), String> {
        let (other, key) = if self.ros == 1 { (2, "sec") } else { (1, "secs") };
        if message["header"]["stamp"].get(key).is_some() {
            return Err(format!("its stamp is one of ROS {other}: set rosbridge.ros = {other}"));
        }
        Ok(())
    }
}

/// Returns a message as the bytes that DDS would have brought.
fn recoded(content: Content, json: &Value) -> Result<Vec<u8>, String> {
    match content {
        Content::Joints => recode::<JointState>(json),
        Content::Deadman => {
            let held: Bool = from_json(json)?;
            encoded(&held)
        }
        Content::Stream(stream) => match stream {
            Stream::Detections => recode::<AprilTagDetectionArray>(json),
            Stream::Images => recode::<CompressedImage>(json),
            Stream::OilTemperature | Stream::WaterTemperature => recode::<Temperature>(json),
            Stream::DepthPressure => recode::<FluidPressure>(json),
            Stream::VehicleImu => recode::<Imu>(json),
            other => Err(format!("{} is no stream of a connection", other.topic())),
        },
    }
}

fn recode<T: RosMessage>(json: &Value) -> Result<Vec<u8>, String> {
    encoded(&from_json::<T>(json)?)
}

fn encoded<T: serde::Serialize>(message: &T) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    encode(message, &mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes)
}

fn status(message: &Value) -> Said {
    let (level, text) = (message["level"].as_str().unwrap_or_default(), message["msg"].as_str().unwrap_or_default());
    match level {
        "error" | "warning" => Said::Complaint(format!("{level}: {}", shown(text))),
        _ => Said::Nothing,
    }
}

/// Reads the answer to the call of the stop service.
fn answer(message: &Value) -> Said {
    let values = &message["values"];
    if message["result"] == true && values["success"] != false {
        return Said::Nothing;
    }
    let service = shown(message["service"].as_str().unwrap_or_default());
    Said::Complaint(format!("the service {service} failed: {}", shown(&values.to_string())))
}

/// Returns the beginning of a text of the other side, as one line.
pub(super) fn shown(text: &str) -> String {
    let line: String = text.chars().take(MAX_SHOWN).map(|c| if c.is_control() { ' ' } else { c }).collect();
    printable(&line).into_owned()
}

/// Returns the first messages to the bridge: subscriptions to the arm's topics, and announcements of our own.
pub(super) fn greeting(connection: &Connection, bridge: &Rosbridge) -> Vec<String> {
    let subscribe = |(content, topic): (Content, &str)| {
        let type_name = bridge.type_name(content.ros_type());
        json!({ "op": "subscribe", "topic": topic, "type": type_name, "queue_length": QUEUE_LENGTH }).to_string()
    };
    let advertise = |topic: &str, ros_type: &str| {
        json!({ "op": "advertise", "topic": topic, "type": bridge.type_name(ros_type) }).to_string()
    };
    let mut all = vec![advertise(&connection.commands.topic, connection.commands.message_type.name())];
    if !connection.stop.topic.is_empty() {
        all.push(advertise(&connection.stop.topic, BOOL));
    }
    all.extend(contents(connection).into_iter().map(subscribe));
    all
}

/// Returns the message of a set-point.
pub(super) fn set_point(connection: &Connection, bridge: &Rosbridge, command: &Command) -> Result<String, LiveError> {
    let message = command.message(connection.commands.message_type)?;
    let mut json =
        serde_json::to_value(&message).map_err(|error| LiveError::rosbridge(&bridge.url, error.to_string()))?;
    if bridge.ros == 1 {
        spell_as_ros1(&mut json);
    }
    Ok(publish(&connection.commands.topic, &json))
}

/// Returns the messages that stop the arm. The topic comes first, because a bridge may wait for the service before it
/// does anything else.
pub(super) fn stop(connection: &Connection) -> Vec<String> {
    let stop = &connection.stop;
    let topic = (!stop.topic.is_empty()).then(|| publish(&stop.topic, &json!({ "data": true })));
    let call = || json!({ "op": "call_service", "id": STOP_ID, "service": stop.service, "args": {} }).to_string();
    topic.into_iter().chain((!stop.service.is_empty()).then(call)).collect()
}

fn publish(topic: &str, message: &Value) -> String {
    json!({ "op": "publish", "topic": topic, "msg": message }).to_string()
}

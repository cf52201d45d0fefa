//! Errors of recordings of a real arm that cannot be used.

use super::map::{JointUnit, SlideUnit};
use crate::codes::{Code, Coded};
use crate::log::{CdrError, LogError, StampRegression};

/// Remedy for two senders of the same joints.
pub const ONE_SENDER: &str = "record one source of the joints only, or remove the messages of the other";

/// A message or a row of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BadPlace {
    /// A message on a topic.
    Message {
        /// Name of the topic as recorded.
        topic: String,
        /// Number on its topic, from 1, in the order of the file.
        message: u64,
    },
    /// A row of a table, from 1, in the order of the file.
    Row(u64),
}

impl std::fmt::Display for BadPlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Message { topic, message } => write!(f, "topic {topic}: message {message}"),
            Self::Row(row) => write!(f, "row {row}"),
        }
    }
}

/// Reason why a recording of a real arm was refused; `file` is the recording.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum InputError {
    #[error(transparent)]
    Log(#[from] LogError),
    #[error("{file}: no message on topic {topic} of the input map; topics there: {found:?}")]
    NoTopic { file: String, topic: String, found: Vec<String> },
    #[error(
        "{file}: topic {topic} holds {found:?}{}; name a topic with {expected}",
        namesake.map_or_else(
            || ", which armcal does not read".to_owned(),
            |other| format!(", whose layout armcal does not know; {other} is another type")
        )
    )]
    Type { file: String, topic: String, found: String, namesake: Option<&'static str>, expected: String },
    #[error("{file}: topic {topic} is encoded as {found:?}, not \"cdr\"; {}", encoding_remedy(found))]
    Encoding { file: String, topic: String, found: String },
    #[error("{file}: {place}: cannot be decoded: {error}")]
    Undecodable { file: String, place: BadPlace, error: CdrError },
    #[error(
        "{file}: topic {topic}: none of its {n} messages is a joint reading: {reasons}; name the topic of \
         sensor_msgs/msg/JointState with name[] and position[]"
    )]
    NoPositions { file: String, topic: String, n: u64, reasons: String },
    #[error(
        "{file}: topic {topic}: {n} of {of} messages have joint `{joint}` twice with different positions: {first:.6} \
         and {second:.6} in message {message}; record one source of `{joint}` only, or remove the \
         messages of the other"
    )]
    JointTwice { file: String, topic: String, joint: String, first: f64, second: f64, message: u64, n: u64, of: u64 },
    #[error(
        "{file}: topic {topic} has two senders that differ: `{joint}` by {apart:.3} {} within {:.0} ms; {ONE_SENDER}",
        if *is_slide { "m" } else { "rad" },
        1e3 * within_s
    )]
    TwoSenders { file: String, topic: String, joint: String, apart: f64, is_slide: bool, within_s: f64 },
    #[error(
        "{file}: {place}: {field} of `{of}` is {value}, not a finite number; set not_finite = \"leave_out\" in the \
         input map to leave such values out"
    )]
    NotFinite { file: String, place: BadPlace, field: &'static str, of: String, value: f64 },
    #[error("{file}: topic {topic}: {disorder}")]
    Disorder { file: String, topic: String, disorder: StampRegression },
    #[error(
        "{file}: topic {topic}: the joints {recorded:?} lack {missing:?} of the robot's {expected:?}; names that \
         differ go into \
         `joint_sensors.names` of the input map"
    )]
    JointNames { file: String, topic: String, recorded: Vec<String>, missing: Vec<String>, expected: Vec<String> },
    #[error(
        "{file}: {} are {}, not {}: `{joint}` is {value:.3}, far outside of its range; set {}",
        whose_numbers(factors),
        likely.name(),
        stated.name(),
        unit_remedy(*likely, factors)
    )]
    Unit {
        file: String,
        joint: String,
        value: f64,
        stated: JointUnit,
        likely: JointUnit,
        /// Factors of the joints that are in the other unit; empty if all joints are.
        factors: Vec<(String, f64)>,
    },
    #[error(
        "{file}: joint `{joint}` has {value:.3}, which LeRobot's {values} cannot be: {} to {}; set `values` of \
         joint_sensors.lerobot in the input map to what was recorded",
        allowed[0],
        allowed[1]
    )]
    Lerobot { file: String, joint: String, value: f64, values: String, allowed: [f64; 2] },
    #[error(
        "{file}: the slides' numbers are {}, not {}: `{joint}` is {value:.3}, far outside of its range; set \
         joint_sensors.slide_unit = \"{}\" in the input map",
        likely.name(),
        stated.name(),
        likely.key()
    )]
    SlideUnit { file: String, joint: String, value: f64, stated: SlideUnit, likely: SlideUnit },
    #[error(
        "{file}: topic {topic}: more than {most} messages of use, which stay in memory; cut the recording into pieces, \
         and give them all"
    )]
    TooLong { file: String, topic: String, most: usize },
    #[error("{file}: topic {topic}: no tag in it: {problem}")]
    NoTags { file: String, topic: String, problem: String },
    #[error("{file}: cannot be read: {source}")]
    Unreadable { file: String, source: std::io::Error },
    #[error("{file}: {problem}")]
    Table { file: String, problem: String },
    #[error("{file}: {place}: {problem}")]
    Row { file: String, place: BadPlace, problem: String },
    #[error("{file}: topic {topic}: the camera's lens {problem}")]
    CameraInfo { file: String, topic: String, problem: String },
    #[error("{file}: topic {topic} holds {held}; `tags.use` of the input map must be {allowed}")]
    Use { file: String, topic: String, held: &'static str, allowed: &'static str },
}

/// Names the joints whose numbers are in another unit.
fn whose_numbers(factors: &[(String, f64)]) -> String {
    let names: Vec<String> = factors.iter().map(|(joint, _)| format!("`{joint}`")).collect();
    if names.is_empty() { "the joints' numbers".to_owned() } else { format!("the numbers of {}", names.join(", ")) }
}

/// Names the keys for numbers in another unit, of all joints or of some.
fn unit_remedy(likely: JointUnit, factors: &[(String, f64)]) -> String {
    let keys: Vec<String> = factors.iter().map(|(joint, factor)| format!("factor.{joint} = {factor:.7}")).collect();
    if keys.is_empty() {
        return format!("joint_sensors.unit = \"{}\" in the input map", likely.key());
    }
    format!("in [joint_sensors] of the input map: {}", keys.join("; "))
}

/// Remedy for messages that are not CDR.
fn encoding_remedy(found: &str) -> String {
    match found {
        "ros1" => format!("start from the ROS 1 bag (.bag) that it was made from: {}", crate::log::ROS1_ADVICE),
        _ => "record the topic as ROS 2 messages, or write the numbers into a table (CSV)".to_owned(),
    }
}

impl Coded for InputError {
    fn code(&self) -> Code {
        match self {
            Self::Log(error) => error.code(),
            Self::NoTopic { .. } => Code::TopicMissing,
            Self::Type { .. } | Self::Encoding { .. } | Self::Use { .. } => Code::MessageType,
            Self::Undecodable { .. } | Self::JointTwice { .. } | Self::TwoSenders { .. } | Self::NotFinite { .. } => {
                Code::MessageInvalid
            }
            Self::NoPositions { .. } => Code::ReadingsMissing,
            Self::Disorder { .. } => Code::StampsDisordered,
            Self::JointNames { .. } => Code::JointsMismatch,
            Self::Unit { .. } | Self::SlideUnit { .. } | Self::Lerobot { .. } => Code::InputUnit,
            Self::TooLong { .. } => Code::RecordingTooLong,
            Self::NoTags { .. } => Code::TagsNotSeen,
            Self::Unreadable { .. } => Code::FileUnreadable,
            Self::Table { .. } | Self::Row { .. } => Code::TableInvalid,
            Self::CameraInfo { .. } => Code::CameraInfoInvalid,
        }
    }
}

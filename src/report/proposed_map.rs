//! A proposed input map: the topics of a recording that hold joint readings, tags and slow sensors. Comments in it give
//! the reason of each choice and the alternatives.

use armcal_core::codes::{Code, Coded};
use std::path::Path;

use armcal_core::input::{ClockDoubt, ClockRemedy, DEFAULT_MAX_GAP_S, compare_clocks, parse_input_map};
use armcal_core::log::{LogError, for_each_raw};
use armcal_core::robot::{Robot, RobotError};
use armcal_core::schema::first_line;
use armcal_core::text::printable;

mod contents;
pub(in crate::report) mod joint_units;
mod joints;
mod tags;

use contents::{Contents, Kind};
use joints::choose_joints;
use tags::choose_tags;

/// Message types of topics that `[tags]` may name.
const TAG_TYPES: &str = "tags (tf2_msgs/msg/TFMessage, AprilTagDetectionArray of apriltag_msgs or \
    isaac_ros_apriltag_interfaces, sensor_msgs images)";

/// Reason that no input map can be proposed.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum ProposalError {
    #[error(transparent)]
    Log(#[from] LogError),
    #[error("{file}: no topic with {what}: the recording has {topics:?}{remedy}")]
    Missing { file: String, what: &'static str, topics: Vec<String>, remedy: &'static str },
    #[error("{file}: {problem}")]
    Joints { file: String, problem: String },
    #[error("{file}: {problem}")]
    Columns { file: String, problem: String },
    #[error("the proposed input map does not read; rename what the message says: {0}")]
    Unreadable(#[from] RobotError),
}

/// The text of an input map for `recording`; with `robot`, joints are matched by name.
///
/// # Errors
/// [`ProposalError`] where the recording lacks joints or tags.
pub fn propose_input_map(recording: &Path, robot: Option<&Robot>) -> Result<String, ProposalError> {
    let mut contents = Contents::default();
    for_each_raw(recording, |raw| contents.take(raw))?;
    let file = recording.display().to_string();
    let missing = |what| {
        let typed = |(name, topic): (&String, &contents::Topic)| format!("{name} ({})", topic.schema);
        let topics = contents.topics.iter().map(typed).collect();
        let remedy = match contents.topics.values().all(|topic| topic.is_cdr) {
            true => "",
            false => "; record them as ROS 2 messages (cdr), or write their numbers into a table (CSV)",
        };
        ProposalError::Missing { file: file.clone(), what, topics, remedy }
    };
    let (joint_topic, joints) = choose_joints(&contents, robot).map_err(|problem| match problem {
        None => missing("joint readings (sensor_msgs/msg/JointState)"),
        Some(problem) => ProposalError::Joints { file: file.clone(), problem },
    })?;
    let (tag_topic, tags) = choose_tags(&contents, robot).ok_or_else(|| missing(TAG_TYPES))?;
    let mut text = format!(
        "{}# Proposed by `armcal inspect --write-input` for {}.\n# Look at each choice; \
         docs/reference/real-arms.md says what the keys mean.\nversion = 1\nkind = \"input\"\n",
        first_line(armcal_core::kind::Kind::Input),
        comment(&file)
    );
    text += "# max_gap_s = 0.5   # a tag message farther than this from any joint reading is left out\n";
    let (above, in_tags) = clocks(&contents, &joint_topic, &tag_topic);
    text += &above;
    text += &joints;
    text += &tags;
    text += &in_tags;
    text += &conditions(&contents);
    parse_input_map(Path::new("proposed input map"), &text)?;
    Ok(text)
}

/// Comment lines about clocks that differ: above the tables, and in `[tags]`.
fn clocks(contents: &Contents, joint_topic: &str, tag_topic: &str) -> (String, String) {
    let times = |name: &str| contents.topics.get(name).map(|topic| topic.times(name));
    let doubt = times(joint_topic)
        .zip(times(tag_topic))
        .and_then(|(joints, tags)| compare_clocks(DEFAULT_MAX_GAP_S, joints, tags));
    let Some(ClockDoubt { text, remedy }) = doubt else { return Default::default() };
    let why = comment(&format!("# {text}"));
    match remedy {
        ClockRemedy::LogTime => (format!("{why}\nstamps = \"log_time\"\n"), String::new()),
        ClockRemedy::Offset(offset_s) => (String::new(), format!("{why}\nclock_offset_s = {offset_s:.3}\n")),
        ClockRemedy::Unknown => (format!("{why}\n"), String::new()),
    }
}

/// Lines of the slow sensors. A thermometer without "oil" in its name may measure anything, so it is only named.
fn conditions(contents: &Contents) -> String {
    let temperatures: Vec<&String> = contents.of_kind(Kind::Temperature).map(|(topic, _)| topic).collect();
    let pressures: Vec<&String> = contents.of_kind(Kind::Pressure).map(|(topic, _)| topic).collect();
    let attitudes: Vec<&String> = contents.of_kind(Kind::Attitude).map(|(topic, _)| topic).collect();
    if temperatures.is_empty() && pressures.is_empty() && attitudes.is_empty() {
        return String::new();
    }
    let is_oil = |topic: &&&String| ["oil", "hydraulic"].iter().any(|word| topic.to_lowercase().contains(word));
    let oil = temperatures.iter().find(is_oil).copied();
    let mut text = "\n[conditions]\n".to_owned();
    text += &line("oil_temperature", oil, "sensor_msgs/msg/Temperature, deg C");
    text += &line("pressure", pressures.first().copied(), "sensor_msgs/msg/FluidPressure, Pa");
    // No recording gives the sensor's link and rotation, and a wrong mount on a link of the arm would do harm.
    if let Some(attitude) = attitudes.first() {
        text += &format!(
            "# attitude = {}   # sensor_msgs/msg/Imu, if it sits on what carries the arm\n\
             # attitude_in_base_wxyz = [1.0, 0.0, 0.0, 0.0]   # how it is turned in the base link\n",
            comment(&quoted(attitude))
        );
    }
    text += &others("other attitude sensors", attitudes.into_iter().skip(1));
    text += &others("other thermometers", temperatures.into_iter().filter(|topic| Some(*topic) != oil));
    text += &others("other pressure gauges", pressures.into_iter().skip(1));
    text
}

fn line(key: &str, topic: Option<&String>, what: &str) -> String {
    topic.map_or_else(String::new, |topic| format!("{key} = {}   # {what}\n", quoted(topic)))
}

/// A comment that names the alternatives to a choice.
fn others<'a>(what: &str, names: impl Iterator<Item = &'a String>) -> String {
    const MOST: usize = 12;
    let names: Vec<&String> = names.collect();
    if names.is_empty() {
        return String::new();
    }
    let told: Vec<String> = names.iter().take(MOST).map(|name| comment(name)).collect();
    let more = if names.len() > MOST { ", .." } else { "" };
    format!("# {what}: {}{more}\n", told.join(", "))
}

/// The text as a quoted TOML string.
pub(in crate::report) fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// The text in one line without control characters.
pub(in crate::report) fn comment(text: &str) -> String {
    printable(text).replace(['\n', '\r', '\t'], " ")
}

impl Coded for ProposalError {
    fn code(&self) -> Code {
        match self {
            Self::Log(error) => error.code(),
            Self::Missing { .. } => Code::TopicMissing,
            Self::Joints { .. } => Code::JointsMismatch,
            Self::Columns { .. } => Code::TableInvalid,
            Self::Unreadable(error) => error.code(),
        }
    }
}

#[cfg(test)]
mod tests;

//! A proposed input map: which topics of a recording are joint readings, tags and slow sensors, with comments on what
//! was chosen and what else is there.

use armcal_core::codes::{Code, Coded};
use std::path::Path;

use armcal_core::input::parse_input_map;
use armcal_core::log::{LogError, for_each_raw};
use armcal_core::robot::{Robot, RobotError};
use armcal_core::text::printable;

mod contents;
mod joints;
mod tags;

use contents::{Contents, Kind};
use joints::choose_joints;
use tags::choose_tags;

/// Why no input map can be proposed.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum ProposalError {
    #[error(transparent)]
    Log(#[from] LogError),
    #[error("{file}: no topic with {what}: the recording has {topics:?}")]
    Missing { file: String, what: &'static str, topics: Vec<String> },
    #[error("{file}: {problem}")]
    Joints { file: String, problem: String },
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
        let topics = contents.topics.keys().cloned().collect();
        ProposalError::Missing { file: file.clone(), what, topics }
    };
    let joints = choose_joints(&contents, robot).map_err(|problem| match problem {
        None => missing("joint readings (sensor_msgs/msg/JointState)"),
        Some(problem) => ProposalError::Joints { file: file.clone(), problem },
    })?;
    let tags = choose_tags(&contents)
        .ok_or_else(|| missing("tags (transforms, apriltag_msgs/msg/AprilTagDetectionArray or sensor_msgs images)"))?;
    let mut text = format!(
        "# Proposed by `armcal inspect --write-input` for {}.\n# Look at each choice; docs/reference/real-arms.md says \
         what the keys mean.\nversion = 1\n",
        comment(&file)
    );
    text += "# max_gap_s = 0.5   # a tag message farther than this from any joint reading is left out\n";
    text += &joints;
    text += &tags;
    text += &conditions(&contents);
    parse_input_map(Path::new("proposed input map"), &text)?;
    Ok(text)
}

/// The slow sensors. A thermometer that is not called after oil may measure anything, so it is only named.
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
    // Where it sits, and how it is turned, no recording tells: one on a link of the arm would do harm.
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

/// A comment that names what else might have been chosen.
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

/// As TOML writes a text.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// One line without control characters.
fn comment(text: &str) -> String {
    printable(text).replace(['\n', '\r', '\t'], " ")
}

impl Coded for ProposalError {
    fn code(&self) -> Code {
        match self {
            Self::Log(error) => error.code(),
            Self::Missing { .. } => Code::TopicMissing,
            Self::Joints { .. } => Code::JointsMismatch,
            Self::Unreadable(error) => error.code(),
        }
    }
}

#[cfg(test)]
mod tests;

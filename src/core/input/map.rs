//! The input map: where in a real arm's recording joint readings and tags are.
//!
//! ```toml
//! version = 1
//! max_gap_s = 0.5                    # optional: a tag message farther from any reading is left out
//! while_moving = "leave_out"         # optional: or "use": what the camera saw while the arm was on its way
//! not_finite = "refuse"              # optional: or "leave_out": NaN and infinities
//! [joint_sensors]
//! topic = "/joint_states"            # sensor_msgs/msg/JointState, position[] = the raw sensor reading
//! names = { elbow = "joint_3" }      # optional: the robot's joint = the recorded name, where they differ
//! [tags]
//! topic = "/tf"                      # tf2_msgs/msg/TFMessage or apriltag_msgs/msg/AprilTagDetectionArray
//! camera_frame = "fisheye"
//! child_frame = "tag36h11:{id}"      # or a plain name, for one landmark
//! use = "position"                   # "position" | "pose" | "corners"
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::robot::{FileIssue, RobotError, parse_toml, read_text};

/// What of a tag's measurement counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TagUse {
    /// Its position in the camera frame.
    Position,
    /// Position and rotation.
    Pose,
    /// The corner pixels.
    Corners,
}

/// What becomes of tags that were seen while the arm moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WhileMoving {
    /// Clocks of arm and camera differ: at 0.1 rad/s some 50 ms are 0.3 deg.
    #[default]
    LeaveOut,
    /// They count as any other.
    Use,
}

/// What becomes of NaN and infinities in joint readings and tags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NotFinite {
    /// The recording is refused with the place of the first one.
    #[default]
    Refuse,
    /// The message (of a joint reading) or the tag is left out and counted.
    LeaveOut,
}

/// How the frames of tags are called.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ChildFrame {
    /// The tag's number stands between the two.
    Numbered {
        /// Text in front of the id; may be empty.
        before: String,
        /// Text behind the id; may be empty.
        after: String,
    },
    /// One landmark.
    Plain(String),
}

impl ChildFrame {
    /// As the input map writes it.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Plain(name) => name.clone(),
            Self::Numbered { before, after } => format!("{before}{{id}}{after}"),
        }
    }

    /// The number of the tag whose frame is called `frame`; 0 for the plain name.
    #[must_use]
    pub fn id_of(&self, frame: &str) -> Option<u32> {
        let frame = without_slash(frame);
        match self {
            Self::Plain(name) => (frame == name).then_some(0),
            Self::Numbered { before, after } => {
                let digits = frame.strip_prefix(before.as_str())?.strip_suffix(after.as_str())?;
                // `parse` would take a sign, too.
                digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())?
            }
        }
    }
}

/// A checked input map.
#[derive(Clone, Debug, PartialEq)]
pub struct InputMap {
    /// Topic of the joint readings, `sensor_msgs/msg/JointState`.
    pub joint_topic: String,
    /// Robot's joint to recorded name, where they differ.
    pub joint_names: BTreeMap<String, String>,
    /// Topic of the tags, `tf2_msgs/msg/TFMessage` or `apriltag_msgs/msg/AprilTagDetectionArray`.
    pub tag_topic: String,
    /// Without a leading slash, as all frames here.
    pub camera_frame: Option<String>,
    /// Names of the tags' frames; `None` with [`TagUse::Corners`] alone.
    pub child_frame: Option<ChildFrame>,
    /// What of a tag's measurement counts.
    pub tag_use: TagUse,
    /// Largest gap between a tag message and the nearest joint reading; a tag farther off is left out.
    pub max_gap_s: f64,
    /// What becomes of tags seen while the arm moved.
    pub while_moving: WhileMoving,
    /// What becomes of NaN and infinities.
    pub not_finite: NotFinite,
}

impl InputMap {
    /// Checks that `joint_sensors.names` are of this robot.
    ///
    /// # Errors
    /// [`FileIssue`] naming `file` and both names.
    pub fn check_robot(&self, file: &Path, joints: &[String]) -> Result<(), FileIssue> {
        match self.joint_names.keys().find(|name| !joints.contains(name)) {
            None => Ok(()),
            Some(name) => {
                let problem = format!("`{name}` is no joint of the robot; it has {joints:?}");
                Err(FileIssue::new(file, "joint_sensors.names", problem))
            }
        }
    }
}

/// Old ROS names begin with a slash; both mean one frame.
pub(super) fn without_slash(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MapToml {
    version: u32,
    #[serde(default = "usual_gap_s")]
    max_gap_s: f64,
    #[serde(default)]
    while_moving: WhileMoving,
    #[serde(default)]
    not_finite: NotFinite,
    joint_sensors: JointsToml,
    tags: TagsToml,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JointsToml {
    topic: String,
    #[serde(default)]
    names: BTreeMap<String, String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TagsToml {
    topic: String,
    camera_frame: Option<String>,
    child_frame: Option<String>,
    #[serde(rename = "use")]
    tag_use: TagUse,
}

/// Assumed: half of what one pose a second leaves.
fn usual_gap_s() -> f64 {
    0.5
}

/// Reads an input map.
///
/// # Errors
/// [`RobotError`] with file, key and allowed range.
pub fn read_input_map(file: &Path) -> Result<InputMap, RobotError> {
    parse_input_map(file, &read_text(file)?)
}

/// The same from a text; `file` names it in errors.
///
/// # Errors
/// As [`read_input_map`].
pub fn parse_input_map(file: &Path, text: &str) -> Result<InputMap, RobotError> {
    let raw: MapToml = parse_toml(file, text)?;
    let issue = |key: &str, problem: &str| FileIssue::new(file, key, problem);
    FileIssue::check_range(file, "version", f64::from(raw.version), 1.0..=1.0)?;
    for (key, topic) in [("joint_sensors.topic", &raw.joint_sensors.topic), ("tags.topic", &raw.tags.topic)] {
        if topic.is_empty() {
            return Err(issue(key, "is empty; name a topic").into());
        }
    }
    if raw.joint_sensors.topic == raw.tags.topic {
        return Err(issue("tags.topic", "is the topic of the joint sensors, too").into());
    }
    let camera_frame = raw.tags.camera_frame.as_deref().map(|frame| without_slash(frame).to_owned());
    let child_frame = raw.tags.child_frame.as_deref().map(|frame| child_frame(file, frame)).transpose()?;
    if raw.tags.tag_use != TagUse::Corners {
        let missing =
            |key: &str| issue(key, "is missing; transforms need it: which frames are the camera's and the tags'");
        if camera_frame.is_none() {
            return Err(missing("tags.camera_frame").into());
        }
        if child_frame.is_none() {
            return Err(missing("tags.child_frame").into());
        }
    }
    if camera_frame.as_deref() == Some("") {
        return Err(issue("tags.camera_frame", "is empty; name a frame").into());
    }
    Ok(InputMap {
        joint_topic: raw.joint_sensors.topic,
        joint_names: raw.joint_sensors.names,
        tag_topic: raw.tags.topic,
        camera_frame,
        child_frame,
        tag_use: raw.tags.tag_use,
        max_gap_s: FileIssue::check_range(file, "max_gap_s", raw.max_gap_s, 1e-6..=60.0)?,
        while_moving: raw.while_moving,
        not_finite: raw.not_finite,
    })
}

fn child_frame(file: &Path, frame: &str) -> Result<ChildFrame, FileIssue> {
    let issue = |problem: &str| FileIssue::new(file, "tags.child_frame", format!("`{frame}` {problem}"));
    let frame = without_slash(frame);
    match frame.split_once("{id}") {
        _ if frame.is_empty() => Err(issue("is empty; name a frame")),
        Some((before, after)) if !before.contains(['{', '}']) && !after.contains(['{', '}']) => {
            Ok(ChildFrame::Numbered { before: before.to_owned(), after: after.to_owned() })
        }
        None if !frame.contains(['{', '}']) => Ok(ChildFrame::Plain(frame.to_owned())),
        _ => Err(issue("is neither a plain name nor one with `{id}` once, such as \"tag36h11:{id}\"")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "version = 1\n[joint_sensors]\ntopic = \"/joint_states\"\n[tags]\ntopic = \"/tf\"\n\
        camera_frame = \"/fisheye\"\nchild_frame = \"tag36h11:{id}\"\nuse = \"position\"\n";

    fn parse(text: &str) -> Result<InputMap, String> {
        parse_input_map(Path::new("map.toml"), text).map_err(|error| error.to_string())
    }

    #[test]
    fn frames_are_told_with_and_without_slash_and_by_number() {
        let map = parse(GOOD).expect("good");
        assert_eq!(map.camera_frame.as_deref(), Some("fisheye"));
        let frame = map.child_frame.expect("a frame");
        assert_eq!(frame.id_of("tag36h11:7"), Some(7));
        assert_eq!(frame.id_of("/tag36h11:12"), Some(12));
        for other in ["tag36h11:", "tag36h11:+7", "tag36h11:7b", "tag25h9:7", "tag36h11:99999999999"] {
            assert_eq!(frame.id_of(other), None, "{other}");
        }
        let plain = parse(&GOOD.replace("tag36h11:{id}", "board")).expect("good").child_frame.expect("a frame");
        assert_eq!((plain.id_of("board"), plain.id_of("/board"), plain.id_of("board2")), (Some(0), Some(0), None));
    }

    #[test]
    fn what_is_wrong_is_named_with_file_and_key() {
        let faults: [(&str, &str, &[&str]); 10] = [
            ("version = 1", "version = 2", &["version", "1 .. 1"]),
            ("version = 1", "version = 1\nmax_gap_s = -1.0", &["max_gap_s", "60"]),
            ("version = 1", "version = 1\nmax_gap_s = nan", &["max_gap_s", "NaN"]),
            ("[tags]", "[tags]\nframe = \"x\"", &["frame", "unknown field"]),
            ("\"position\"", "\"posiiton\"", &["posiiton", "position", "pose", "corners"]),
            ("{id}", "{ids}", &["tags.child_frame", "{ids}"]),
            ("{id}", "{id}{id}", &["tags.child_frame"]),
            ("camera_frame = \"/fisheye\"\n", "", &["tags.camera_frame", "missing"]),
            ("child_frame = \"tag36h11:{id}\"\n", "", &["tags.child_frame", "missing"]),
            ("topic = \"/tf\"", "topic = \"/joint_states\"", &["tags.topic"]),
        ];
        for (from, to, words) in faults {
            assert!(GOOD.contains(from), "{from}");
            let problem = parse(&GOOD.replacen(from, to, 1)).expect_err(to);
            for word in words.iter().chain(&["map.toml"]) {
                assert!(problem.contains(word), "{to}: no `{word}` in {problem}");
            }
        }
    }

    #[test]
    fn corners_need_no_frames() {
        let text = "version = 1\nmax_gap_s = 0.1\nwhile_moving = \"use\"\nnot_finite = \"leave_out\"\n\
            [joint_sensors]\ntopic = \"/a\"\nnames = { elbow = \"j3\" }\n[tags]\ntopic = \"/b\"\nuse = \"corners\"\n";
        let map = parse(text).expect("good");
        assert_eq!((map.camera_frame, map.child_frame, map.max_gap_s), (None, None, 0.1));
        assert_eq!((map.while_moving, map.not_finite), (WhileMoving::Use, NotFinite::LeaveOut));
        assert_eq!(map.joint_names["elbow"], "j3");
    }
}

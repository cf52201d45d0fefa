//! The input map: places of joint readings and tags in a real arm's recording.
//!
//! ```toml
//! version = 1
//! kind = "input"
//! max_gap_s = 0.5                    # optional: largest gap between a tag message and the nearest reading
//! while_moving = "leave_out"         # optional: or "use": tags that were detected while the arm moved
//! not_finite = "refuse"              # optional: or "leave_out": NaN and infinities
//! stamps = "header"                  # optional: or "log_time": the recorder's times, if the senders' clocks differ
//! [joint_sensors]
//! topic = "/joint_states"            # sensor_msgs/msg/JointState, position[] = the raw sensor reading
//! names = { elbow = "joint_3" }      # optional: the robot's joint = the recorded name, if they differ
//! unit = "counts"                    # optional: or "rad", "deg": angles of the sensors by their datasheet
//! slide_unit = "m"                   # optional, with "rad" or "deg": unit of slides, or "mm"
//! factor = { elbow = -1.0 }          # optional, with "rad" or "deg": the angle is factor x (reading - zero)
//! zero = { elbow = 90.0 }            # optional, with "rad" or "deg"
//! # optional: LeRobot's calibration JSON, next to this file; then unit stays "counts", which are the motors' ticks
//! lerobot = { file = "arm.json", motors = "feetech", values = "degrees" }   # or "range_m100_100", "ticks" ..
//! [tags]
//! topic = "/tf"                      # tf2_msgs/msg/TFMessage, apriltag_msgs/msg/AprilTagDetectionArray, or
//!                                    # sensor_msgs/msg/Image or CompressedImage (with use = "corners")
//! clock_offset_s = 0.0               # optional: added to the stamps of this topic: joints' clock less the camera's
//! camera_frame = "fisheye"
//! child_frame = "tag36h11:{id}"      # or a plain name, for one landmark
//! use = "position"                   # "position" | "pose" | "corners" | "board_corners"
//! corner_order = "apriltag"          # optional, only for detections: or "opencv", clockwise from the top left
//! family = "36h11"                   # optional, only for images: or "Standard41h12" ..; absent: the robot's family
//! image_period_s = 0.2               # optional, only for images: time between two that are searched; absent: all
//! camera_info = "/camera_info"       # optional, only for images: sensor_msgs/msg/CameraInfo, if the robot has no lens
//! [[further_tags]]                   # optional: tags of a [[further_camera]] of robot.toml, in the form of [tags]
//! camera = "elbow_camera"            # its name in robot.toml
//! topic = "/tf"
//! camera_frame = "elbow_fisheye"
//! [conditions]                       # optional
//! oil_temperature = "/oil"           # sensor_msgs/msg/Temperature, deg C
//! pressure = "/depth"                # sensor_msgs/msg/FluidPressure, Pa
//! attitude = "/imu"                  # sensor_msgs/msg/Imu of the arm's carrier: direction of up
//! attitude_in_base_wxyz = [1.0, 0.0, 0.0, 0.0]   # optional: rotation of the attitude sensor in the base link
//! ```
//!
//! Tables have columns instead of topics: [`TableLayout`].

use crate::codes::Code;
use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion};
use schemars::JsonSchema;
use serde::Deserialize;

pub use self::joint_keys::JointAngleLines;
use self::joint_keys::{JointsToml, check_name};
pub use self::table::{
    CornerOrder, Direction, PoseColumns, RotationColumns, RotationForm, SeenColumns, TableFormat, TableJoin,
    TableLayout, TagTable, TimeColumn, TimeUnit,
};
use self::table::{TableToml, TagColumnsToml, TagTableToml, TagsOfTable};
pub use self::units::{JointUnit, SlideUnit};
use super::lerobot::LerobotCalibration;
use crate::document::parse_file;
use crate::kind::Kind;
use crate::optics::TagFamily;
use crate::robot::{FileIssue, JointSensorSpec, Robot, RobotError, StatedAngle, read_text};
use crate::schema::schema_of;

mod joint_keys;
mod own_names;
mod table;
mod units;

/// Largest deviation of a quaternion's length from 1.
pub(super) const QUATERNION_LENGTH_TOLERANCE: f64 = 0.01;

/// Part of a tag's measurement that the fit uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TagUse {
    /// Position of the tag in the camera frame.
    Position,
    /// Position and rotation of the tag in the camera frame.
    Pose,
    /// Pixels of the tag's corners.
    Corners,
    /// Pixels of a board's inner corners, by their numbers.
    BoardCorners,
}

impl TagUse {
    /// Returns true if pixels are used, which a lens must convert to directions.
    #[must_use]
    pub fn needs_lens(self) -> bool {
        matches!(self, Self::Corners | Self::BoardCorners)
    }
}

/// Stated noise of a tag's pose in the camera frame, standard deviation per axis, including the part that all tags of a
/// view share.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TagNoise {
    /// Noise of the position in the camera frame, m.
    pub position_std_m: f64,
    /// Noise of the camera's direction: it moves a tag by this angle times its distance. `None`: not stated.
    pub rotation_std_rad: Option<f64>,
}

/// Use of tags that were detected while the arm moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WhileMoving {
    /// Such tags are left out, because clocks of arm and camera differ: at 0.1 rad/s about 50 ms are 0.3 deg.
    #[default]
    LeaveOut,
    /// Such tags are used like all others.
    Use,
}

/// Use of NaN and infinities in joint readings and tags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NotFinite {
    /// The recording is refused; the error names the first occurrence.
    #[default]
    Refuse,
    /// The message (of a joint reading) or the tag is left out and counted.
    LeaveOut,
}

/// Time of a message that is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StampSource {
    /// The stamp in the header, by the sender's clock; the log time if that is zero.
    #[default]
    Header,
    /// The log time, by the recorder's clock.
    LogTime,
}

/// Names of the tags' frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ChildFrame {
    /// Name with the tag's id between two texts.
    Numbered {
        /// Text before the id; may be empty.
        before: String,
        /// Text after the id; may be empty.
        after: String,
    },
    /// Name of the frame of a single landmark.
    Plain(String),
}

impl ChildFrame {
    /// Returns the name as the input map writes it.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Plain(name) => name.clone(),
            Self::Numbered { before, after } => format!("{before}{{id}}{after}"),
        }
    }

    /// Returns the id of the tag whose frame is called `frame`; 0 for the plain name.
    #[must_use]
    pub fn id_of(&self, frame: &str) -> Option<u32> {
        let frame = without_slash(frame);
        match self {
            Self::Plain(name) => (frame == name).then_some(0),
            Self::Numbered { before, after } => {
                let digits = frame.strip_prefix(before.as_str())?.strip_suffix(after.as_str())?;
                // `parse` would also accept a sign.
                digits.bytes().all(|byte| byte.is_ascii_digit()).then(|| digits.parse().ok())?
            }
        }
    }
}

/// Quantity that a slow sensor measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ConditionKind {
    /// Temperature of the oil, degrees Celsius.
    OilTemperature,
    /// Ambient pressure, absolute, Pa.
    Pressure,
}

/// Topics of slow sensors.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConditionTopics {
    /// Temperature of the oil, `sensor_msgs/msg/Temperature`.
    pub oil_temperature: Option<String>,
    /// Ambient pressure, `sensor_msgs/msg/FluidPressure`.
    pub pressure: Option<String>,
    /// Attitude of the arm's carrier, `sensor_msgs/msg/Imu`.
    pub attitude: Option<String>,
    /// Rotation base_from_sensor of the attitude sensor, as written; absent: aligned with the base link.
    attitude_in_base_wxyz: Option<[f64; 4]>,
}

impl ConditionTopics {
    /// Returns the topics that are given.
    pub(super) fn named(&self) -> Vec<(&String, ConditionKind)> {
        let oil = self.oil_temperature.iter().map(|topic| (topic, ConditionKind::OilTemperature));
        oil.chain(self.pressure.iter().map(|topic| (topic, ConditionKind::Pressure))).collect()
    }
}

/// Topics of the data in a ROS recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Topics {
    /// Joint readings, `sensor_msgs/msg/JointState`.
    pub joints: String,
    /// Tags, `tf2_msgs/msg/TFMessage` or `apriltag_msgs/msg/AprilTagDetectionArray`, or images.
    pub tags: String,
    /// Frame of the camera without a leading slash, like all frames here.
    pub camera_frame: Option<String>,
    /// The camera's lens, `sensor_msgs/msg/CameraInfo`, for a robot that has none.
    pub camera_info: Option<String>,
    /// Seconds added to the header stamps of the tags, also those of further cameras.
    pub clock_offset_s: f64,
    /// Minimum time between two images that are searched, s.
    pub image_period_s: f64,
    /// Topics of the tags of further cameras.
    pub further: Vec<FurtherTopic>,
    /// Topics of slow sensors; boxed for their size.
    pub conditions: Box<ConditionTopics>,
    /// Rotation of the attitude sensor in the base link.
    pub base_from_attitude: UnitQuaternion<f64>,
}

impl Topics {
    /// Checks that the topics of cameras are not also those of joints or slow sensors.
    fn check_further(&self, file: &Path) -> Result<(), FileIssue> {
        let conditions = self.conditions.named().into_iter().map(|(topic, _)| topic).chain(&self.conditions.attitude);
        let others: Vec<&String> = conditions.chain([&self.joints]).collect();
        match self.further.iter().find(|further| others.contains(&&further.topic)) {
            Some(FurtherTopic { topic, .. }) => {
                let problem = format!("is `{topic}`, which is named for something else, too");
                Err(FileIssue::new(Code::ValueDuplicate, file, "further_tags.topic", problem))
            }
            None => Ok(()),
        }
    }
}

/// Topic of the tags of a further camera, in the form of the first camera's.
#[derive(Clone, Debug, PartialEq)]
pub struct FurtherTopic {
    /// Name of a further camera in robot.toml.
    pub camera: String,
    /// Topic of this camera's tags, which may be that of the first camera.
    pub topic: String,
    /// Frame of this camera, without a leading slash.
    pub camera_frame: Option<String>,
}

/// Source of the data.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// Messages of a ROS recording.
    Topics(Topics),
    /// Columns of a table; boxed for its size.
    Table(Box<TableLayout>),
}

/// A checked input map.
#[derive(Clone, Debug, PartialEq)]
pub struct InputMap {
    /// Topics or columns.
    pub source: Source,
    /// Recorded name of each joint of the robot, if they differ.
    pub joint_names: BTreeMap<String, String>,
    /// Unit of the recorded numbers of the joints.
    pub joint_unit: JointUnit,
    /// Lines from readings to angles, if `joint_unit` is a unit of angles.
    pub joint_lines: JointAngleLines,
    /// LeRobot's calibration, which converts its numbers to ticks.
    pub lerobot: Option<LerobotCalibration>,
    /// Names of the tags' frames; `None` only with [`TagUse::Corners`].
    pub child_frame: Option<ChildFrame>,
    /// Family of the tags in images; `None`: the family of the robot's tags.
    pub tag_family: Option<TagFamily>,
    /// Part of a tag's measurement that the fit uses.
    pub tag_use: TagUse,
    /// Order of the corners in recorded detections.
    pub corner_order: CornerOrder,
    /// Stated noise of positions and poses of tags, if there is one.
    pub tag_noise: Option<TagNoise>,
    /// Largest gap between a tag message and the nearest joint reading, s; tags with a larger gap are left out.
    pub max_gap_s: f64,
    /// Use of tags that were detected while the arm moved.
    pub while_moving: WhileMoving,
    /// Use of NaN and infinities.
    pub not_finite: NotFinite,
    /// Time of a message that is used.
    pub stamps: StampSource,
}

impl InputMap {
    /// Checks that the joints of `joint_sensors` and the cameras of `further_tags` exist on this robot. Also checks
    /// that each joint has a recorded name of its own.
    ///
    /// # Errors
    /// [`FileIssue`] naming `file`, the unknown name and the robot's names.
    pub fn check_robot(&self, file: &Path, robot: &Robot) -> Result<(), FileIssue> {
        self.joint_names.keys().try_for_each(|name| check_name(file, "names", name, robot))?;
        self.joint_lines.check_robot(file, robot)?;
        if let Some(problem) = self.shared_name(robot) {
            return Err(FileIssue::new(Code::ValueDuplicate, file, "joint_sensors.names", problem));
        }
        if let Some(lerobot) = &self.lerobot {
            let mut sensors = robot.sensors.iter();
            sensors.try_for_each(|spec| lerobot.check_joint(self.recorded_name(&spec.joint), spec))?;
        }
        let cameras: Vec<&String> = robot.further_cameras.iter().map(|camera| &camera.name).collect();
        match self.further().iter().find(|further| !cameras.contains(&&further.camera)) {
            None => Ok(()),
            Some(FurtherTopic { camera, .. }) => {
                let problem = format!("`{camera}` is no [[further_camera]] of robot.toml; it has {cameras:?}");
                Err(FileIssue::new(Code::NameUnknown, file, "further_tags.camera", problem))
            }
        }
    }

    /// Returns the raw reading of a recorded number.
    pub(super) fn counts(&self, spec: &JointSensorSpec, value: f64) -> f64 {
        if let Some(lerobot) = &self.lerobot {
            return lerobot.tick(self.recorded_name(&spec.joint), value);
        }
        let Some(stated) = self.stated(spec) else { return value };
        spec.offset_counts + spec.counts_per_rad * stated.angle_rad(value)
    }

    /// Line from a joint's readings to its angle; `None` if they are counts.
    #[must_use]
    pub fn stated(&self, spec: &JointSensorSpec) -> Option<StatedAngle> {
        self.joint_lines.of(self.joint_unit, spec)
    }

    /// Returns the topics of the tags of further cameras.
    #[must_use]
    pub fn further(&self) -> &[FurtherTopic] {
        match &self.source {
            Source::Topics(topics) => &topics.further,
            Source::Table(_) => &[],
        }
    }

    /// Returns the recorded name of the robot's joint `joint`.
    #[must_use]
    pub fn recorded_name<'a>(&'a self, joint: &'a String) -> &'a String {
        self.joint_names.get(joint).unwrap_or(joint)
    }
}

/// Offsets of clocks that fit ROS times, the years 1901 to 2038, s.
const CLOCK_OFFSETS_S: std::ops::RangeInclusive<f64> = -4.3e9..=4.3e9;

/// Returns the frame without the leading slash of old ROS names; both mean one frame.
pub(super) fn without_slash(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MapToml {
    #[serde(rename = "version")]
    _version: u32,
    #[serde(rename = "kind")]
    _kind: Option<Kind>,
    /// Largest gap between a tag message and the nearest joint reading; tags with a larger gap are left out.
    #[serde(default = "usual_gap_s")]
    #[schemars(range(min = 1e-6, max = 60.0))]
    max_gap_s: f64,
    /// Use of tags that were seen while the arm moved.
    #[serde(default)]
    while_moving: WhileMoving,
    /// Use of readings and tags that are not finite.
    #[serde(default)]
    not_finite: NotFinite,
    /// Time of a message.
    #[serde(default)]
    stamps: StampSource,
    /// Table of the joints (and tags), instead of a recording.
    #[serde(default)]
    table: Option<TableToml>,
    /// Joint readings.
    joint_sensors: JointsToml,
    /// Tags that the camera saw.
    tags: TagsToml,
    /// Tags that further cameras saw.
    #[serde(default)]
    further_tags: Vec<FurtherTagsToml>,
    /// Topics of temperature, pressure and attitude.
    #[serde(default)]
    conditions: ConditionTopics,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FurtherTagsToml {
    /// Name of a [[further_camera]] of robot.toml.
    camera: String,
    /// Topic of this camera's tags.
    topic: String,
    /// Frame of that camera.
    camera_frame: Option<String>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TagsToml {
    /// Topic of transforms, detections or images.
    topic: Option<String>,
    /// Table of the tags, if the joints are in another one.
    table: Option<TagTableToml>,
    /// Frame of the camera in the transforms.
    camera_frame: Option<String>,
    /// Frame of a tag, such as `tag36h11:{id}`, or the plain name of one landmark.
    child_frame: Option<String>,
    /// Order of a tag's corners in detections; of a table, in `columns`.
    corner_order: Option<CornerOrder>,
    /// Part of a tag's measurement that counts.
    #[serde(rename = "use")]
    tag_use: TagUse,
    /// Columns of a table.
    #[serde(default)]
    columns: Option<TagColumnsToml>,
    /// Family of the tags in images; absent: that of the robot's tags.
    family: Option<String>,
    /// Minimum time between two images that are searched; 0: all.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 3600.0))]
    image_period_s: f64,
    /// Topic of sensor_msgs/msg/CameraInfo, for a robot without a lens.
    camera_info: Option<String>,
    /// Seconds added to the stamps of the tags: joints' clock less the camera's.
    #[serde(default)]
    #[schemars(range(min = -4.3e9, max = 4.3e9))]
    clock_offset_s: f64,
    /// Noise of a tag's position, standard deviation per axis.
    #[schemars(range(min = 1e-7, max = 10.0))]
    position_std_m: Option<f64>,
    /// Noise of a tag's attitude, standard deviation per axis.
    #[schemars(range(min = 1e-7, max = 3.0))]
    rotation_std_rad: Option<f64>,
}

impl TagsToml {
    fn noise(&self, file: &Path) -> Result<Option<TagNoise>, FileIssue> {
        let stated = [("position_std_m", self.position_std_m, 10.0), ("rotation_std_rad", self.rotation_std_rad, 3.0)];
        if let Some((key, ..)) = stated.iter().find(|(_, value, _)| value.is_some() && self.tag_use.needs_lens()) {
            let problem = "is for positions and poses; the noise of corners is camera.corner_std_px of robot.toml";
            return Err(FileIssue::new(Code::KeysConflict, file, format!("tags.{key}"), problem));
        }
        for (key, value, most) in stated {
            value.map(|value| FileIssue::check_range(file, &format!("tags.{key}"), value, 1e-7..=most)).transpose()?;
        }
        let rotation_std_rad = self.rotation_std_rad;
        match (self.position_std_m, rotation_std_rad) {
            (None, Some(_)) => {
                let problem = "is missing; rotation_std_rad is given, and needs it";
                Err(FileIssue::new(Code::KeyMissing, file, "tags.position_std_m", problem))
            }
            (position_std_m, _) => {
                Ok(position_std_m.map(|position_std_m| TagNoise { position_std_m, rotation_std_rad }))
            }
        }
    }
}

/// Default of `max_gap_s`, s. Assumed: half the interval of one pose per second.
pub const DEFAULT_MAX_GAP_S: f64 = 0.5;

fn usual_gap_s() -> f64 {
    DEFAULT_MAX_GAP_S
}

/// Returns the schema of an input map.
#[must_use]
pub fn input_schema() -> serde_json::Value {
    schema_of::<MapToml>(Kind::Input)
}

/// Reads an input map.
///
/// # Errors
/// [`RobotError`] with file, key and allowed range.
pub fn read_input_map(file: &Path) -> Result<InputMap, RobotError> {
    let raw: MapToml = parse_file(Kind::Input, file, &read_text(file)?)?;
    let lerobot = raw.joint_sensors.lerobot.clone();
    let map = checked(file, raw)?;
    let lerobot = lerobot.map(|lerobot| LerobotCalibration::read(file, &lerobot)).transpose()?;
    Ok(InputMap { lerobot, ..map })
}

/// Parses the text of an input map; `file` names it in errors. LeRobot's JSON, which the map may name, is not read.
/// # Errors
/// The errors of [`read_input_map`].
pub fn parse_input_map(file: &Path, text: &str) -> Result<InputMap, RobotError> {
    checked(file, parse_file(Kind::Input, file, text)?)
}

fn checked(file: &Path, raw: MapToml) -> Result<InputMap, RobotError> {
    let child_frame = raw.tags.child_frame.as_deref().map(|frame| child_frame(file, frame)).transpose()?;
    let family = |text: &String| {
        text.parse().map_err(|problem: String| FileIssue::new(Code::NameUnknown, file, "tags.family", problem))
    };
    let tag_family = raw.tags.family.as_ref().map(family);
    if raw.table.is_some() {
        check_no_topics(file, &raw)?;
    }
    if raw.tags.corner_order.is_some() && raw.tags.tag_use != TagUse::Corners {
        let problem = "is for corners of tags; set use = \"corners\"";
        return Err(FileIssue::new(Code::KeysConflict, file, "tags.corner_order", problem).into());
    }
    if raw.tags.tag_use == TagUse::BoardCorners && !matches!(child_frame, Some(ChildFrame::Plain(_))) {
        let problem = "must be the plain name of the board in the tag map; its corners have numbers of their own";
        return Err(FileIssue::new(Code::ValueInvalid, file, "tags.child_frame", problem).into());
    }
    if raw.joint_sensors.lerobot.is_some() && raw.joint_sensors.unit != JointUnit::Counts {
        let problem = "is for numbers without `lerobot`, which says what they are by its `values`; leave one out";
        return Err(FileIssue::new(Code::KeysConflict, file, "joint_sensors.unit", problem).into());
    }
    let joint_lines = JointAngleLines::checked(file, &raw.joint_sensors)?;
    let tag_noise = raw.tags.noise(file)?;
    let source = match raw.table {
        Some(table) => {
            let clock_offset_s = clock_offset(file, &raw.tags)?;
            let (tag_use, child_frame) = (raw.tags.tag_use, child_frame.as_ref());
            let tags = TagsOfTable { tag_use, child_frame, table: raw.tags.table, clock_offset_s };
            Source::Table(Box::new(table::layout(file, table, raw.tags.columns, tags)?))
        }
        None => {
            let further = further(file, &raw.tags, raw.further_tags)?;
            let topics = Topics { further, ..topics(file, &raw.joint_sensors, &raw.tags, raw.conditions)? };
            topics.check_further(file)?;
            Source::Topics(topics)
        }
    };
    Ok(InputMap {
        source,
        joint_names: raw.joint_sensors.names,
        joint_unit: raw.joint_sensors.unit,
        joint_lines,
        lerobot: None,
        child_frame,
        tag_family: tag_family.transpose()?,
        tag_use: raw.tags.tag_use,
        corner_order: raw.tags.corner_order.unwrap_or_default(),
        tag_noise,
        max_gap_s: FileIssue::check_range(file, "max_gap_s", raw.max_gap_s, 1e-6..=60.0)?,
        while_moving: raw.while_moving,
        not_finite: raw.not_finite,
        stamps: raw.stamps,
    })
}

fn check_no_topics(file: &Path, raw: &MapToml) -> Result<(), FileIssue> {
    let given = [
        ("joint_sensors.topic", &raw.joint_sensors.topic),
        ("tags.topic", &raw.tags.topic),
        ("tags.camera_frame", &raw.tags.camera_frame),
        ("tags.family", &raw.tags.family),
        ("tags.camera_info", &raw.tags.camera_info),
        ("conditions.oil_temperature", &raw.conditions.oil_temperature),
        ("conditions.pressure", &raw.conditions.pressure),
        ("conditions.attitude", &raw.conditions.attitude),
    ];
    let given = given.into_iter().find(|(_, value)| value.is_some()).map(|(key, _)| key);
    let given = given.or(raw.tags.corner_order.is_some().then_some("tags.corner_order"));
    match given.or((!raw.further_tags.is_empty()).then_some("further_tags")) {
        Some(key) => Err(FileIssue::new(
            Code::KeysConflict,
            file,
            key,
            "is for recordings; a [table] has columns. Leave one out",
        )),
        None => Ok(()),
    }
}

/// Returns the topics of the further cameras. Each camera occurs once, distinguished from the others by its topic or
/// its frame.
fn further(file: &Path, first: &TagsToml, raw: Vec<FurtherTagsToml>) -> Result<Vec<FurtherTopic>, FileIssue> {
    let mut seen = vec![(first.topic.clone().unwrap_or_default(), first.camera_frame.clone())];
    let mut found: Vec<FurtherTopic> = Vec::with_capacity(raw.len());
    for FurtherTagsToml { camera, topic, camera_frame } in raw {
        let issue = |key: &str, problem: &str| {
            Err(FileIssue::new(Code::ValueDuplicate, file, format!("further_tags.{key}"), problem))
        };
        if found.iter().any(|other| other.camera == camera) {
            return issue("camera", &format!("names `{camera}` twice"));
        }
        if topic.is_empty() || camera_frame.as_deref() == Some("") {
            return issue(if topic.is_empty() { "topic" } else { "camera_frame" }, "is empty; name one");
        }
        if camera_frame.is_none() && !first.tag_use.needs_lens() {
            return issue("camera_frame", "is missing; transforms need it: which frame is this camera's");
        }
        let camera_frame = camera_frame.as_deref().map(|frame| without_slash(frame).to_owned());
        let is_same = |(of, frame): &(String, Option<String>)| {
            let both = frame.as_deref().map(without_slash).zip(camera_frame.as_deref());
            *of == topic && both.is_none_or(|(a, b)| a == b)
        };
        if seen.iter().any(is_same) {
            let problem =
                "belongs to another camera with the same camera_frame, or with none, so they cannot be distinguished";
            return issue("topic", problem);
        }
        seen.push((topic.clone(), camera_frame.clone()));
        found.push(FurtherTopic { camera, topic, camera_frame });
    }
    Ok(found)
}

fn clock_offset(file: &Path, tags: &TagsToml) -> Result<f64, FileIssue> {
    FileIssue::check_range(file, "tags.clock_offset_s", tags.clock_offset_s, CLOCK_OFFSETS_S)
}

fn topics(file: &Path, joints: &JointsToml, tags: &TagsToml, conditions: ConditionTopics) -> Result<Topics, FileIssue> {
    let issue = |key: &str, problem: &str| Err(FileIssue::new(Code::ValueInvalid, file, key, problem));
    let topic = |key: &str, topic: &Option<String>| match topic.as_deref() {
        Some("") => issue(key, "is empty; name a topic").map(|()| String::new()),
        Some(topic) => Ok(topic.to_owned()),
        None => issue(key, "is missing; name a topic, or give a [table]").map(|()| String::new()),
    };
    let camera_frame = tags.camera_frame.as_deref().map(|frame| without_slash(frame).to_owned());
    let found = Topics {
        joints: topic("joint_sensors.topic", &joints.topic)?,
        tags: topic("tags.topic", &tags.topic)?,
        camera_frame,
        camera_info: tags.camera_info.clone(),
        clock_offset_s: clock_offset(file, tags)?,
        image_period_s: FileIssue::check_range(file, "tags.image_period_s", tags.image_period_s, 0.0..=3600.0)?,
        base_from_attitude: base_from_attitude(file, &conditions)?,
        further: Vec::new(),
        conditions: Box::new(conditions),
    };
    if found.joints == found.tags {
        issue("tags.topic", "is the topic of the joint sensors, too")?;
    }
    let mut named: Vec<&String> = found.conditions.named().into_iter().map(|(topic, _)| topic).collect();
    named.extend([&found.joints, &found.tags].into_iter().chain(&found.conditions.attitude));
    named.sort_unstable();
    if named[0].is_empty() || named.windows(2).any(|two| two[0] == two[1]) {
        issue("conditions", "has an empty topic, or one that is named twice")?;
    }
    if let Some(key) = tags.columns.as_ref().map(|_| "columns").or(tags.table.as_ref().map(|_| "table")) {
        issue(&format!("tags.{key}"), "is for a [table], which the input map lacks")?;
    }
    if found.camera_frame.as_deref() == Some("") {
        issue("tags.camera_frame", "is empty; name a frame")?;
    }
    let frames = [("tags.camera_frame", &tags.camera_frame), ("tags.child_frame", &tags.child_frame)];
    let absent = frames.into_iter().find(|(_, frame)| !tags.tag_use.needs_lens() && frame.is_none());
    if let Some((key, _)) = absent {
        issue(key, "is missing; transforms need it: which frames are the camera's and the tags'")?;
    }
    Ok(found)
}

fn base_from_attitude(file: &Path, conditions: &ConditionTopics) -> Result<UnitQuaternion<f64>, FileIssue> {
    let issue =
        |problem: &str| Err(FileIssue::new(Code::KeyMissing, file, "conditions.attitude_in_base_wxyz", problem));
    let Some([w, x, y, z]) = conditions.attitude_in_base_wxyz else { return Ok(UnitQuaternion::identity()) };
    let quaternion = Quaternion::new(w, x, y, z);
    let is_unit = (quaternion.norm() - 1.0).abs() <= QUATERNION_LENGTH_TOLERANCE;
    match (is_unit, &conditions.attitude) {
        (true, Some(_)) => Ok(UnitQuaternion::from_quaternion(quaternion)),
        (true, None) => issue("turns an attitude sensor; name its topic as conditions.attitude"),
        (false, _) => issue("is no rotation; a quaternion w, x, y, z has the length 1, within 1 %"),
    }
}

fn child_frame(file: &Path, frame: &str) -> Result<ChildFrame, FileIssue> {
    let issue =
        |problem: &str| FileIssue::new(Code::ValueInvalid, file, "tags.child_frame", format!("`{frame}` {problem}"));
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
mod tests;

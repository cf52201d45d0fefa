//! The connection map arm.toml: contents of the topics, and limits at which the guard stops the arm.

mod bridge;

use armcal_core::codes::Code;
use std::collections::BTreeMap;
use std::net::Ipv4Addr;
use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

pub use bridge::Rosbridge;

use crate::LiveError;
use armcal_core::document::{VERSION, parse_file};
use armcal_core::kind::Kind;
use armcal_core::log::topics;
use armcal_core::robot::{FileIssue, RobotError, read_text};
use armcal_core::schema::schema_of;

/// The connection map of an arm.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Connection {
    /// Version of this file's layout: 1.
    pub version: u32,
    /// Kind of this file: [`Kind::Arm`].
    pub kind: Kind,
    /// Number of the ROS domain (ROS_DOMAIN_ID).
    #[schemars(range(min = 0, max = 232))]
    pub domain: u16,
    /// Addresses of this machine's interfaces that DDS may use; all of them if the list is empty. The sockets stay open
    /// to every interface.
    pub networks: Vec<Ipv4Addr>,
    /// Rosbridge through which the arm is reached, instead of DDS.
    pub rosbridge: Option<Rosbridge>,
    /// Topic of the joint sensors: `sensor_msgs/msg/JointState` with raw counts in `position`.
    pub joint_sensors: String,
    /// The driver's joint names, keyed by the names in the robot's file, where they differ.
    pub names: BTreeMap<String, String>,
    /// Topic, type and rate of the set-points.
    pub commands: Commands,
    /// Topic of tag detections: `apriltag_msgs/msg/AprilTagDetectionArray`; empty if there is none.
    pub detections: String,
    /// Topic of images: `sensor_msgs/msg/CompressedImage`, JPEG; empty if there is none. They are searched for tags if
    /// `detections` is empty.
    pub images: String,
    /// Topic of the oil temperature: `sensor_msgs/msg/Temperature`; empty if there is none.
    pub oil_temperature: String,
    /// Topic of the water temperature: `sensor_msgs/msg/Temperature`; empty if there is none.
    pub water_temperature: String,
    /// Topic of the depth sensor's pressure: `sensor_msgs/msg/FluidPressure`; empty if there is none.
    pub pressure: String,
    /// Topic of the vehicle's IMU: `sensor_msgs/msg/Imu`; empty if there is none.
    pub imu: String,
    /// Topic and service that stop the arm.
    pub stop: StopWays,
    /// Dead man's switch; `None` if nobody has to hold one.
    pub deadman: Option<Deadman>,
    /// Limits of the guard.
    pub guard: GuardLimits,
}

impl Default for Connection {
    fn default() -> Self {
        let topic = str::to_owned;
        Self {
            version: VERSION,
            kind: Kind::Arm,
            domain: 0,
            networks: Vec::new(),
            rosbridge: None,
            joint_sensors: topic(topics::JOINT_SENSORS),
            names: BTreeMap::new(),
            commands: Commands::default(),
            detections: topic(topics::DETECTIONS),
            images: topic(topics::IMAGES),
            oil_temperature: topic(topics::OIL_TEMPERATURE),
            water_temperature: topic(topics::WATER_TEMPERATURE),
            pressure: topic(topics::DEPTH_PRESSURE),
            imu: topic(topics::VEHICLE_IMU),
            stop: StopWays::default(),
            deadman: None,
            guard: GuardLimits::default(),
        }
    }
}

/// Topic of the set-points, which are in raw counts.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Commands {
    /// Name of the topic.
    pub topic: String,
    /// Type of the messages.
    #[serde(rename = "type")]
    pub message_type: CommandType,
    /// Rate of the set-points by the arm's clock, Hz.
    #[schemars(range(min = 5.0, max = 1000.0))]
    pub rate_hz: f64,
}

impl Default for Commands {
    fn default() -> Self {
        let (topic, message_type) = (topics::JOINT_COMMANDS.to_owned(), CommandType::JointTrajectory);
        Self { topic, message_type, rate_hz: 50.0 }
    }
}

/// Message types in which drivers take set-points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum CommandType {
    /// Trajectory of one point, which is to be reached one period later.
    #[serde(rename = "trajectory_msgs/msg/JointTrajectory", alias = "trajectory_msgs/JointTrajectory")]
    JointTrajectory,
    /// Values in `data` without names, in the joint order of the robot's file.
    #[serde(rename = "std_msgs/msg/Float64MultiArray", alias = "std_msgs/Float64MultiArray")]
    Float64MultiArray,
    /// Set-points in `position`, as in our recordings.
    #[serde(rename = "sensor_msgs/msg/JointState", alias = "sensor_msgs/JointState")]
    JointState,
}

impl CommandType {
    /// Returns the type's name as ROS 2 writes it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::JointTrajectory => "trajectory_msgs/msg/JointTrajectory",
            Self::Float64MultiArray => "std_msgs/msg/Float64MultiArray",
            Self::JointState => "sensor_msgs/msg/JointState",
        }
    }
}

/// Topic and service that stop the arm; each one that is named is used.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StopWays {
    /// Topic that stops the arm: `std_msgs/msg/Bool`, true; empty if there is none.
    pub topic: String,
    /// Service that stops the arm: `std_srvs/srv/Trigger`; empty if there is none.
    pub service: String,
    /// Mapping of services to DDS that the server of `service` uses.
    pub mapping: ServiceMapping,
}

impl Default for StopWays {
    fn default() -> Self {
        Self { topic: "/stop".to_owned(), service: String::new(), mapping: ServiceMapping::Enhanced }
    }
}

/// Mapping of services to DDS.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ServiceMapping {
    /// Mapping of Fast DDS and others.
    Enhanced,
    /// Mapping of Cyclone DDS.
    Cyclone,
}

/// Switch that somebody holds as long as the arm may move.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deadman {
    /// Topic of the switch: `std_msgs/msg/Bool`.
    pub topic: String,
    /// Largest age of the last `true`, s; the arm stops when it is older.
    #[schemars(range(min = 0.05, max = 10.0))]
    pub timeout_s: f64,
}

/// Limits at which the guard stops the arm.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GuardLimits {
    /// Longest wait for the first readings, s.
    #[schemars(range(min = 0.1, max = 600.0))]
    pub connect_s: f64,
    /// Time for which readings must be sound and the arm at rest before anything moves, s.
    #[schemars(range(min = 0.5, max = 60.0))]
    pub ready_s: f64,
    /// Longest gap between readings, s.
    #[schemars(range(min = 0.02, max = 5.0))]
    pub stale_s: f64,
    /// Largest distance of a joint from its set-point, deg.
    #[schemars(range(min = 0.5, max = 180.0))]
    pub tracking_deg: f64,
    /// Longest time for which a joint may exceed `tracking_deg`, s by the arm's clock.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub tracking_s: f64,
    /// Longest time for which all readings may stay the same to the count while set-points move, s.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub frozen_s: f64,
    /// Largest jump of the arm's clock between two readings, s.
    #[schemars(range(min = 0.05, max = 60.0))]
    pub clock_step_s: f64,
}

impl Default for GuardLimits {
    fn default() -> Self {
        Self {
            connect_s: 10.0,
            ready_s: 2.0,
            stale_s: 0.25,
            tracking_deg: 20.0,
            tracking_s: 1.0,
            frozen_s: 1.0,
            clock_step_s: 0.5,
        }
    }
}

/// Returns the schema of a connection map.
#[must_use]
pub fn arm_schema() -> serde_json::Value {
    schema_of::<Connection>(Kind::Arm)
}

impl Connection {
    /// Reads and checks a connection map.
    ///
    /// # Errors
    /// [`LiveError::File`] with file, key and allowed range.
    pub fn load(file: &Path) -> Result<Self, LiveError> {
        Ok(Self::parse(file, &read_text(file)?)?)
    }

    /// Reads and checks the text of a connection map; `file` is named where it is wrong.
    ///
    /// # Errors
    /// [`RobotError`] with file, key and allowed range.
    pub fn parse(file: &Path, text: &str) -> Result<Self, RobotError> {
        let connection: Self = parse_file(Kind::Arm, file, text)?;
        connection.check(file)?;
        Ok(connection)
    }

    fn check(&self, file: &Path) -> Result<(), RobotError> {
        FileIssue::check_range(file, "domain", f64::from(self.domain), 0.0..=232.0)?;
        FileIssue::check_range(file, "commands.rate_hz", self.commands.rate_hz, 5.0..=1000.0)?;
        let guard = &self.guard;
        for (key, value, range) in [
            ("guard.connect_s", guard.connect_s, 0.1..=600.0),
            ("guard.ready_s", guard.ready_s, 0.5..=60.0),
            ("guard.stale_s", guard.stale_s, 0.02..=5.0),
            ("guard.tracking_deg", guard.tracking_deg, 0.5..=180.0),
            ("guard.tracking_s", guard.tracking_s, 0.0..=10.0),
            ("guard.frozen_s", guard.frozen_s, 0.1..=10.0),
            ("guard.clock_step_s", guard.clock_step_s, 0.05..=60.0),
        ] {
            FileIssue::check_range(file, key, value, range)?;
        }
        if let Some(bridge) = &self.rosbridge {
            FileIssue::check_range(file, "rosbridge.ros", f64::from(bridge.ros), 1.0..=2.0)?;
            bridge.address().map_err(|problem| FileIssue::new(Code::ValueInvalid, file, "rosbridge.url", problem))?;
        }
        if let Some(deadman) = &self.deadman {
            FileIssue::check_range(file, "deadman.timeout_s", deadman.timeout_s, 0.05..=10.0)?;
        }
        for (key, topic) in self.named() {
            let is_needed = ["joint_sensors", "commands.topic"].contains(&key);
            if !is_name(topic) && (is_needed || !topic.is_empty()) {
                let problem = format!("{topic:?} is no absolute name of a topic, such as \"/joint_sensors\"");
                return Err(FileIssue::new(Code::ValueInvalid, file, key, problem).into());
            }
        }
        if self.stop.topic.is_empty() && self.stop.service.is_empty() {
            let problem = "neither `topic` nor `service` is given: there must be a way to stop the arm";
            return Err(FileIssue::new(Code::KeyMissing, file, "stop", problem).into());
        }
        Ok(())
    }

    /// Returns every topic and service with its key.
    fn named(&self) -> Vec<(&'static str, &str)> {
        let mut named = vec![
            ("joint_sensors", self.joint_sensors.as_str()),
            ("commands.topic", &self.commands.topic),
            ("detections", &self.detections),
            ("images", &self.images),
            ("oil_temperature", &self.oil_temperature),
            ("water_temperature", &self.water_temperature),
            ("pressure", &self.pressure),
            ("imu", &self.imu),
            ("stop.topic", &self.stop.topic),
            ("stop.service", &self.stop.service),
        ];
        named.extend(self.deadman.as_ref().map(|deadman| ("deadman.topic", deadman.topic.as_str())));
        named
    }

    /// Returns true if the images are searched for tags: the map has a topic of images and none of detections.
    #[must_use]
    pub fn searches_images(&self) -> bool {
        self.detections.is_empty() && !self.images.is_empty()
    }

    /// Returns the driver's name of a joint.
    pub(crate) fn driver_name<'a>(&'a self, joint: &'a str) -> &'a str {
        self.names.get(joint).map_or(joint, String::as_str)
    }
}

/// Returns true if a connection map may name this topic or service.
pub(crate) fn is_name(topic: &str) -> bool {
    let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '/';
    topic.starts_with('/') && topic.len() > 1 && topic.chars().all(is_allowed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(text: &str) -> Result<Connection, String> {
        Connection::parse(Path::new("arm.toml"), &format!("kind = \"arm\"\n{text}")).map_err(|error| error.to_string())
    }

    #[test]
    fn the_committed_schema_is_that_of_the_type() {
        let text = format!("{}\n", serde_json::to_string_pretty(&arm_schema()).expect("JSON"));
        if std::env::var("INSTA_UPDATE").is_ok_and(|update| update == "always") {
            std::fs::write("../core/schemas/arm.json", text).expect("written");
        } else {
            assert!(armcal_core::schema::committed(Kind::Arm) == text, "INSTA_UPDATE=always renews arm.json");
        }
    }

    #[test]
    fn an_empty_map_has_the_topics_of_our_own_recordings() {
        let connection = checked("version = 1").unwrap();
        assert_eq!(connection.joint_sensors, "/joint_sensors");
        assert_eq!(connection, Connection::default());
    }

    #[test]
    fn what_is_wrong_is_said_with_its_key() {
        let texts = [
            "version = 2",
            "joint_sensors = \"\"",
            "detections = \"tags\"",
            "[commands]\nrate_hz = 0.0",
            "[commands]\ntype = \"std_msgs/msg/String\"",
            "[guard]\nstale_s = 60.0",
            "[guard]\nstale_s = nan",
            "[stop]\ntopic = \"\"",
            "[deadman]\ntopic = \"/held\"\ntimeout_s = 0.0",
            "domain = 300",
            "[rosbridge]\nurl = \"wss://a:9090\"",
            "[rosbridge]\nros = 3",
            "joint_sensor = \"/a\"",
        ];
        let told = texts.map(|text| {
            let version = if text.contains("version") { "" } else { "version = 1\n" };
            format!("{text:?}\n  {}\n", checked(&format!("{version}{text}")).expect_err(text))
        });
        insta::assert_snapshot!("connections", told.concat());
    }
}

//! arm.toml: which topics carry what, and when the guard stops the arm.

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
    /// Of this file's layout: 1.
    pub version: u32,
    /// [`Kind::Arm`].
    pub kind: Kind,
    /// ROS_DOMAIN_ID.
    #[schemars(range(min = 0, max = 232))]
    pub domain: u16,
    /// Addresses of this machine's interfaces that DDS may use; all of them where none are named. The sockets stay
    /// open to every interface.
    pub networks: Vec<Ipv4Addr>,
    /// The bridge that the arm is reached over, in place of DDS.
    pub rosbridge: Option<Rosbridge>,
    /// `sensor_msgs/msg/JointState` with raw counts in `position`.
    pub joint_sensors: String,
    /// The driver's names of joints, by those of the robot's file, where they differ.
    pub names: BTreeMap<String, String>,
    /// Where set-points go.
    pub commands: Commands,
    /// `apriltag_msgs/msg/AprilTagDetectionArray`; empty where there is none, as all below.
    pub detections: String,
    /// `sensor_msgs/msg/CompressedImage`, JPEG; searched for tags where nobody publishes detections.
    pub images: String,
    /// `sensor_msgs/msg/Temperature`.
    pub oil_temperature: String,
    /// `sensor_msgs/msg/Temperature`.
    pub water_temperature: String,
    /// `sensor_msgs/msg/FluidPressure`.
    pub pressure: String,
    /// `sensor_msgs/msg/Imu`.
    pub imu: String,
    /// Topic and service by which the arm is stopped.
    pub stop: StopWays,
    /// `None` where nobody has to hold a switch.
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

/// Where set-points go, raw counts.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Commands {
    /// Name of the topic.
    pub topic: String,
    /// Type of its messages.
    #[serde(rename = "type")]
    pub message_type: CommandType,
    /// Set-points a second, by the arm's clock.
    #[schemars(range(min = 5.0, max = 1000.0))]
    pub rate_hz: f64,
}

impl Default for Commands {
    fn default() -> Self {
        let (topic, message_type) = (topics::JOINT_COMMANDS.to_owned(), CommandType::JointTrajectory);
        Self { topic, message_type, rate_hz: 50.0 }
    }
}

/// Messages that drivers take set-points from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum CommandType {
    /// One point, to be reached one period later.
    #[serde(rename = "trajectory_msgs/msg/JointTrajectory", alias = "trajectory_msgs/JointTrajectory")]
    JointTrajectory,
    /// `data` alone, in the order of the robot's file.
    #[serde(rename = "std_msgs/msg/Float64MultiArray", alias = "std_msgs/Float64MultiArray")]
    Float64MultiArray,
    /// `position`, as our recordings have it.
    #[serde(rename = "sensor_msgs/msg/JointState", alias = "sensor_msgs/JointState")]
    JointState,
}

impl CommandType {
    /// As ROS writes it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::JointTrajectory => "trajectory_msgs/msg/JointTrajectory",
            Self::Float64MultiArray => "std_msgs/msg/Float64MultiArray",
            Self::JointState => "sensor_msgs/msg/JointState",
        }
    }
}

/// Topic and service by which the arm is stopped; each that is named is used.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StopWays {
    /// `std_msgs/msg/Bool`, true.
    pub topic: String,
    /// `std_srvs/srv/Trigger`; empty where there is none.
    pub service: String,
    /// How the other side's middleware carries services.
    pub mapping: ServiceMapping,
}

impl Default for StopWays {
    fn default() -> Self {
        Self { topic: "/stop".to_owned(), service: String::new(), mapping: ServiceMapping::Enhanced }
    }
}

/// How services go over DDS.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ServiceMapping {
    /// Fast DDS and others.
    Enhanced,
    /// Cyclone DDS.
    Cyclone,
}

/// A switch that somebody holds as long as the arm may move.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deadman {
    /// `std_msgs/msg/Bool`.
    pub topic: String,
    /// The arm stops when the last `true` is older, s.
    #[schemars(range(min = 0.05, max = 10.0))]
    pub timeout_s: f64,
}

/// When the guard stops the arm.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GuardLimits {
    /// The first readings must come within this time, s.
    #[schemars(range(min = 0.1, max = 600.0))]
    pub connect_s: f64,
    /// Readings must be sound and the arm at rest for so long before anything moves, s.
    #[schemars(range(min = 0.5, max = 60.0))]
    pub ready_s: f64,
    /// Readings may be missing for so long, s.
    #[schemars(range(min = 0.02, max = 5.0))]
    pub stale_s: f64,
    /// A joint may be so far from its set-point, deg.
    #[schemars(range(min = 0.5, max = 180.0))]
    pub tracking_deg: f64,
    /// It may be so for this time by the arm's clock, s.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub tracking_s: f64,
    /// All readings may stay the same to the count for so long while set-points move, s.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub frozen_s: f64,
    /// The arm's clock may leap by so much between two readings, s.
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

    /// Every topic and service by its key.
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

    /// Whether tags are looked for in the images: there are images, and nobody else does.
    #[must_use]
    pub fn searches_images(&self) -> bool {
        self.detections.is_empty() && !self.images.is_empty()
    }

    /// The driver's name of a joint.
    pub(crate) fn driver_name<'a>(&'a self, joint: &'a str) -> &'a str {
        self.names.get(joint).map_or(joint, String::as_str)
    }
}

/// Whether a connection map may name this topic or service.
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

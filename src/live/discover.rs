//! Proposal of a connection map: the contents of a domain's topics. Its comments list the choices, the other candidates
//! and the keys left to fill in.

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::net::Ipv4Addr;

use crate::connection::is_name;
use crate::{CommandType, ServiceMapping};
use armcal_core::kind::Kind;
use armcal_core::log::{Stream, topics};
use armcal_core::robot::{Robot, likely_name};
use armcal_core::schema::first_line;
use armcal_core::text::printable;

/// ROS 2 domain and the interfaces through which it is reached.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Domain {
    /// Number of the domain (ROS_DOMAIN_ID).
    pub number: u16,
    /// Addresses of this machine's interfaces; all of them if the list is empty.
    pub networks: Vec<Ipv4Addr>,
}

/// Topics and services of the other participants in a domain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    /// Domain in which they were seen.
    pub domain: Domain,
    /// Topics in the order of their names.
    pub topics: Vec<SeenTopic>,
    /// Services, in no order.
    pub services: Vec<SeenService>,
}

/// A topic that somebody publishes or subscribes to.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenTopic {
    /// Name as ROS writes it.
    pub name: String,
    /// Type: `package/msg/Type`.
    pub ros_type: String,
    /// Number of current publishers.
    pub publishers: usize,
    /// Number of current subscribers.
    pub subscribers: usize,
    /// Number of messages that were heard.
    pub messages: u64,
    /// Rate of the joint readings by their stamps, Hz.
    pub rate_hz: Option<f64>,
    /// Joint names in the readings.
    pub joints: BTreeSet<String>,
    /// Largest absolute position in the joint readings.
    pub largest: f64,
}

impl SeenTopic {
    pub(crate) fn new(name: String, ros_type: String) -> Self {
        let (publishers, subscribers, messages, rate_hz, joints, largest) = Default::default();
        Self { name, ros_type, publishers, subscribers, messages, rate_hz, joints, largest }
    }
}

/// A service that somebody offers.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenService {
    /// Name as ROS writes it.
    pub name: String,
    /// Type: `package/srv/Type`.
    pub ros_type: String,
    /// Mapping that the vendor of the server's middleware uses.
    pub mapping: ServiceMapping,
}

/// A connection map as text, and the keys that are left to fill in.
#[derive(Clone, Debug, PartialEq)]
pub struct ProposedConnection {
    /// TOML with comments.
    pub text: String,
    /// Keys without a value that can be used.
    pub missing: Vec<String>,
}

/// Proposes a connection map; with `robot`, joints are matched by name.
#[must_use]
pub fn propose_connection(seen: &Seen, robot: Option<&Robot>) -> ProposedConnection {
    let mut proposal = Proposal { seen, text: String::new(), missing: Vec::new() };
    proposal.head();
    let rate_hz = proposal.joints(robot);
    proposal.commands(rate_hz);
    proposal.stop();
    proposal.deadman();
    proposal.all();
    ProposedConnection { text: proposal.text, missing: proposal.missing }
}

struct Proposal<'a> {
    seen: &'a Seen,
    text: String,
    missing: Vec<String>,
}

impl<'a> Proposal<'a> {
    /// Appends a line.
    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    /// Appends a key with its value, or a key that is left to fill in.
    fn needed(&mut self, key: &str, path: &str, topic: Option<&SeenTopic>, lacking: &str) {
        match topic {
            Some(topic) => self.line(&format!("{key} = {}   # {}", quoted(&topic.name), described(topic))),
            None => {
                self.line(&format!("{key} = \"\"   # FILL IN: {lacking}"));
                self.missing.push(path.to_owned());
            }
        }
    }

    fn published(&self, ros_type: &str) -> Vec<&'a SeenTopic> {
        self.topics(|topic| topic.ros_type == ros_type && topic.publishers > 0)
    }

    fn topics(&self, is_wanted: impl Fn(&SeenTopic) -> bool) -> Vec<&'a SeenTopic> {
        self.seen.topics.iter().filter(|topic| is_name(&topic.name) && is_wanted(topic)).collect()
    }

    fn others(&mut self, what: &str, all: &[&SeenTopic], chosen: Option<&SeenTopic>) {
        let is_other = |topic: &&&SeenTopic| chosen.is_none_or(|chosen| chosen.name != topic.name);
        let names: Vec<&str> = all.iter().filter(is_other).map(|topic| topic.name.as_str()).collect();
        if !names.is_empty() {
            self.line(&format!("# {what}: {}", names.join(", ")));
        }
    }

    fn head(&mut self) {
        let Domain { number, networks } = &self.seen.domain;
        let networks: Vec<String> = networks.iter().map(|address| quoted(&address.to_string())).collect();
        self.line(first_line(Kind::Arm).trim_end());
        self.line("# Proposed by `armcal discover`. Look at each choice; docs/guide/live-arm.md says what the keys");
        self.line("# mean. What is called by the name of a thing was taken for it.");
        self.line(&format!("version = 1\nkind = \"arm\"\ndomain = {number}\nnetworks = [{}]\n", networks.join(", ")));
    }

    /// Appends everything that the arm publishes; returns the rate of the joint readings, Hz.
    fn joints(&mut self, robot: Option<&Robot>) -> Option<f64> {
        let wanted = robot.map(Robot::joint_names).unwrap_or_default();
        let matched = |topic: &SeenTopic| wanted.iter().filter(|j| likely_name(j, &topic.joints).is_some()).count();
        let all = self.published(Stream::JointSensors.schema().name);
        let rank = |topic: &&&SeenTopic| {
            let is_ours = topic.name == topics::JOINT_SENSORS;
            (matched(topic), is_ours, topic.joints.len(), topic.messages, Reverse(topic.name.clone()))
        };
        let chosen = all.iter().max_by_key(rank).copied();
        self.needed("joint_sensors", "joint_sensors", chosen, "nobody publishes sensor_msgs/msg/JointState");
        if let Some(topic) = chosen.filter(|topic| topic.messages > 0) {
            let largest = topic.largest;
            self.line(&format!(
                "# the largest position is {largest:.4}; robot.toml says how many such counts a radian has"
            ));
        }
        self.others("other joint readings", &all, chosen);
        self.streams();
        self.names(&wanted, chosen);
        chosen.and_then(|topic| topic.rate_hz)
    }

    /// Appends the other streams of the arm; a stream that was not seen gets an empty name.
    fn streams(&mut self) {
        let all: [(&str, Stream, &[&str]); 6] = [
            ("detections", Stream::Detections, &[]),
            ("images", Stream::Images, &[]),
            ("oil_temperature", Stream::OilTemperature, &["oil", "hydraulic"]),
            ("water_temperature", Stream::WaterTemperature, &["water", "sea"]),
            ("pressure", Stream::DepthPressure, &[]),
            ("imu", Stream::VehicleImu, &[]),
        ];
        for (key, stream, words) in all {
            let ros_type = stream.schema().name;
            let all = self.published(ros_type);
            let is_called = |topic: &SeenTopic| words.is_empty() || is_called_after(&topic.name, words);
            let rank = |topic: &&&SeenTopic| (topic.name == stream.topic(), Reverse(topic.name.clone()));
            let chosen = all.iter().filter(|topic| is_called(topic)).max_by_key(rank).copied();
            let line = match chosen {
                Some(topic) => format!("{key} = {}   # {}", quoted(&topic.name), described(topic)),
                None => format!("{key} = \"\"   # none was seen; {ros_type}"),
            };
            self.line(&line);
            self.others("others of that type", &all, chosen);
        }
        if self.published(Stream::Detections.schema().name).is_empty()
            && self.published(Stream::Images.schema().name).is_empty()
        {
            self.line("# FILL IN: neither detections nor images were seen; without tags there is no calibration");
            self.missing.push("detections".to_owned());
        }
    }

    fn names(&mut self, wanted: &[String], chosen: Option<&SeenTopic>) {
        self.line("\n[names]   # the robot's joint = the driver's name, where they differ");
        let Some(topic) = chosen else { return };
        let there: Vec<String> = topic.joints.iter().map(|joint| comment(joint)).collect();
        self.line(&format!("# the driver's joints: {}", there.join(", ")));
        if wanted.is_empty() {
            self.line("# with --robot they are matched to those of robot.toml");
        }
        for joint in wanted {
            match likely_name(joint, &topic.joints) {
                Some(name) if name == joint => {}
                Some(name) => self.line(&format!("{} = {}", quoted(joint), quoted(name))),
                None => {
                    self.line(&format!("# FILL IN: {} = \"..\"", quoted(joint)));
                    self.missing.push(format!("names.{joint}"));
                }
            }
        }
    }

    fn commands(&mut self, rate_hz: Option<f64>) {
        let types = [CommandType::JointTrajectory, CommandType::Float64MultiArray, CommandType::JointState];
        let type_of = |topic: &SeenTopic| types.iter().position(|own| own.name() == topic.ros_type);
        // Joint readings have subscribers, too; only armcal publishes set-points.
        let all = self.topics(|topic| topic.subscribers > 0 && topic.publishers == 0 && type_of(topic).is_some());
        let rank = |topic: &&&SeenTopic| {
            let is_called = is_called_after(&topic.name, &["command", "set_point", "setpoint", "trajectory"]);
            (is_called, Reverse(type_of(topic)), Reverse(topic.name.clone()))
        };
        let chosen = all.iter().max_by_key(rank).copied();
        self.line("\n[commands]");
        self.needed("topic", "commands.topic", chosen, "nobody subscribes to a topic of a type below alone");
        let known: Vec<&str> = types.iter().map(|own| own.name()).collect();
        let ros_type = chosen.map_or(known[0], |topic| topic.ros_type.as_str());
        self.line(&format!("type = {}   # of {}", quoted(ros_type), known.join(", ")));
        let hz = rate_hz.map_or(50.0, |hz| hz.floor().clamp(5.0, 50.0));
        let readings = rate_hz.map_or_else(|| "no readings came".to_owned(), |hz| format!("{hz:.0} readings a second"));
        self.line(&format!("rate_hz = {hz:.1}   # {readings}, by their stamps"));
        self.others("others that might be meant", &all, chosen);
    }

    fn stop(&mut self) {
        let is_stop = |name: &str| is_called_after(name, &["stop", "halt"]);
        let all = self.topics(|topic| topic.ros_type == BOOL && topic.subscribers > 0);
        let chosen = all.iter().find(|topic| is_stop(&topic.name)).copied();
        let is_trigger = |service: &&SeenService| service.ros_type == TRIGGER && is_name(&service.name);
        let service = self.seen.services.iter().filter(is_trigger).find(|service| is_stop(&service.name));
        self.line("\n[stop]");
        match (chosen, service) {
            (None, None) => {
                self.needed("topic", "stop", None, "there must be a way to stop the arm; std_msgs/msg/Bool")
            }
            (None, Some(_)) => {
                self.line("topic = \"\"   # nobody subscribes to a std_msgs/msg/Bool that is called stop")
            }
            (Some(_), _) => self.needed("topic", "stop", chosen, ""),
        }
        match service {
            Some(SeenService { name, mapping, .. }) => {
                let mapping = if *mapping == ServiceMapping::Cyclone { "cyclone" } else { "enhanced" };
                self.line(&format!("service = {}   # {TRIGGER}", quoted(name)));
                self.line(&format!("mapping = \"{mapping}\"   # by its maker"));
            }
            None => self.line(&format!("service = \"\"   # none was seen; {TRIGGER}")),
        }
        self.others("other switches that somebody reads", &all, chosen);
    }

    fn deadman(&mut self) {
        self.line("\n# A switch that somebody holds as long as the arm may move; without one take the section out.");
        let all = self.published(BOOL);
        let chosen = all.iter().find(|topic| is_called_after(&topic.name, &["deadman", "dead_man", "held", "enable"]));
        match chosen {
            Some(topic) => self.line(&format!("[deadman]\ntopic = {}\ntimeout_s = 0.5", quoted(&topic.name))),
            None => {
                self.line("# [deadman]\n# topic = \"/held\"   # std_msgs/msg/Bool; none was seen\n# timeout_s = 0.5")
            }
        }
        self.others("other switches that somebody publishes", &all, chosen.copied());
    }

    /// Appends all topics and services, whether chosen or not.
    fn all(&mut self) {
        self.line("\n# Seen in the domain:");
        for topic in &self.seen.topics {
            self.line(&format!("#   {}   {}", comment(&topic.name), comment(&described(topic))));
        }
        for SeenService { name, ros_type, .. } in &self.seen.services {
            self.line(&format!("#   {}   {}, a service", comment(name), comment(ros_type)));
        }
    }
}

const BOOL: &str = "std_msgs/msg/Bool";
const TRIGGER: &str = "std_srvs/srv/Trigger";

fn is_called_after(topic: &str, words: &[&str]) -> bool {
    words.iter().any(|word| topic.to_lowercase().contains(word))
}

fn described(topic: &SeenTopic) -> String {
    let SeenTopic { ros_type, publishers, subscribers, messages, joints, .. } = topic;
    let mut text = format!("{ros_type}, published by {publishers}, read by {subscribers}");
    if *messages > 0 {
        let _ = write!(text, ", {messages} messages");
    }
    if !joints.is_empty() {
        let _ = write!(text, " with {} joints", joints.len());
    }
    text
}

/// Returns a text as a TOML string.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// Returns a text as one line without control characters.
fn comment(text: &str) -> String {
    printable(text).replace(['\n', '\t'], " ")
}

//! Raw joint readings from `sensor_msgs/msg/JointState`, matched by name.

use std::collections::{BTreeMap, BTreeSet};

use super::error::{BadPlace, InputError};
use super::map::{InputMap, NotFinite};
use super::stamp::TopicClock;
use crate::joints::JointCounts;
use crate::log::ros::JointState;
use crate::log::{RawMessage, StampOrder, decode};
use crate::robot::{JointSensorSpec, Robot};
use crate::time::Stamp;

/// A raw reading of all joints, in the robot's order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The header's stamp, or the log time if the header has none.
    pub stamp: Stamp,
    /// Readings as recorded; 0 for joints that the recording lacks.
    pub counts: JointCounts,
    /// Hash of the message's bytes.
    pub digest: [u8; 32],
}

/// A joint that occurs twice in a message with different positions, as recorded.
#[derive(Clone, Debug, PartialEq)]
struct TwoValues {
    joint: String,
    values: [f64; 2],
    message: u64,
}

/// Returns the number of joints, from the base on, that a recording may not lack.
pub(super) fn n_needed(robot: &Robot) -> usize {
    if robot.gripper_tag.is_some() { robot.n_joints() } else { robot.n_seen_joints() }
}

/// Reason why a message holds no reading; `None` if it has a position for each name.
fn without_reading(message: &JointState) -> Option<&'static str> {
    match (message.name.len(), message.position.len()) {
        (0, _) => Some("joint messages without joint names"),
        (names, positions) if names != positions => Some("joint messages with fewer or more positions than names"),
        _ => None,
    }
}

/// Reads the messages of one topic.
pub(super) struct JointReader<'a> {
    file: &'a str,
    map: &'a InputMap,
    topic: &'a str,
    /// Sensors of the robot, base first.
    sensors: &'a [JointSensorSpec],
    /// Number of proximal joints that may not be absent.
    n_needed: usize,
    /// Recorded names of the latest message, and the position of each of the robot's joints in it.
    layout: (Vec<String>, Vec<Option<usize>>),
    /// Needed joints that the latest message names twice: the joint, and the position of its second name.
    again: Vec<(usize, usize)>,
    /// First joint with two values, and the number of such messages.
    two_values: Option<(TwoValues, u64)>,
    pub clock: TopicClock,
    /// Log time of each reading.
    pub log_times: Vec<Stamp>,
    pub readings: Vec<Reading>,
    pub order: StampOrder,
    pub names: BTreeSet<String>,
    /// Joints distal to the needed ones that some reading has.
    pub present: BTreeSet<usize>,
    left_out: BTreeMap<String, u64>,
    n_without_positions: u64,
    messages: u64,
}

impl<'a> JointReader<'a> {
    pub fn new(file: &'a str, map: &'a InputMap, topic: &'a str, robot: &'a Robot) -> Self {
        Self {
            file,
            map,
            topic,
            sensors: &robot.sensors,
            n_needed: n_needed(robot),
            layout: (Vec::new(), vec![None; robot.n_joints()]),
            again: Vec::new(),
            two_values: None,
            clock: TopicClock::new(map.stamps),
            log_times: Vec::new(),
            readings: Vec::new(),
            order: StampOrder::default(),
            names: BTreeSet::new(),
            present: BTreeSet::new(),
            left_out: BTreeMap::new(),
            n_without_positions: 0,
            messages: 0,
        }
    }

    pub fn take(&mut self, raw: &RawMessage<'_>, digest: [u8; 32]) -> Result<(), InputError> {
        self.messages += 1;
        let file = || self.file.to_owned();
        let place = BadPlace::Message { topic: raw.topic().to_owned(), message: self.messages };
        let message: JointState = match decode(raw.data) {
            Ok(message) => message,
            Err(error) => return Err(InputError::Undecodable { file: file(), place, error }),
        };
        if message.position.is_empty() {
            self.n_without_positions += 1;
            return Ok(());
        }
        if let Some(why) = without_reading(&message) {
            self.leave_out(why);
            return Ok(());
        }
        self.learn_layout(&message.name);
        let at = &self.layout.1;
        if at[..self.n_needed].iter().any(Option::is_none) {
            // Several senders may share a topic: the gripper's joint comes alone.
            self.leave_out("joint messages that lack joints of the robot");
            return Ok(());
        }
        if let Some(found) = self.two_values_of(&message.position) {
            self.two_values.get_or_insert((found, 0)).1 += 1;
            return Ok(());
        }
        let stamp = self.clock.read(message.header.stamp, raw.log_time());
        self.order.add_of(self.messages, stamp);
        let counts = JointCounts::from_fn(at.len(), |j| {
            at[j].map_or(0.0, |k| self.map.counts(&self.sensors[j], message.position[k]))
        });
        if let Some(joint) = counts.iter().position(|value| !value.is_finite()) {
            if self.map.not_finite == NotFinite::LeaveOut {
                self.leave_out("joint messages with a position that is not finite");
                return Ok(());
            }
            let (of, value) = (self.sensors[joint].joint.clone(), counts[joint]);
            return Err(InputError::NotFinite { file: file(), place, field: "position", of, value });
        }
        self.present.extend((self.n_needed..self.sensors.len()).filter(|&joint| at[joint].is_some()));
        self.readings.push(Reading { stamp, counts, digest });
        self.log_times.push(raw.log_time());
        Ok(())
    }

    fn leave_out(&mut self, why: &str) {
        *self.left_out.entry(why.to_owned()).or_default() += 1;
    }

    /// Returns the first needed joint that the message has twice, with positions that differ by more than its sensor's
    /// noise.
    fn two_values_of(&self, position: &[f64]) -> Option<TwoValues> {
        self.again.iter().find_map(|&(joint, again)| {
            let (spec, first) = (&self.sensors[joint], self.layout.1[joint]?);
            let values = [position[first], position[again]];
            let [a, b] = values.map(|value| self.map.counts(spec, value));
            let is_one = (a - b).abs() <= spec.noise_std_counts || (a.is_nan() && b.is_nan());
            let joint = self.map.recorded_name(&spec.joint).clone();
            (!is_one).then_some(TwoValues { joint, values, message: self.messages })
        })
    }

    fn learn_layout(&mut self, names: &[String]) {
        if self.layout.0 == names {
            return;
        }
        let place = |spec: &JointSensorSpec| {
            let recorded = self.map.recorded_name(&spec.joint);
            names.iter().position(|name| name == recorded)
        };
        let at: Vec<Option<usize>> = self.sensors.iter().map(place).collect();
        let is_again = |k: usize, first: usize| k > first && names[k] == names[first];
        let again_of = |joint: usize| {
            let first = at[joint].unwrap_or(names.len());
            (0..names.len()).filter(move |&k| is_again(k, first)).map(move |k| (joint, k))
        };
        self.again = (0..self.n_needed).flat_map(again_of).collect();
        self.names.extend(names.iter().cloned());
        self.layout = (names.to_vec(), at);
    }

    /// Error for a topic without any message that gives a reading.
    pub fn no_reading(&self) -> InputError {
        let (file, topic) = (self.file.to_owned(), self.topic.to_owned());
        if let Some((TwoValues { joint, values: [first, second], message }, n)) = self.two_values.clone() {
            return InputError::JointTwice { file, topic, joint, first, second, message, n, of: self.messages };
        }
        let needed = self.sensors[..self.n_needed].iter().map(|spec| self.map.recorded_name(&spec.joint).clone());
        let missing: Vec<String> = needed.filter(|name| !self.names.contains(name)).collect();
        if missing.is_empty() || self.names.is_empty() {
            let skipped = self.skipped();
            let reasons = skipped.iter().chain(&self.left_out).map(|(why, n)| format!("{n} {why}"));
            let reasons: Vec<String> = reasons.collect();
            return InputError::NoPositions { file, topic, n: self.messages, reasons: reasons.join(", ") };
        }
        InputError::JointNames {
            file,
            topic,
            recorded: self.names.iter().cloned().collect(),
            missing,
            expected: self.sensors.iter().map(|spec| spec.joint.clone()).collect(),
        }
    }

    /// Number of messages without a reading that may be ignored.
    pub fn skipped(&self) -> BTreeMap<String, u64> {
        let why = "joint messages without positions (velocities or efforts only)".to_owned();
        Some((why, self.n_without_positions)).filter(|(_, n)| *n > 0).into_iter().collect()
    }

    /// Number of unused messages by reason.
    pub fn left_out(&self) -> BTreeMap<String, u64> {
        let mut left_out = self.left_out.clone();
        if let Some((TwoValues { joint, values: [first, second], message }, n)) = &self.two_values {
            let what = format!(
                "joint messages on {} that have `{joint}` twice with different positions ({first:.6} and \
                 {second:.6} in message {message})",
                self.topic
            );
            left_out.insert(what, *n);
        }
        left_out
    }

    /// Recorded joints that the robot does not have.
    pub fn extra(&self) -> Vec<String> {
        let of_robot: BTreeSet<&String> = self.sensors.iter().map(|spec| self.map.recorded_name(&spec.joint)).collect();
        self.names.iter().filter(|name| !of_robot.contains(name)).cloned().collect()
    }
}

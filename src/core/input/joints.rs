//! Raw joint readings from `sensor_msgs/msg/JointState`, matched by name.

use std::collections::{BTreeMap, BTreeSet};

use super::error::{BadPlace, InputError};
use super::map::{InputMap, NotFinite};
use crate::joints::JointCounts;
use crate::log::ros::JointState;
use crate::log::{RawMessage, StampOrder, decode};
use crate::robot::{JointSensorSpec, Robot};
use crate::time::Stamp;

/// One raw reading of all joints, in the robot's order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Header's stamp, or the log time where the header has none.
    pub stamp: Stamp,
    /// As recorded; 0 for joints that the recording lacks.
    pub counts: JointCounts,
    /// Hash of the message's bytes.
    pub digest: [u8; 32],
}

/// The joints of the robot, from the base on, that a recording may not lack.
pub(super) fn n_needed(robot: &Robot) -> usize {
    if robot.gripper_tag.is_some() { robot.n_joints() } else { robot.n_seen_joints() }
}

/// Reads the messages of one topic.
pub(super) struct JointReader<'a> {
    file: &'a str,
    map: &'a InputMap,
    topic: &'a str,
    /// Of the robot, base first.
    sensors: &'a [JointSensorSpec],
    /// The first joints, which may not be absent.
    n_needed: usize,
    /// Recorded names of the latest message, and where in it each of the robot's joints is.
    layout: (Vec<String>, Vec<Option<usize>>),
    pub readings: Vec<Reading>,
    pub order: StampOrder,
    pub names: BTreeSet<String>,
    /// Joints behind the needed ones that some reading has.
    pub present: BTreeSet<usize>,
    pub left_out: BTreeMap<String, u64>,
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
            readings: Vec::new(),
            order: StampOrder::default(),
            names: BTreeSet::new(),
            present: BTreeSet::new(),
            left_out: BTreeMap::new(),
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
        let (names, positions) = (message.name.len(), message.position.len());
        if names != positions {
            return Err(InputError::NameCount { file: file(), place, names, positions });
        }
        let stamp = super::stamp::stamp_or_log_time(message.header.stamp, raw.log_time());
        self.learn_layout(&message.name);
        let at = &self.layout.1;
        if at[..self.n_needed].iter().any(Option::is_none) {
            // Several senders may share a topic: the gripper's joint comes alone.
            *self.left_out.entry("joint messages that lack joints of the robot".to_owned()).or_default() += 1;
            return Ok(());
        }
        self.order.add_of(self.messages, stamp);
        let counts = JointCounts::from_fn(at.len(), |j| {
            at[j].map_or(0.0, |k| self.map.counts(&self.sensors[j], message.position[k]))
        });
        if let Some(joint) = counts.iter().position(|value| !value.is_finite()) {
            if self.map.not_finite == NotFinite::LeaveOut {
                *self.left_out.entry("joint messages with a position that is not finite".to_owned()).or_default() += 1;
                return Ok(());
            }
            let (of, value) = (self.sensors[joint].joint.clone(), counts[joint]);
            return Err(InputError::NotFinite { file: file(), place, field: "position", of, value });
        }
        self.present.extend((self.n_needed..self.sensors.len()).filter(|&joint| at[joint].is_some()));
        self.readings.push(Reading { stamp, counts, digest });
        Ok(())
    }

    fn learn_layout(&mut self, names: &[String]) {
        if self.layout.0 == names {
            return;
        }
        let place = |spec: &JointSensorSpec| {
            let recorded = self.map.recorded_name(&spec.joint);
            names.iter().position(|name| name == recorded)
        };
        let at = self.sensors.iter().map(place).collect();
        self.names.extend(names.iter().cloned());
        self.layout = (names.to_vec(), at);
    }

    /// The error for a topic whose messages name other joints than the robot's.
    pub fn no_reading(&self) -> InputError {
        let needed = self.sensors[..self.n_needed].iter().map(|spec| self.map.recorded_name(&spec.joint).clone());
        InputError::JointNames {
            file: self.file.to_owned(),
            topic: self.topic.to_owned(),
            recorded: self.names.iter().cloned().collect(),
            missing: needed.filter(|name| !self.names.contains(name)).collect(),
            expected: self.sensors.iter().map(|spec| spec.joint.clone()).collect(),
        }
    }

    /// Recorded joints that the robot does not have.
    pub fn extra(&self) -> Vec<String> {
        let of_robot: BTreeSet<&String> = self.sensors.iter().map(|spec| self.map.recorded_name(&spec.joint)).collect();
        self.names.iter().filter(|name| !of_robot.contains(name)).cloned().collect()
    }
}

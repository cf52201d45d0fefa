//! Raw joint readings from `sensor_msgs/msg/JointState`, matched by name.

use std::collections::{BTreeMap, BTreeSet};

use super::error::{BadPlace, InputError};
use super::map::{InputMap, NotFinite};
use crate::joints::JointCounts;
use crate::log::ros::JointState;
use crate::log::{RawMessage, StampOrder, decode};
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

/// Reads the messages of one topic.
pub(super) struct JointReader<'a> {
    file: &'a str,
    map: &'a InputMap,
    /// Of the robot, base first.
    joints: &'a [String],
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
    pub fn new(file: &'a str, map: &'a InputMap, joints: &'a [String], n_needed: usize) -> Self {
        Self {
            file,
            map,
            joints,
            n_needed,
            layout: (Vec::new(), vec![None; joints.len()]),
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
        let place = BadPlace { topic: raw.topic().to_owned(), message: self.messages };
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
        let values = at.iter().map(|at| at.map_or(0.0, |k| message.position[k]));
        let counts = JointCounts::from_slice(&values.collect::<Vec<_>>());
        if let Some(joint) = counts.iter().position(|value| !value.is_finite()) {
            if self.map.not_finite == NotFinite::LeaveOut {
                *self.left_out.entry("joint messages with a position that is not finite".to_owned()).or_default() += 1;
                return Ok(());
            }
            let (of, value) = (self.joints[joint].clone(), counts[joint]);
            return Err(InputError::NotFinite { file: file(), place, field: "position", of, value });
        }
        self.present.extend((self.n_needed..self.joints.len()).filter(|&joint| at[joint].is_some()));
        self.readings.push(Reading { stamp, counts, digest });
        Ok(())
    }

    fn learn_layout(&mut self, names: &[String]) {
        if self.layout.0 == names {
            return;
        }
        let is_it = |name: &String, joint: &String| name == self.map.joint_names.get(joint).unwrap_or(joint);
        let at = self.joints.iter().map(|joint| names.iter().position(|name| is_it(name, joint))).collect();
        self.names.extend(names.iter().cloned());
        self.layout = (names.to_vec(), at);
    }

    /// The error for a topic whose messages name other joints than the robot's.
    pub fn no_reading(&self) -> InputError {
        let recorded_name = |joint: &String| self.map.joint_names.get(joint).unwrap_or(joint).clone();
        let needed = self.joints[..self.n_needed].iter().map(recorded_name);
        InputError::JointNames {
            file: self.file.to_owned(),
            topic: self.map.joint_topic.clone(),
            recorded: self.names.iter().cloned().collect(),
            missing: needed.filter(|name| !self.names.contains(name)).collect(),
            expected: self.joints.to_vec(),
        }
    }

    /// Recorded joints that the robot does not have.
    pub fn extra(&self) -> Vec<String> {
        let of_robot: BTreeSet<&String> =
            self.joints.iter().map(|joint| self.map.joint_names.get(joint).unwrap_or(joint)).collect();
        self.names.iter().filter(|name| !of_robot.contains(name)).cloned().collect()
    }
}

//! An arm behind the topics of a connection.

use std::time::{Duration, Instant};

use rustdds::mio1::{Events, Interest, Poll, Token};

use super::stopper::Stopper;
use super::{MAX_TAKEN, Node, Reader, Writer};
use crate::messages::Command;
use crate::topics::{Content, contents, newest_stamp, read};
use crate::{Connection, Heard, LiveError, Wire};
use armcal_core::robot::Robot;
use armcal_core::streams::JointCounts;
use armcal_core::time::Stamp;

/// A connection over DDS.
pub struct Ros2Wire {
    connection: Connection,
    /// The driver's joint names, in the robot's order of joints.
    names: Vec<String>,
    readers: Vec<(Content, Reader)>,
    commands: Writer,
    stop: Stopper,
    poll: Poll,
    events: Events,
    start: Instant,
    newest: Stamp,
    /// Participant of the domain. It is the last field, so that readers and writers leave the domain before it does.
    node: Node,
}

impl Ros2Wire {
    /// Joins the domain and subscribes; nothing is sent.
    ///
    /// # Errors
    /// [`LiveError::Dds`].
    pub fn open(connection: &Connection, robot: &Robot) -> Result<Self, LiveError> {
        let mut node = Node::new(connection.domain, &connection.networks, "armcal")?;
        let names = robot.joint_names().iter().map(|name| connection.driver_name(name).to_owned()).collect();
        let commands = node.writer(&connection.commands.topic, connection.commands.message_type.name())?;
        let stop = Stopper::new(&mut node, connection)?;
        let poll = Poll::new().map_err(LiveError::dds("polling"))?;
        let mut readers = Vec::new();
        for (content, topic) in contents(connection) {
            let mut reader = node.reader(topic, content.ros_type())?;
            let token = Token(readers.len());
            poll.registry().register(&mut reader.0, token, Interest::READABLE).map_err(LiveError::dds(topic))?;
            readers.push((content, reader));
        }
        Ok(Self {
            node,
            connection: connection.clone(),
            names,
            readers,
            commands,
            stop,
            poll,
            events: Events::with_capacity(64),
            start: Instant::now(),
            newest: Stamp { nanos: 0 },
        })
    }

    /// Appends all waiting messages to `heard`; returns true if there were any.
    fn drain(&mut self, heard: &mut Vec<Heard>) -> bool {
        let before = heard.len();
        for (content, reader) in &self.readers {
            for _ in 0..MAX_TAKEN {
                let Some(taken) = reader.take() else { break };
                heard.push(taken.map_or_else(Heard::Unusable, |bytes| read(*content, &bytes, &self.names)));
            }
        }
        self.newest = newest_stamp(&heard[before..], self.newest);
        heard.len() > before
    }
}

impl Wire for Ros2Wire {
    fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    fn receive(&mut self, timeout: Duration, heard: &mut Vec<Heard>) -> Result<(), LiveError> {
        if self.drain(heard) {
            return Ok(());
        }
        if let Err(error) = self.poll.poll(&mut self.events, Some(timeout))
            && error.kind() != std::io::ErrorKind::Interrupted
        {
            return Err(LiveError::dds("polling")(error));
        }
        self.drain(heard);
        self.node.warn_of_mismatches();
        Ok(())
    }

    fn send(&mut self, set_point: &JointCounts, within_s: f64) -> Result<(), LiveError> {
        let command =
            Command { stamp: self.newest, names: self.names.clone(), positions: set_point.to_vec(), within_s };
        let mut bytes = Vec::new();
        command.encode(self.connection.commands.message_type, &mut bytes)?;
        self.commands.write(bytes)
    }

    fn stop(&mut self) -> Result<(), LiveError> {
        self.stop.stop()
    }
}

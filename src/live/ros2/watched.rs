//! An arm behind the topics of a domain whose peers may make the program grow.

use std::time::Duration;

use super::stopper::Stopper;
use super::{Node, Ros2Wire};
use crate::{Connection, Heard, LiveError, MemoryWatch, Wire};
use armcal_core::robot::Robot;
use armcal_core::streams::JointCounts;

/// A connection over DDS that is lost once the program has grown too much. The arm is then told to stop by another
/// participant: what made the program grow may keep the first one busy.
pub struct WatchedWire {
    wire: Ros2Wire,
    stop: Stopper,
    has_sent: bool,
    is_lost: bool,
    /// Participant that sends only that stop.
    node: Node,
    /// Watch of the memory. It is the last field, so that the domain is left under its watch.
    memory: MemoryWatch,
}

impl WatchedWire {
    /// Joins the domain and subscribes; nothing is sent.
    ///
    /// # Errors
    /// [`LiveError::Dds`].
    pub fn open(connection: &Connection, robot: &Robot, memory: MemoryWatch) -> Result<Self, LiveError> {
        let wire = Ros2Wire::open(connection, robot)?;
        let mut node = Node::new(connection.domain, &connection.networks, "armcal_stop")?;
        let stop = Stopper::new(&mut node, connection)?;
        Ok(Self { wire, stop, has_sent: false, is_lost: false, node, memory })
    }
}

impl Wire for WatchedWire {
    fn elapsed(&self) -> Duration {
        self.wire.elapsed()
    }

    fn receive(&mut self, timeout: Duration, heard: &mut Vec<Heard>) -> Result<(), LiveError> {
        if let Err(error) = self.memory.check() {
            // Stops at once: the program may be ended before the run has finished its files.
            let is_first = !std::mem::replace(&mut self.is_lost, true);
            if is_first
                && self.has_sent
                && let Err(problem) = self.stop()
            {
                tracing::error!("the stop could not be sent: {problem}");
            }
            return Err(error);
        }
        self.node.warn_of_mismatches();
        self.wire.receive(timeout, heard)
    }

    fn send(&mut self, set_point: &JointCounts, within_s: f64) -> Result<(), LiveError> {
        // No set-point follows the stop.
        if self.is_lost {
            return Ok(());
        }
        self.has_sent = true;
        self.wire.send(set_point, within_s)
    }

    fn stop(&mut self) -> Result<(), LiveError> {
        let by_other = if self.is_lost { self.stop.stop() } else { Ok(()) };
        self.wire.stop().and(by_other)
    }
}

//! Interface of a connection to an arm, for every protocol.

use std::time::Duration;

use crate::LiveError;
use armcal_core::streams::{JointCounts, JointSensorSample, Message};

/// Something that came over the wire.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// Readings in the robot's order of joints.
    Joints(JointSensorSample),
    /// Any other stream.
    Other(Message),
    /// The dead man's switch is held, or let go.
    Deadman(bool),
    /// A message that says nothing usable, for people.
    Unusable(String),
}

/// A connection to an arm, with a clock of its own.
pub trait Wire {
    /// Time since any fixed moment; never goes back.
    fn elapsed(&self) -> Duration;

    /// Waits for messages, `timeout` at most, and appends all that came to `heard`, in the order of arrival a topic.
    ///
    /// # Errors
    /// When the connection is of no use any more.
    fn receive(&mut self, timeout: Duration, heard: &mut Vec<Heard>) -> Result<(), LiveError>;

    /// Sends a set-point, raw counts, robot's order of joints, that is to be reached within `within_s`.
    ///
    /// # Errors
    /// When it cannot be sent.
    fn send(&mut self, set_point: &JointCounts, within_s: f64) -> Result<(), LiveError>;

    /// Tells the arm to stop, in every way that the connection knows.
    ///
    /// # Errors
    /// When none of them could be sent.
    fn stop(&mut self) -> Result<(), LiveError>;
}

impl<W: Wire + ?Sized> Wire for Box<W> {
    fn elapsed(&self) -> Duration {
        (**self).elapsed()
    }

    fn receive(&mut self, timeout: Duration, heard: &mut Vec<Heard>) -> Result<(), LiveError> {
        (**self).receive(timeout, heard)
    }

    fn send(&mut self, set_point: &JointCounts, within_s: f64) -> Result<(), LiveError> {
        (**self).send(set_point, within_s)
    }

    fn stop(&mut self) -> Result<(), LiveError> {
        (**self).stop()
    }
}

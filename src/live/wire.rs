//! Interface of a connection to an arm, for every protocol.

use std::time::Duration;

use crate::LiveError;
use armcal_core::streams::{JointCounts, JointSensorSample, Message};

/// Message that came over the wire.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// Joint readings in the robot's order of joints.
    Joints(JointSensorSample),
    /// Message of any other stream.
    Other(Message),
    /// State of the dead man's switch: true if it is held.
    Deadman(bool),
    /// Description of an unusable message, for people.
    Unusable(String),
}

/// Connection to an arm, with its own clock.
pub trait Wire {
    /// Returns the time since any fixed moment; it never goes back.
    fn elapsed(&self) -> Duration;

    /// Waits for messages, for at most `timeout`, and appends all that came to `heard`; those of one topic are in the
    /// order of arrival.
    ///
    /// # Errors
    /// [`LiveError`] if the connection is of no use any more.
    fn receive(&mut self, timeout: Duration, heard: &mut Vec<Heard>) -> Result<(), LiveError>;

    /// Sends a set-point, raw counts, robot's order of joints, that is to be reached within `within_s`.
    ///
    /// # Errors
    /// [`LiveError`] if it cannot be sent.
    fn send(&mut self, set_point: &JointCounts, within_s: f64) -> Result<(), LiveError>;

    /// Tells the arm to stop, in every way that the connection knows.
    ///
    /// # Errors
    /// [`LiveError`] if none of them could be sent.
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

//! The two ends of the streams.

use super::message::Message;
use crate::joints::JointCounts;
use crate::time::Stamp;

/// Takes messages as they come; a recording, a viewer, or both.
pub trait Sink {
    /// # Errors
    /// When the message cannot be kept (disk full, closed stream).
    fn record(&mut self, log_time: Stamp, message: &Message) -> Result<(), SinkError>;
}

/// Why a sink did not keep a message, free of any file format.
pub type SinkError = Box<dyn std::error::Error + Send + Sync>;

/// Why an arm did not do as told.
#[derive(Debug, thiserror::Error)]
pub enum ArmError {
    #[error("the arm's stream could not be recorded: {0}")]
    Sink(#[source] SinkError),
    #[error("the set-point names {got} joints, the arm has {expected}")]
    JointCount { got: usize, expected: usize },
    #[error("joint {joint}: set-point {counts} counts is not a finite number")]
    SetPoint { joint: usize, counts: f64 },
    #[error("the arm's state is no longer finite at {at_s:.3} s: the step is too large for its stiffness")]
    NotFinite { at_s: f64 },
    #[error("fault number {number} cannot be brought about: the arm knows {known}")]
    NoSuchFault { number: usize, known: usize },
    #[error("the camera: {0}")]
    Camera(#[source] Box<dyn std::error::Error + Send + Sync>),
    #[error("the arm has no gripper that opens and closes")]
    NoGripper,
    #[error("gripper: an opening of {opening} is outside 0 (closed) .. 1 (open)")]
    Opening { opening: f64 },
}

/// An arm that can be told where to go, simulated or real. It tells back only through messages.
pub trait Arm {
    /// The arm's present time, by the joint sensors' clock.
    fn now(&self) -> Stamp;

    /// Sets where the arm's own controller shall drive its own sensors, raw counts.
    ///
    /// # Errors
    /// [`ArmError::JointCount`], [`ArmError::SetPoint`].
    fn command(&mut self, set_point: &JointCounts) -> Result<(), ArmError>;

    /// Lets one control period pass and hands every message of it to `sink` in the order of log time.
    ///
    /// # Errors
    /// [`ArmError::Sink`] when the sink refuses, [`ArmError::NotFinite`] when a simulated arm broke down.
    fn step(&mut self, sink: &mut dyn Sink) -> Result<(), ArmError>;

    /// Length of a control period, s.
    fn period_s(&self) -> f64;

    /// Lets at least `seconds` pass with the arm at rest; an arm may send fewer messages meanwhile than [`Self::step`] does.
    ///
    /// # Errors
    /// As [`Self::step`].
    fn idle(&mut self, seconds: f64, sink: &mut dyn Sink) -> Result<(), ArmError> {
        let until = self.now().plus_s(seconds);
        while self.now() < until {
            self.step(sink)?;
        }
        Ok(())
    }

    /// Tells the jaws where to go, from 0 (closed) to 1 (open); they take their time. An arm without jaws refuses: a script that
    /// closed nothing on a target would else look like one that touched it.
    ///
    /// # Errors
    /// [`ArmError::NoGripper`], [`ArmError::Opening`].
    fn grip(&mut self, opening: f64) -> Result<(), ArmError> {
        let _ = opening;
        Err(ArmError::NoGripper)
    }

    /// The camera is wanted from now on, or no longer. An arm whose camera is always on need not care; one that pays for every
    /// image may take few of them while nobody looks.
    fn look(&mut self, is_wanted: bool) {
        let _ = is_wanted;
    }

    /// Something breaks now: fault `number` of a list that only a simulated arm holds. Nobody tells the caller what it is.
    ///
    /// # Errors
    /// [`ArmError::NoSuchFault`]; always, for a real arm.
    fn fault(&mut self, number: usize) -> Result<(), ArmError> {
        Err(ArmError::NoSuchFault { number, known: 0 })
    }
}

//! Interfaces of the streams: the arm that sends messages, the sink that keeps them.

use super::late::LateMessages;
use super::message::Message;
use crate::codes::{Code, Coded};
use crate::joints::JointCounts;
use crate::time::Stamp;

/// A receiver of messages: a recording, a viewer, or both.
pub trait Sink {
    /// # Errors
    /// When the message cannot be kept (disk full, closed stream).
    fn record(&mut self, log_time: Stamp, message: &Message) -> Result<(), SinkError>;

    /// Keeps messages that are not available yet, before everything recorded after this call. A sink that does not wait
    /// holds the later messages back.
    ///
    /// # Errors
    /// The errors of [`Self::record`], and [`LateError`](super::LateError) if the work for the messages failed.
    fn record_late(&mut self, log_time: Stamp, messages: LateMessages) -> Result<(), SinkError> {
        messages.wait()?.iter().try_for_each(|message| self.record(log_time, message))
    }
}

/// Error of a sink that did not keep a message, free of any file format.
pub type SinkError = Box<dyn std::error::Error + Send + Sync>;

/// Error of a command that an arm did not carry out.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
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
    /// The arm, or its guard, has stopped; the arm takes no further set-points.
    #[error("the arm was stopped: {why}")]
    Stopped { why: String, code: Code },
    #[error("the connection to the arm: {0}")]
    Connection(#[source] Box<dyn std::error::Error + Send + Sync>),
    #[error("the arm has no gripper that opens and closes")]
    NoGripper,
    #[error("gripper: an opening of {opening} is outside 0 (closed) .. 1 (open)")]
    Opening { opening: f64 },
}

/// Images that the caller needs; an arm for which images are costly may omit some.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ImageDemand {
    /// Every image of the camera.
    All,
    /// A few images, for a viewer.
    #[default]
    Few,
}

/// An arm that follows set-points, simulated or real. It answers only through messages.
pub trait Arm {
    /// The arm's present time, by the joint sensors' clock.
    fn now(&self) -> Stamp;

    /// Commands a set-point in raw counts; the arm's controller drives its own sensors to it.
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

    /// Lets at least `seconds` pass with the arm at rest. Meanwhile an arm may send fewer messages than [`Self::step`]
    /// does.
    ///
    /// # Errors
    /// The errors of [`Self::step`].
    fn idle(&mut self, seconds: f64, sink: &mut dyn Sink) -> Result<(), ArmError> {
        let until = self.now().plus_s(seconds);
        while self.now() < until {
            self.step(sink)?;
        }
        Ok(())
    }

    /// Commands the opening of the jaws, from 0 (closed) to 1 (open). An arm without jaws returns an error; otherwise a
    /// script could not distinguish a touch from no touch.
    ///
    /// # Errors
    /// [`ArmError::NoGripper`], [`ArmError::Opening`].
    fn grip(&mut self, opening: f64) -> Result<(), ArmError> {
        let _ = opening;
        Err(ArmError::NoGripper)
    }

    /// Sets how many images the caller needs from now on. An arm whose camera is always on ignores it.
    fn request_images(&mut self, demand: ImageDemand) {
        let _ = demand;
    }

    /// Applies fault `number` of a list that only a simulated arm holds. The caller does not learn which fault it is.
    ///
    /// # Errors
    /// [`ArmError::NoSuchFault`]; always, for a real arm.
    fn fault(&mut self, number: usize) -> Result<(), ArmError> {
        Err(ArmError::NoSuchFault { number, known: 0 })
    }
}

impl Coded for ArmError {
    fn code(&self) -> Code {
        match self {
            Self::Sink(_) => Code::FileUnwritable,
            Self::JointCount { .. } | Self::SetPoint { .. } | Self::Opening { .. } | Self::NoGripper => {
                Code::SetPointInvalid
            }
            Self::NotFinite { .. } => Code::SimulationUnstable,
            Self::NoSuchFault { .. } => Code::ValueInvalid,
            Self::Stopped { code, .. } => *code,
            Self::Connection(_) => Code::ArmConnection,
        }
    }
}

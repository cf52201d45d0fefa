//! Streams: messages of an arm, and the interfaces of the arm and of receivers.
//!
//! Simulator and estimator share this module and `log` only. A message holds only values that a real arm, camera,
//! recorder or operator can give: raw counts, corner pixels, readings.

mod arm;
mod late;
mod message;
mod survey;

pub use crate::joints::{JointAngles, JointCounts, MAX_JOINTS};
pub use arm::{Arm, ArmError, ImageDemand, Sink, SinkError};
pub use late::{LateError, LateMessages, LateSender};
pub use message::{
    Attitude, CameraImage, CaptureSet, DetectionReject, DetectionRejects, GripperCommand, GripperSample, JointCommand,
    JointSensorSample, JointStateBelief, LogLevel, LogLine, Mark, MarkKind, Message, Phase, PressureSample,
    PriorSource, ReachAttempt, ReachTask, RecordedSurvey, RecordedTag, RejectReason, TagDetection, TagDetections,
    TemperatureSample, Thermometer, ToolTouch,
};

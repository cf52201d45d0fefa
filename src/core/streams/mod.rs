//! What flows between an arm and those who watch it: messages, and the traits of their ends.
//!
//! Truth (a simulated arm) and belief (calibration, planning) meet here and in `log`, nowhere else. Every value in a
//! message is one that a real arm, camera, recorder or operator could have given: raw counts, corner pixels, readings.

mod arm;
mod message;
mod survey;

pub use crate::joints::{JointAngles, JointCounts, MAX_JOINTS};
pub use arm::{Arm, ArmError, ImageDemand, Sink, SinkError};
pub use message::{
    Attitude, CameraImage, CaptureSet, DetectionReject, DetectionRejects, GripperCommand, GripperSample, JointCommand,
    JointSensorSample, JointStateBelief, LogLevel, LogLine, Mark, MarkKind, Message, Phase, PressureSample,
    PriorSource, ReachAttempt, ReachTask, RecordedSurvey, RecordedTag, RejectReason, TagDetection, TagDetections,
    TemperatureSample, Thermometer,
};

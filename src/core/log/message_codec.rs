//! The streams of a recording: topic, ROS type, encoder and decoder of each message.

use super::cdr;
use super::error::{DecodeRejection, EncodeError};
use super::header::RecordingHeader;
use super::messages::joints::FirstJoints;
use super::messages::{
    AprilTagDetectionArray, CompressedImage, DetectionRejects, FluidPressure, Imu, JointState, Log, Mark, ReachTask,
    TagSurvey, Temperature, Touch, attitude, detections, images, joints, log_line, marks, pressure, rejects, survey,
    task, temperatures, touch,
};
use super::schema::{RosMessage, RosSchema};
use super::topics::{
    DEPTH_PRESSURE, DETECTIONS, GRIPPER_COMMAND, GRIPPER_STATE, IMAGES, JOINT_COMMANDS, JOINT_SENSORS, JOINT_STATES,
    LOG, MARKS, OIL_TEMPERATURE, REJECTS, TAG_SURVEY, TASK, TOUCH, VEHICLE_IMU, WATER_TEMPERATURE,
};
use crate::joints::{JointAngles, JointCounts};
use crate::streams::{
    GripperCommand, GripperSample, JointCommand, JointSensorSample, JointStateBelief, Message, Thermometer,
};

/// The streams of [`Message`]s, one topic each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(missing_docs, reason = "each stream is described at its topic, in `topics`")]
pub enum Stream {
    JointSensors,
    JointCommands,
    JointStates,
    Detections,
    Rejects,
    Images,
    OilTemperature,
    WaterTemperature,
    DepthPressure,
    VehicleImu,
    GripperState,
    GripperCommand,
    Task,
    TagSurvey,
    Touch,
    Marks,
    Log,
}

impl Stream {
    /// All streams, each once.
    pub const ALL: [Self; 17] = [
        Self::JointSensors,
        Self::JointCommands,
        Self::JointStates,
        Self::Detections,
        Self::Rejects,
        Self::Images,
        Self::OilTemperature,
        Self::WaterTemperature,
        Self::DepthPressure,
        Self::VehicleImu,
        Self::GripperState,
        Self::GripperCommand,
        Self::Task,
        Self::TagSurvey,
        Self::Touch,
        Self::Marks,
        Self::Log,
    ];

    /// Returns the stream that carries a message.
    #[must_use]
    pub fn of(message: &Message) -> Self {
        match message {
            Message::JointSensors(_) => Self::JointSensors,
            Message::JointCommand(_) => Self::JointCommands,
            Message::JointStates(_) => Self::JointStates,
            Message::Detections(_) => Self::Detections,
            Message::Rejects(_) => Self::Rejects,
            Message::Image(_) => Self::Images,
            Message::Temperature(sample) => match sample.thermometer {
                Thermometer::Oil => Self::OilTemperature,
                Thermometer::Water => Self::WaterTemperature,
            },
            Message::Pressure(_) => Self::DepthPressure,
            Message::Attitude(_) => Self::VehicleImu,
            Message::Gripper(_) => Self::GripperState,
            Message::GripperCommand(_) => Self::GripperCommand,
            Message::Task(_) => Self::Task,
            Message::Survey(_) => Self::TagSurvey,
            Message::Touch(_) => Self::Touch,
            Message::Mark(_) => Self::Marks,
            Message::Log(_) => Self::Log,
        }
    }

    /// Returns topic and ROS type of the stream.
    const fn row(self) -> (&'static str, &'static RosSchema) {
        match self {
            Self::JointSensors => (JOINT_SENSORS, &JointState::SCHEMA),
            Self::JointCommands => (JOINT_COMMANDS, &JointState::SCHEMA),
            Self::JointStates => (JOINT_STATES, &JointState::SCHEMA),
            Self::Detections => (DETECTIONS, &AprilTagDetectionArray::SCHEMA),
            Self::Rejects => (REJECTS, &DetectionRejects::SCHEMA),
            Self::Images => (IMAGES, &CompressedImage::SCHEMA),
            Self::OilTemperature => (OIL_TEMPERATURE, &Temperature::SCHEMA),
            Self::WaterTemperature => (WATER_TEMPERATURE, &Temperature::SCHEMA),
            Self::DepthPressure => (DEPTH_PRESSURE, &FluidPressure::SCHEMA),
            Self::VehicleImu => (VEHICLE_IMU, &Imu::SCHEMA),
            Self::GripperState => (GRIPPER_STATE, &JointState::SCHEMA),
            Self::GripperCommand => (GRIPPER_COMMAND, &JointState::SCHEMA),
            Self::Task => (TASK, &ReachTask::SCHEMA),
            Self::TagSurvey => (TAG_SURVEY, &TagSurvey::SCHEMA),
            Self::Touch => (TOUCH, &Touch::SCHEMA),
            Self::Marks => (MARKS, &Mark::SCHEMA),
            Self::Log => (LOG, &Log::SCHEMA),
        }
    }

    /// Returns the stream's topic in our own recordings.
    #[must_use]
    pub fn topic(self) -> &'static str {
        self.row().0
    }

    /// Returns the ROS type of the stream's messages.
    #[must_use]
    pub fn schema(self) -> &'static RosSchema {
        self.row().1
    }

    /// Decodes and checks a single message, such as one received over a network. Joints are in the order of their names
    /// in the message.
    ///
    /// # Errors
    /// [`DecodeRejection`], for any bytes.
    pub fn decode_alone(self, bytes: &[u8]) -> Result<Message, DecodeRejection> {
        self.decode(bytes, &mut FirstJoints::default())
    }

    /// Decodes and checks one message of the stream. Every number that it returns is finite.
    ///
    /// # Errors
    /// [`DecodeRejection`], for any bytes.
    pub(super) fn decode(self, bytes: &[u8], first: &mut FirstJoints) -> Result<Message, DecodeRejection> {
        Ok(match self {
            Self::JointSensors => {
                let (stamp, position) = joints::decode(bytes, first)?;
                Message::JointSensors(JointSensorSample { stamp, counts: JointCounts::from_slice(&position) })
            }
            Self::JointCommands => {
                let (stamp, position) = joints::decode(bytes, first)?;
                Message::JointCommand(JointCommand { stamp, counts: JointCounts::from_slice(&position) })
            }
            Self::JointStates => {
                let (stamp, position) = joints::decode(bytes, first)?;
                Message::JointStates(JointStateBelief { stamp, angles: JointAngles::from_slice(&position) })
            }
            Self::Detections => Message::Detections(detections::from_ros(&cdr::decode(bytes)?)?),
            Self::Rejects => Message::Rejects(rejects::from_ros(&cdr::decode(bytes)?)?),
            Self::Images => Message::Image(images::from_ros(cdr::decode(bytes)?)?),
            Self::OilTemperature => {
                Message::Temperature(temperatures::from_ros(&cdr::decode(bytes)?, Thermometer::Oil)?)
            }
            Self::WaterTemperature => {
                Message::Temperature(temperatures::from_ros(&cdr::decode(bytes)?, Thermometer::Water)?)
            }
            Self::DepthPressure => Message::Pressure(pressure::from_ros(&cdr::decode(bytes)?)?),
            Self::VehicleImu => Message::Attitude(attitude::from_ros(&cdr::decode(bytes)?)?),
            Self::GripperState => {
                let (stamp, opening_m) = joints::gripper_from_ros(&cdr::decode(bytes)?)?;
                Message::Gripper(GripperSample { stamp, opening_m })
            }
            Self::GripperCommand => {
                let (stamp, opening_m) = joints::gripper_from_ros(&cdr::decode(bytes)?)?;
                Message::GripperCommand(GripperCommand { stamp, opening_m })
            }
            Self::Task => Message::Task(task::from_ros(&cdr::decode(bytes)?)?),
            Self::TagSurvey => Message::Survey(survey::from_ros(&cdr::decode(bytes)?)?),
            Self::Touch => Message::Touch(touch::from_ros(cdr::decode(bytes)?)?),
            Self::Marks => Message::Mark(marks::from_ros(&cdr::decode(bytes)?)?),
            Self::Log => Message::Log(log_line::from_ros(cdr::decode(bytes)?)?),
        })
    }
}

/// Encodes `message` into `out`, and replaces its content.
///
/// # Errors
/// [`EncodeError`] if a count, stamp or id has no ROS form.
pub fn encode_message(message: &Message, header: &RecordingHeader, out: &mut Vec<u8>) -> Result<(), EncodeError> {
    match message {
        Message::JointSensors(m) => joints::encode(m.stamp, &m.counts, header, out)?,
        Message::JointCommand(m) => joints::encode(m.stamp, &m.counts, header, out)?,
        Message::JointStates(m) => joints::encode(m.stamp, &m.angles, header, out)?,
        Message::Detections(m) => cdr::encode(&detections::to_ros(m, header)?, out)?,
        Message::Rejects(m) => cdr::encode(&rejects::to_ros(m, header)?, out)?,
        Message::Image(m) => cdr::encode(&images::to_ros(m, header)?, out)?,
        Message::Temperature(m) => cdr::encode(&temperatures::to_ros(m, header)?, out)?,
        Message::Pressure(m) => cdr::encode(&pressure::to_ros(m, header)?, out)?,
        Message::Attitude(m) => cdr::encode(&attitude::to_ros(m, header)?, out)?,
        Message::Gripper(m) => cdr::encode(&joints::gripper_to_ros(m.stamp, m.opening_m)?, out)?,
        Message::GripperCommand(m) => cdr::encode(&joints::gripper_to_ros(m.stamp, m.opening_m)?, out)?,
        Message::Task(m) => cdr::encode(&task::to_ros(m, header)?, out)?,
        Message::Survey(m) => cdr::encode(&survey::to_ros(m, header)?, out)?,
        Message::Touch(m) => cdr::encode(&touch::to_ros(m, header)?, out)?,
        Message::Mark(m) => cdr::encode(&marks::to_ros(m)?, out)?,
        Message::Log(m) => cdr::encode(&log_line::to_ros(m)?, out)?,
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::samples;
    use super::super::topics::VIEWER_TOPICS;
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_stream_has_a_topic_of_its_own() {
        let topics: BTreeSet<_> = Stream::ALL.iter().map(|stream| stream.topic()).chain(VIEWER_TOPICS).collect();
        assert_eq!(topics.len(), Stream::ALL.len() + VIEWER_TOPICS.len());
    }

    #[test]
    fn each_stream_round_trips_through_its_bytes() {
        let (mut bytes, mut streams) = (Vec::new(), BTreeSet::new());
        for message in samples::one_of_each() {
            encode_message(&message, &samples::header(), &mut bytes).unwrap();
            let stream = Stream::of(&message);
            assert_eq!(stream.decode(&bytes, &mut FirstJoints::default()), Ok(message));
            streams.insert(stream);
        }
        assert_eq!(streams, Stream::ALL.into());
    }

    #[test]
    fn flipped_bits_and_cut_bytes_never_panic() {
        let (mut bytes, mut accepted) = (Vec::new(), 0);
        for message in samples::one_of_each() {
            let stream = Stream::of(&message);
            encode_message(&message, &samples::header(), &mut bytes).unwrap();
            for at in 0..bytes.len() * 8 {
                let mut damaged = bytes.clone();
                damaged[at / 8] ^= 1 << (at % 8);
                accepted += u32::from(stream.decode(&damaged, &mut FirstJoints::default()).is_ok());
                let _ = stream.decode(&damaged[..at / 8], &mut FirstJoints::default());
            }
        }
        assert!(accepted > 0);
    }
}

//! Names of the topics, and which of them carries which message.

use super::ros;
use super::schema::{RosMessage, RosSchema};
use crate::streams::{Message, Thermometer};

/// Raw readings of the joint sensors, counts in `position`.
pub const JOINT_SENSORS: &str = "/joint_sensors";
/// Joint angles under the belief of the moment, rad.
pub const JOINT_STATES: &str = "/joint_states";
/// Set-points, counts.
pub const JOINT_COMMANDS: &str = "/joint_commands";
pub const DETECTIONS: &str = "/camera/wrist/detections";
/// What looked like a tag and was not taken for one.
pub const REJECTS: &str = "/camera/wrist/rejects";
pub const IMAGES: &str = "/camera/wrist/image/compressed";
pub const OIL_TEMPERATURE: &str = "/temperature/oil";
pub const WATER_TEMPERATURE: &str = "/temperature/water";
pub const DEPTH_PRESSURE: &str = "/depth_pressure";
pub const VEHICLE_IMU: &str = "/vehicle/imu";
/// The gap between the jaws, m in `position`.
pub const GRIPPER_STATE: &str = "/gripper_state";
/// The gap that the jaws are driven to, m in `position`.
pub const GRIPPER_COMMAND: &str = "/gripper_command";
pub const TASK: &str = "/task";
pub const TAG_SURVEY: &str = "/tag_survey";
pub const MARKS: &str = "/marks";
pub const LOG: &str = "/log";

/// The URDF as text, written once at the start.
pub const ROBOT_DESCRIPTION: &str = "/robot_description";
pub const CAMERA_INFO: &str = "/camera/wrist/camera_info";
pub const TF_STATIC: &str = "/tf_static";
pub const TF: &str = "/tf";

/// Topics of a recording that no [`Message`] comes from: they serve viewers.
pub const VIEWER_TOPICS: [&str; 4] = [ROBOT_DESCRIPTION, CAMERA_INFO, TF_STATIC, TF];

/// The streams that [`Message`]s travel on, one topic each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
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
    Marks,
    Log,
}

impl Stream {
    pub const ALL: [Self; 16] = [
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
        Self::Marks,
        Self::Log,
    ];

    /// The stream that a message travels on.
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
            Message::Mark(_) => Self::Marks,
            Message::Log(_) => Self::Log,
        }
    }

    /// Its topic in our own recordings.
    #[must_use]
    pub fn topic(self) -> &'static str {
        match self {
            Self::JointSensors => JOINT_SENSORS,
            Self::JointCommands => JOINT_COMMANDS,
            Self::JointStates => JOINT_STATES,
            Self::Detections => DETECTIONS,
            Self::Rejects => REJECTS,
            Self::Images => IMAGES,
            Self::OilTemperature => OIL_TEMPERATURE,
            Self::WaterTemperature => WATER_TEMPERATURE,
            Self::DepthPressure => DEPTH_PRESSURE,
            Self::VehicleImu => VEHICLE_IMU,
            Self::GripperState => GRIPPER_STATE,
            Self::GripperCommand => GRIPPER_COMMAND,
            Self::Task => TASK,
            Self::TagSurvey => TAG_SURVEY,
            Self::Marks => MARKS,
            Self::Log => LOG,
        }
    }

    /// The ROS type of its messages.
    #[must_use]
    pub fn schema(self) -> &'static RosSchema {
        match self {
            Self::JointSensors
            | Self::JointCommands
            | Self::JointStates
            | Self::GripperState
            | Self::GripperCommand => &ros::JointState::SCHEMA,
            Self::Detections => &ros::AprilTagDetectionArray::SCHEMA,
            Self::Rejects => &ros::DetectionRejects::SCHEMA,
            Self::Images => &ros::CompressedImage::SCHEMA,
            Self::OilTemperature | Self::WaterTemperature => &ros::Temperature::SCHEMA,
            Self::DepthPressure => &ros::FluidPressure::SCHEMA,
            Self::VehicleImu => &ros::Imu::SCHEMA,
            Self::Task => &ros::ReachTask::SCHEMA,
            Self::TagSurvey => &ros::TagSurvey::SCHEMA,
            Self::Marks => &ros::Mark::SCHEMA,
            Self::Log => &ros::Log::SCHEMA,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_stream_has_a_topic_of_its_own() {
        let topics: BTreeSet<_> = Stream::ALL.iter().map(|stream| stream.topic()).chain(VIEWER_TOPICS).collect();
        assert_eq!(topics.len(), Stream::ALL.len() + VIEWER_TOPICS.len());
    }
}

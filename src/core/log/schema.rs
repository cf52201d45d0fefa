//! Definitions of the messages as `ros2msg` text: the message itself, then every type that it names.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::ros;

/// A message type as the file declares it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RosSchema {
    /// Full name, `package/msg/Type`.
    pub name: &'static str,
    /// Definition with all its dependencies.
    pub text: &'static str,
}

/// A message whose bytes are CDR and whose definition is known.
pub trait RosMessage: Serialize + DeserializeOwned {
    const SCHEMA: RosSchema;
}

/// A dependency: separator, name and fields.
macro_rules! dependency {
    ($name:literal, $fields:literal) => {
        concat!(
            "================================================================================\nMSG: ",
            $name,
            "\n",
            $fields
        )
    };
}

macro_rules! time {
    () => {
        dependency!("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n")
    };
}

macro_rules! header {
    () => {
        concat!(dependency!("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"), time!())
    };
}

macro_rules! vector3 {
    () => {
        dependency!("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n")
    };
}

macro_rules! point {
    () => {
        dependency!("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n")
    };
}

macro_rules! quaternion {
    () => {
        dependency!("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n")
    };
}

macro_rules! message {
    ($type:ty, $name:literal, $($text:expr),+ $(,)?) => {
        impl RosMessage for $type {
            const SCHEMA: RosSchema = RosSchema { name: $name, text: concat!($($text),+) };
        }
    };
}

message!(ros::StringMessage, "std_msgs/msg/String", "string data\n");

message!(
    ros::JointState,
    "sensor_msgs/msg/JointState",
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
    header!(),
);

message!(
    ros::CameraInfo,
    "sensor_msgs/msg/CameraInfo",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n",
    "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
    header!(),
    dependency!(
        "sensor_msgs/RegionOfInterest",
        "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"
    ),
);

message!(
    ros::Temperature,
    "sensor_msgs/msg/Temperature",
    "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n",
    header!(),
);

message!(
    ros::FluidPressure,
    "sensor_msgs/msg/FluidPressure",
    "std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n",
    header!(),
);

message!(
    ros::Imu,
    "sensor_msgs/msg/Imu",
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n",
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n",
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
    header!(),
    quaternion!(),
    vector3!(),
);

message!(
    ros::TfMessage,
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/TransformStamped[] transforms\n",
    dependency!(
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    ),
    header!(),
    dependency!("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"),
    vector3!(),
    quaternion!(),
);

message!(
    ros::PoseStamped,
    "geometry_msgs/msg/PoseStamped",
    "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    header!(),
    dependency!("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    point!(),
    quaternion!(),
);

message!(
    ros::Log,
    "rcl_interfaces/msg/Log",
    "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n",
    "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line\n",
    time!(),
);

message!(
    ros::AprilTagDetectionArray,
    "apriltag_msgs/msg/AprilTagDetectionArray",
    "std_msgs/Header header\napriltag_msgs/AprilTagDetection[] detections\n",
    header!(),
    dependency!(
        "apriltag_msgs/AprilTagDetection",
        "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\n\
         apriltag_msgs/Point centre\napriltag_msgs/Point[4] corners\nfloat64[9] homography\n"
    ),
    dependency!("apriltag_msgs/Point", "float64 x\nfloat64 y\n"),
);

message!(
    ros::DetectionRejects,
    "armcal_msgs/msg/DetectionRejects",
    "std_msgs/Header header\narmcal_msgs/DetectionReject[] rejects\n",
    header!(),
    dependency!("armcal_msgs/DetectionReject", "uint32 id\nstring reason\napriltag_msgs/Point[4] corners\n"),
    dependency!("apriltag_msgs/Point", "float64 x\nfloat64 y\n"),
);

message!(
    ros::CompressedImage,
    "sensor_msgs/msg/CompressedImage",
    "std_msgs/Header header\nstring format\nuint8[] data\n",
    header!(),
);

message!(
    ros::ReachTask,
    "armcal_msgs/msg/ReachTask",
    "std_msgs/Header header\ngeometry_msgs/Point[] targets\nfloat64 tolerance_m\n",
    header!(),
    point!(),
);

message!(
    ros::TagSurvey,
    "armcal_msgs/msg/TagSurvey",
    "std_msgs/Header header\nuint32 base_tag\narmcal_msgs/SurveyedTag[] tags\n",
    header!(),
    dependency!(
        "armcal_msgs/SurveyedTag",
        "uint32 id\nfloat64 size_m\ngeometry_msgs/Pose pose\nfloat64 position_std_m\nfloat64 rotation_std_rad\n"
    ),
    dependency!("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    point!(),
    quaternion!(),
);

message!(
    ros::Mark,
    "armcal_msgs/msg/Mark",
    "builtin_interfaces/Time start\nbuiltin_interfaces/Time end\nstring kind\nuint32 index\n",
    time!(),
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_that_a_definition_names_is_defined_in_it() {
        let schemas = [
            ros::StringMessage::SCHEMA,
            ros::JointState::SCHEMA,
            ros::CameraInfo::SCHEMA,
            ros::Temperature::SCHEMA,
            ros::FluidPressure::SCHEMA,
            ros::Imu::SCHEMA,
            ros::TfMessage::SCHEMA,
            ros::PoseStamped::SCHEMA,
            ros::Log::SCHEMA,
            ros::AprilTagDetectionArray::SCHEMA,
            ros::DetectionRejects::SCHEMA,
            ros::CompressedImage::SCHEMA,
            ros::ReachTask::SCHEMA,
            ros::TagSurvey::SCHEMA,
            ros::Mark::SCHEMA,
        ];
        for schema in schemas {
            for line in schema.text.lines().filter(|line| !line.starts_with("MSG: ") && !line.starts_with('=')) {
                let field_type = line.split_whitespace().next().unwrap().split('[').next().unwrap();
                if field_type.contains('/') {
                    let definition = format!("{}\nMSG: {field_type}\n", "=".repeat(80));
                    assert!(schema.text.contains(&definition), "{}: {field_type}", schema.name);
                }
            }
        }
    }
}

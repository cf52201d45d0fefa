//! Definitions of message types as `ros2msg` text: the message itself, then every type that it references.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A message type as the file declares it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RosSchema {
    /// Full name, `package/msg/Type`.
    pub name: &'static str,
    /// Definition with all its dependencies.
    pub text: &'static str,
}

/// Returns true if `name` is the type `full` (`package/msg/Type`); some converters omit `msg`.
#[must_use]
pub fn is_type(name: &str, full: &str) -> bool {
    let is_short =
        || full.split_once("/msg/").is_some_and(|(package, last)| name.split_once('/') == Some((package, last)));
    name == full || is_short()
}

/// A message with CDR bytes and a known definition.
pub trait RosMessage: Serialize + DeserializeOwned {
    /// Name and definition of the ROS type.
    const SCHEMA: RosSchema;
}

/// A dependency: separator, name and fields.
macro_rules! dependency {
    ($name:literal, $($fields:literal),+ $(,)?) => {
        concat!(
            "================================================================================\nMSG: ",
            $name,
            "\n",
            $($fields),+
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

/// Names a message type and defines its fields.
macro_rules! message {
    ($type:ty, $name:literal, $($text:expr),+ $(,)?) => {
        impl RosMessage for $type {
            const SCHEMA: RosSchema = RosSchema { name: $name, text: concat!($($text),+) };
        }
    };
}

#[cfg(test)]
mod tests {
    use super::super::message_codec::Stream;
    use super::super::messages::{
        CameraInfo, ImageAnnotations, IsaacDetectionArray, PoseStamped, SceneUpdate, StringMessage, TfMessage,
    };
    use super::*;

    #[test]
    fn every_type_that_a_definition_names_is_defined_in_it() {
        let foxglove = [SceneUpdate::SCHEMA, ImageAnnotations::SCHEMA];
        let viewers = [StringMessage::SCHEMA, CameraInfo::SCHEMA, TfMessage::SCHEMA, PoseStamped::SCHEMA];
        let others = [IsaacDetectionArray::SCHEMA].into_iter().chain(viewers).chain(foxglove);
        for schema in Stream::ALL.map(|stream| *stream.schema()).into_iter().chain(others) {
            for line in schema.text.lines().filter(|line| !line.starts_with("MSG: ") && !line.starts_with('=')) {
                let field_type = line.split_whitespace().next().unwrap().split('[').next().unwrap();
                if field_type.contains('/') {
                    let definition = format!("{}\nMSG: {field_type}\n", "=".repeat(80));
                    assert!(schema.text.contains(&definition), "{}: {field_type}", schema.name);
                }
            }
        }
    }

    #[test]
    fn types_of_other_packages_are_others() {
        let full = "apriltag_msgs/msg/AprilTagDetectionArray";
        assert!(is_type(full, full) && is_type("apriltag_msgs/AprilTagDetectionArray", full));
        for other in ["apriltag_ros/msg/AprilTagDetectionArray", "AprilTagDetectionArray", "apriltag_msgs/msg", ""] {
            assert!(!is_type(other, full), "{other}");
        }
    }
}

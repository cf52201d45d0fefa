//! The ROS 2 messages of a recording, field by field as their definitions in `schema` order them.
//!
//! Quaternions here are x, y, z, w, as ROS has them; everywhere else in this crate w comes first.

use serde::{Deserialize, Serialize};

use super::error::{DecodeRejection, EncodeError};
use crate::time::Stamp;

const NANOS_PER_S: i64 = 1_000_000_000;

/// builtin_interfaces/msg/Time: seconds and nanoseconds since the Unix epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    pub sec: i32,
    pub nanosec: u32,
}

impl TryFrom<Stamp> for Time {
    type Error = EncodeError;

    fn try_from(stamp: Stamp) -> Result<Self, EncodeError> {
        let sec = i32::try_from(stamp.nanos.div_euclid(NANOS_PER_S)).map_err(|_| EncodeError::StampRange { stamp })?;
        Ok(Self { sec, nanosec: stamp.nanos.rem_euclid(NANOS_PER_S) as u32 })
    }
}

impl TryFrom<Time> for Stamp {
    type Error = DecodeRejection;

    fn try_from(time: Time) -> Result<Self, DecodeRejection> {
        if i64::from(time.nanosec) >= NANOS_PER_S {
            return Err(DecodeRejection::StampNanos { nanosec: time.nanosec });
        }
        Ok(Self { nanos: i64::from(time.sec) * NANOS_PER_S + i64::from(time.nanosec) })
    }
}

/// std_msgs/msg/Header.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    pub stamp: Time,
    pub frame_id: String,
}

/// std_msgs/msg/String.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StringMessage {
    pub data: String,
}

/// sensor_msgs/msg/JointState; position in rad, or in raw counts on `/joint_sensors` and `/joint_commands`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    pub header: Header,
    pub name: Vec<String>,
    pub position: Vec<f64>,
    pub velocity: Vec<f64>,
    pub effort: Vec<f64>,
}

/// sensor_msgs/msg/RegionOfInterest, px.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    pub x_offset: u32,
    pub y_offset: u32,
    pub height: u32,
    pub width: u32,
    pub do_rectify: bool,
}

/// sensor_msgs/msg/CameraInfo, px; `k`, `r`, `p` row by row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraInfo {
    pub header: Header,
    pub height: u32,
    pub width: u32,
    /// "equidistant" for four coefficients of a fisheye, "plumb_bob" for five of a pinhole camera.
    pub distortion_model: String,
    pub d: Vec<f64>,
    pub k: [f64; 9],
    pub r: [f64; 9],
    pub p: [f64; 12],
    pub binning_x: u32,
    pub binning_y: u32,
    pub roi: RegionOfInterest,
}

/// sensor_msgs/msg/Temperature, degrees Celsius and their square.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Temperature {
    pub header: Header,
    pub temperature: f64,
    pub variance: f64,
}

/// sensor_msgs/msg/FluidPressure, Pa and Pa squared.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FluidPressure {
    pub header: Header,
    pub fluid_pressure: f64,
    pub variance: f64,
}

/// geometry_msgs/msg/Quaternion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Quaternion {
    /// From w, x, y, z.
    #[must_use]
    pub fn from_wxyz([w, x, y, z]: [f64; 4]) -> Self {
        Self { x, y, z, w }
    }

    /// As w, x, y, z.
    #[must_use]
    pub fn wxyz(self) -> [f64; 4] {
        [self.w, self.x, self.y, self.z]
    }
}

/// geometry_msgs/msg/Vector3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// geometry_msgs/msg/Point, m.
pub type Point = Vector3;

impl From<[f64; 3]> for Vector3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<Vector3> for [f64; 3] {
    fn from(v: Vector3) -> Self {
        [v.x, v.y, v.z]
    }
}

/// sensor_msgs/msg/Imu, rad/s and m/s2; covariances row by row, -1 first where the sensor lacks the quantity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Imu {
    pub header: Header,
    pub orientation: Quaternion,
    pub orientation_covariance: [f64; 9],
    pub angular_velocity: Vector3,
    pub angular_velocity_covariance: [f64; 9],
    pub linear_acceleration: Vector3,
    pub linear_acceleration_covariance: [f64; 9],
}

/// geometry_msgs/msg/Transform, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    pub translation: Vector3,
    pub rotation: Quaternion,
}

/// geometry_msgs/msg/TransformStamped: maps coordinates of `child_frame_id` to `header.frame_id`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Transform,
}

/// tf2_msgs/msg/TFMessage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TfMessage {
    pub transforms: Vec<TransformStamped>,
}

/// geometry_msgs/msg/Pose, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    pub position: Point,
    pub orientation: Quaternion,
}

/// geometry_msgs/msg/PoseStamped.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    pub header: Header,
    pub pose: Pose,
}

/// rcl_interfaces/msg/Log; levels 10 debug, 20 info, 30 warn, 40 error, 50 fatal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log {
    pub stamp: Time,
    pub level: u8,
    pub name: String,
    pub msg: String,
    pub file: String,
    pub function: String,
    pub line: u32,
}

/// apriltag_msgs/msg/Point, px.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PixelPoint {
    pub x: f64,
    pub y: f64,
}

/// apriltag_msgs/msg/AprilTagDetection; the corners in the order of `streams::TagDetection`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AprilTagDetection {
    pub family: String,
    pub id: i32,
    pub hamming: i32,
    pub goodness: f32,
    pub decision_margin: f32,
    pub centre: PixelPoint,
    pub corners: [PixelPoint; 4],
    /// Row by row; zeros where the writer has none.
    pub homography: [f64; 9],
}

/// apriltag_msgs/msg/AprilTagDetectionArray.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AprilTagDetectionArray {
    pub header: Header,
    pub detections: Vec<AprilTagDetection>,
}

/// armcal_msgs/msg/DetectionReject: corners as in apriltag_msgs/msg/AprilTagDetection.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DetectionReject {
    pub id: u32,
    pub reason: String,
    pub corners: [PixelPoint; 4],
}

/// armcal_msgs/msg/DetectionRejects: what looked like a tag in one image and was not taken for one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DetectionRejects {
    pub header: Header,
    pub rejects: Vec<DetectionReject>,
}

/// sensor_msgs/msg/CompressedImage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompressedImage {
    pub header: Header,
    pub format: String,
    pub data: Vec<u8>,
}

/// armcal_msgs/msg/ReachTask: `targets` in the frame `header.frame_id`, m.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReachTask {
    pub header: Header,
    pub targets: Vec<Point>,
    pub tolerance_m: f64,
}

/// armcal_msgs/msg/SurveyedTag: `pose` in the frame of the survey's header, m; one sigma per axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurveyedTag {
    pub id: u32,
    pub size_m: f64,
    pub pose: Pose,
    pub position_std_m: f64,
    pub rotation_std_rad: f64,
}

/// armcal_msgs/msg/TagSurvey: where the tags are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TagSurvey {
    pub header: Header,
    pub base_tag: u32,
    pub tags: Vec<SurveyedTag>,
}

/// armcal_msgs/msg/Mark: what the span `start..=end` was for.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mark {
    pub start: Time,
    pub end: Time,
    pub kind: String,
    pub index: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_before_and_after_the_epoch_round_trip() {
        for nanos in [0, 1, -1, 999_999_999, -1_000_000_000, 1_767_225_600_123_456_789] {
            let time = Time::try_from(Stamp { nanos }).unwrap();
            assert_eq!(Stamp::try_from(time).unwrap().nanos, nanos);
        }
        assert!(Time::try_from(Stamp { nanos: i64::MAX }).is_err());
        assert!(Stamp::try_from(Time { sec: 0, nanosec: 1_000_000_000 }).is_err());
    }
}

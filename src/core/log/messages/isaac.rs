//! Tag detections of NVIDIA's package `isaac_ros_apriltag_interfaces`.

use serde::{Deserialize, Serialize};

use super::basic::{Header, PixelPoint, Point, Pose};
use super::detections::{AprilTagDetection, AprilTagDetectionArray};
use crate::log::cdr::{CdrError, decode};
use crate::log::schema::{RosMessage, RosSchema, is_type};

/// geometry_msgs/msg/PoseWithCovarianceStamped.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovarianceStamped {
    /// Stamp of the image, and the frame of the camera.
    pub header: Header,
    /// Pose `camera_from_tag`; not read.
    pub pose: Pose,
    /// Covariance of the pose, row by row; not read.
    pub covariance: [[f64; 6]; 6],
}

/// isaac_ros_apriltag_interfaces/msg/AprilTagDetection; the corners in the order of [`AprilTagDetection`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IsaacDetection {
    /// Name of the family, such as `tag36h11`; not read.
    pub family: String,
    /// Id of the tag in the family.
    pub id: i32,
    /// Centre in pixels; z is unused.
    pub center: Point,
    /// Corners in pixels; z is unused.
    pub corners: [Point; 4],
    /// Pose of the tag in the camera's frame, by the detector's own lens.
    pub pose: PoseWithCovarianceStamped,
}

/// isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IsaacDetectionArray {
    /// Stamp of the image, and the frame of the camera.
    pub header: Header,
    /// All tags of the image.
    pub detections: Vec<IsaacDetection>,
}

message!(
    IsaacDetectionArray,
    "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray",
    "std_msgs/Header header\nisaac_ros_apriltag_interfaces/AprilTagDetection[] detections\n",
    header!(),
    dependency!(
        "isaac_ros_apriltag_interfaces/AprilTagDetection",
        "string family\nint32 id\ngeometry_msgs/Point center\ngeometry_msgs/Point[4] corners\n\
         geometry_msgs/PoseWithCovarianceStamped pose\n"
    ),
    point!(),
    dependency!(
        "geometry_msgs/PoseWithCovarianceStamped",
        "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n"
    ),
    dependency!("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"),
    dependency!("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    quaternion!(),
);

impl From<IsaacDetectionArray> for AprilTagDetectionArray {
    fn from(isaac: IsaacDetectionArray) -> Self {
        let pixel = |point: Point| PixelPoint { x: point.x, y: point.y };
        let detection = |tag: IsaacDetection| AprilTagDetection {
            family: tag.family,
            id: tag.id,
            centre: pixel(tag.center),
            corners: tag.corners.map(pixel),
            ..AprilTagDetection::default()
        };
        Self { header: isaac.header, detections: isaac.detections.into_iter().map(detection).collect() }
    }
}

/// Decodes tag detections of the types that armcal reads; `None` for a message of another type.
pub fn decode_detections(type_name: &str, bytes: &[u8]) -> Option<Result<AprilTagDetectionArray, CdrError>> {
    if is_type(type_name, AprilTagDetectionArray::SCHEMA.name) {
        return Some(decode(bytes));
    }
    is_type(type_name, IsaacDetectionArray::SCHEMA.name).then(|| decode::<IsaacDetectionArray>(bytes).map(Into::into))
}

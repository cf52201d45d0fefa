//! Messages for viewers: robot description, camera model, transforms and poses.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use super::basic::{Header, Pose, Quaternion, Transform};
use crate::log::error::EncodeError;
use crate::log::schema::{RosMessage, RosSchema};
use crate::time::Stamp;

/// std_msgs/msg/String.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StringMessage {
    /// Content; on `/robot_description` a URDF.
    pub data: String,
}

message!(StringMessage, "std_msgs/msg/String", "string data\n");

/// sensor_msgs/msg/RegionOfInterest, px.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the fields are those of the ROS type")]
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
    /// Frame of the camera, without a stamp.
    pub header: Header,
    /// Rows of the image.
    pub height: u32,
    /// Columns of the image.
    pub width: u32,
    /// "equidistant" for four coefficients of a fisheye, "plumb_bob" for five of a pinhole camera.
    pub distortion_model: String,
    /// Coefficients of the distortion.
    pub d: Vec<f64>,
    /// Intrinsics: focal lengths and centre.
    pub k: [f64; 9],
    /// Rectification; the identity for a single camera.
    pub r: [f64; 9],
    /// Projection of the rectified image.
    pub p: [f64; 12],
    /// Binning along x; 0: none.
    pub binning_x: u32,
    /// Binning along y; 0: none.
    pub binning_y: u32,
    /// Region of interest; all zero: the whole image.
    pub roi: RegionOfInterest,
}

message!(
    CameraInfo,
    "sensor_msgs/msg/CameraInfo",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n",
    "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
    header!(),
    dependency!(
        "sensor_msgs/RegionOfInterest",
        "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"
    ),
);

/// geometry_msgs/msg/TransformStamped: maps coordinates of `child_frame_id` to `header.frame_id`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    /// Stamp, and the parent frame.
    pub header: Header,
    /// The child frame.
    pub child_frame_id: String,
    /// Pose of the child in the parent frame.
    pub transform: Transform,
}

impl TransformStamped {
    /// Builds the transform of the second frame in the first.
    ///
    /// # Errors
    /// [`EncodeError::StampRange`].
    pub fn new(stamp: Stamp, frames: [&str; 2], parent_from_child: &Isometry3<f64>) -> Result<Self, EncodeError> {
        let [parent, child] = frames;
        let (shift, turn) = (&parent_from_child.translation.vector, &parent_from_child.rotation);
        let rotation = Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w };
        let transform = Transform { translation: <[f64; 3]>::from(*shift).into(), rotation };
        Ok(Self { header: Header::new(stamp, parent)?, child_frame_id: child.to_owned(), transform })
    }
}

/// tf2_msgs/msg/TFMessage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TfMessage {
    /// Transforms in any order; stamps may differ.
    pub transforms: Vec<TransformStamped>,
}

message!(
    TfMessage,
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

/// geometry_msgs/msg/PoseStamped.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    /// Stamp, and the frame in which the pose is.
    pub header: Header,
    /// Position and orientation in that frame.
    pub pose: Pose,
}

message!(
    PoseStamped,
    "geometry_msgs/msg/PoseStamped",
    "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    header!(),
    dependency!("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    point!(),
    quaternion!(),
);

//! Camera images, as JPEG in our recordings.

use serde::{Deserialize, Serialize};

use super::basic::Header;
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::header::RecordingHeader;
use crate::log::schema::{RosMessage, RosSchema};
use crate::streams::CameraImage;

/// sensor_msgs/msg/CompressedImage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompressedImage {
    /// Stamp of the exposure, and the frame of the camera.
    pub header: Header,
    /// Format: `jpeg`, or a text that contains it; all others are rejected.
    pub format: String,
    /// Bytes of the JPEG file.
    pub data: Vec<u8>,
}

message!(
    CompressedImage,
    "sensor_msgs/msg/CompressedImage",
    "std_msgs/Header header\nstring format\nuint8[] data\n",
    header!(),
);

/// sensor_msgs/msg/Image; armcal writes none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image {
    /// Stamp of the exposure, and the frame of the camera.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Encoding of the pixels, such as `mono8`, `bgr8` or `bayer_rggb8`.
    pub encoding: String,
    /// Byte order; 0: little endian.
    pub is_bigendian: u8,
    /// Bytes from one row to the next.
    pub step: u32,
    /// Pixels, `step * height` bytes.
    pub data: Vec<u8>,
}

message!(
    Image,
    "sensor_msgs/msg/Image",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n",
    "uint8[] data\n",
    header!(),
);

pub(in crate::log) fn to_ros(m: &CameraImage, header: &RecordingHeader) -> Result<CompressedImage, EncodeError> {
    let header = Header::new(m.stamp, &header.camera_frame)?;
    Ok(CompressedImage { header, format: "jpeg".to_owned(), data: m.jpeg.clone() })
}

pub(in crate::log) fn from_ros(m: CompressedImage) -> Result<CameraImage, DecodeRejection> {
    if !m.format.contains("jpeg") {
        return Err(DecodeRejection::ImageFormat);
    }
    Ok(CameraImage { stamp: m.header.stamp.try_into()?, jpeg: m.data })
}

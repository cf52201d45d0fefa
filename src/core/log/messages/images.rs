//! Camera images as JPEG.

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
    /// `jpeg`, or a text that contains it; all else is rejected.
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

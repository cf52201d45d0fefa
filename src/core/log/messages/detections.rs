//! Tag detections of one camera image.

use serde::{Deserialize, Serialize};

use super::basic::{Header, PixelPoint};
use super::checks::finite;
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::header::RecordingHeader;
use crate::log::schema::{RosMessage, RosSchema};
use crate::streams::{TagDetection, TagDetections};

/// apriltag_msgs/msg/AprilTagDetection; the corners in the order of `streams::TagDetection`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AprilTagDetection {
    /// Name of the family, such as `tag36h11`; not read.
    pub family: String,
    /// Id of the tag in the family; negative ids are rejected.
    pub id: i32,
    /// Number of bits that the decoder corrected; 0 in our recordings.
    pub hamming: i32,
    /// Unused; 0 in our recordings.
    pub goodness: f32,
    /// Decision margin as apriltag gives it; a larger one is more certain.
    pub decision_margin: f32,
    /// Mean of the corners in our recordings; not read.
    pub centre: PixelPoint,
    /// Corners in raw, distorted pixels.
    pub corners: [PixelPoint; 4],
    /// Homography, row by row; zeros if the writer has none.
    pub homography: [f64; 9],
}

/// apriltag_msgs/msg/AprilTagDetectionArray.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AprilTagDetectionArray {
    /// Stamp of the image, and the frame of the camera.
    pub header: Header,
    /// All tags of the image.
    pub detections: Vec<AprilTagDetection>,
}

message!(
    AprilTagDetectionArray,
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

pub(in crate::log) fn to_ros(
    m: &TagDetections,
    header: &RecordingHeader,
) -> Result<AprilTagDetectionArray, EncodeError> {
    Ok(AprilTagDetectionArray {
        header: Header::new(m.stamp, &header.camera_frame)?,
        detections: m.tags.iter().map(|tag| detection_to_ros(tag, &header.tag_family)).collect::<Result<_, _>>()?,
    })
}

/// Converts a detection. The centre is the mean of the corners. Goodness, Hamming distance and homography are zero: our
/// messages lack them.
fn detection_to_ros(tag: &TagDetection, family: &str) -> Result<AprilTagDetection, EncodeError> {
    let mean = |axis: usize| tag.corners_px.iter().map(|corner| corner[axis]).sum::<f64>() / 4.0;
    Ok(AprilTagDetection {
        family: family.to_owned(),
        id: i32::try_from(tag.id).map_err(|_| EncodeError::TagId { id: tag.id })?,
        hamming: 0,
        goodness: 0.0,
        decision_margin: tag.decision_margin as f32,
        centre: PixelPoint { x: mean(0), y: mean(1) },
        corners: tag.corners_px.map(|[x, y]| PixelPoint { x, y }),
        homography: [0.0; 9],
    })
}

pub(in crate::log) fn from_ros(m: &AprilTagDetectionArray) -> Result<TagDetections, DecodeRejection> {
    let tags = m.detections.iter().map(detection_from_ros).collect::<Result<_, _>>()?;
    Ok(TagDetections { stamp: m.header.stamp.try_into()?, tags })
}

fn detection_from_ros(tag: &AprilTagDetection) -> Result<TagDetection, DecodeRejection> {
    let corners_px = tag.corners.map(|corner| [corner.x, corner.y]);
    finite("corners", corners_px.into_iter().flatten())?;
    finite("decision_margin", [f64::from(tag.decision_margin)])?;
    Ok(TagDetection {
        id: u32::try_from(tag.id).map_err(|_| DecodeRejection::NegativeTagId)?,
        corners_px,
        decision_margin: f64::from(tag.decision_margin),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn negative_tag_id_is_rejected() {
        let tag = AprilTagDetection { id: -1, ..Default::default() };
        assert_eq!(detection_from_ros(&tag), Err(DecodeRejection::NegativeTagId));
    }
}

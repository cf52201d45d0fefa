//! Candidates of one camera image that the detector rejected.

use serde::{Deserialize, Serialize};

use super::basic::{Header, PixelPoint};
use super::checks::finite;
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::header::RecordingHeader;
use crate::log::schema::{RosMessage, RosSchema};
use crate::streams::{self, RejectReason};

/// armcal_msgs/msg/DetectionReject: corners as in apriltag_msgs/msg/AprilTagDetection.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DetectionReject {
    /// Decoded id, right or wrong.
    pub id: u32,
    /// Reason of the rejection: name of a [`RejectReason`].
    pub reason: String,
    /// Corners in raw, distorted pixels.
    pub corners: [PixelPoint; 4],
}

/// armcal_msgs/msg/DetectionRejects: rejected candidates for tags in one image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DetectionRejects {
    /// Stamp of the image, and the frame of the camera.
    pub header: Header,
    /// All rejected candidates of the image.
    pub rejects: Vec<DetectionReject>,
}

message!(
    DetectionRejects,
    "armcal_msgs/msg/DetectionRejects",
    "std_msgs/Header header\narmcal_msgs/DetectionReject[] rejects\n",
    header!(),
    dependency!("armcal_msgs/DetectionReject", "uint32 id\nstring reason\napriltag_msgs/Point[4] corners\n"),
    dependency!("apriltag_msgs/Point", "float64 x\nfloat64 y\n"),
);

pub(in crate::log) fn to_ros(
    m: &streams::DetectionRejects,
    header: &RecordingHeader,
) -> Result<DetectionRejects, EncodeError> {
    let reject = |r: &streams::DetectionReject| DetectionReject {
        id: r.id,
        reason: r.reason.name().to_owned(),
        corners: r.corners_px.map(|[x, y]| PixelPoint { x, y }),
    };
    Ok(DetectionRejects {
        header: Header::new(m.stamp, &header.camera_frame)?,
        rejects: m.rejects.iter().map(reject).collect(),
    })
}

pub(in crate::log) fn from_ros(m: &DetectionRejects) -> Result<streams::DetectionRejects, DecodeRejection> {
    let reject = |r: &DetectionReject| -> Result<streams::DetectionReject, DecodeRejection> {
        let corners_px = r.corners.map(|corner| [corner.x, corner.y]);
        finite("corners", corners_px.into_iter().flatten())?;
        let reason = RejectReason::ALL.into_iter().find(|reason| reason.name() == r.reason);
        Ok(streams::DetectionReject { id: r.id, corners_px, reason: reason.ok_or(DecodeRejection::UnknownReason)? })
    };
    let rejects = m.rejects.iter().map(reject).collect::<Result<_, _>>()?;
    Ok(streams::DetectionRejects { stamp: m.header.stamp.try_into()?, rejects })
}

//! Targets that the tool is to reach.

use serde::{Deserialize, Serialize};

use super::basic::{Header, Point};
use super::checks::finite;
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::header::RecordingHeader;
use crate::log::schema::{RosMessage, RosSchema};
use crate::streams;

/// armcal_msgs/msg/ReachTask: `targets` in the frame `header.frame_id`, m.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReachTask {
    /// Stamp, and the frame of the arm's base.
    pub header: Header,
    /// Positions that the tool is to reach.
    pub targets: Vec<Point>,
    /// Largest distance that counts as a hit; above 0.
    pub tolerance_m: f64,
}

message!(
    ReachTask,
    "armcal_msgs/msg/ReachTask",
    "std_msgs/Header header\ngeometry_msgs/Point[] targets\nfloat64 tolerance_m\n",
    header!(),
    point!(),
);

pub(in crate::log) fn to_ros(m: &streams::ReachTask, header: &RecordingHeader) -> Result<ReachTask, EncodeError> {
    Ok(ReachTask {
        header: Header::new(m.stamp, &header.base_frame)?,
        targets: m.targets_m.iter().copied().map(Into::into).collect(),
        tolerance_m: m.tolerance_m,
    })
}

pub(in crate::log) fn from_ros(m: &ReachTask) -> Result<streams::ReachTask, DecodeRejection> {
    let targets_m: Vec<[f64; 3]> = m.targets.iter().copied().map(Into::into).collect();
    finite("targets", targets_m.iter().flatten().copied())?;
    finite("tolerance_m", [m.tolerance_m])?;
    if m.tolerance_m <= 0.0 {
        return Err(DecodeRejection::Tolerance);
    }
    let (stamp, poses) = (m.header.stamp.try_into()?, Vec::new());
    Ok(streams::ReachTask { stamp, targets_m, tolerance_m: m.tolerance_m, poses })
}

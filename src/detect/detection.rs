//! The result of detection in one image.

use nalgebra::Matrix2;

use armcal_core::streams::{DetectionReject, TagDetection};

/// A tag that passed all gates.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectedTag {
    /// Corners as printed: bottom left, bottom right, top right, top left; pixel centres at whole numbers.
    pub detection: TagDetection,
    /// Covariance of each corner, in the order of `detection`, px2. Errors of neighbouring corners, which share a side,
    /// are correlated.
    pub covariances_px2: [Matrix2<f64>; 4],
}

/// Tags and rejected candidates of one image; tags by id, rejects by id and position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImageDetections {
    /// Tags that passed all gates, each id once.
    pub tags: Vec<DetectedTag>,
    /// Rejected candidates, each with the first gate that it failed.
    pub rejects: Vec<DetectionReject>,
}

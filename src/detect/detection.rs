//! The result of detection in one image.

use nalgebra::Matrix2;

use armcal_core::streams::{DetectionReject, TagDetection};

/// A tag that passed all gates.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectedTag {
    /// Corners as printed: bottom left, bottom right, top right, top left; pixel centres at whole numbers.
    pub detection: TagDetection,
    /// Of each corner, in the same order, px2. Neighbouring corners share a side and are not independent.
    pub covariances_px2: [Matrix2<f64>; 4],
}

/// Tags and rejected candidates of one image; tags by id, rejects by id and position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImageDetections {
    /// Those that passed all gates; an id once.
    pub tags: Vec<DetectedTag>,
    /// Each with the first gate that it failed.
    pub rejects: Vec<DetectionReject>,
}

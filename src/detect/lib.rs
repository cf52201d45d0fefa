//! AprilTags (family 36h11) in fisheye images.
//!
//! The AprilTag project's C library finds and decodes quadrilaterals, in the image and in one of evened contrast (`contrast`); it
//! takes sides for straight, which a fisheye bends. So
//! each tag is fitted again with the lens model (`fit`): the known pattern, out of focus, on the bearings of the tag's pixels.
//! The fit gives corners, a covariance for each, and figures by which doubtful tags are rejected with a reason (`judge`).
//! The CLI's `study detection` measures all of it on images with known truth.

mod bearings;
mod contrast;
mod detector;
mod fit;
mod homography;
mod judge;
mod look;
mod normal;
mod pattern;
mod samples;

use nalgebra::Matrix2;

use armcal_core::streams::{DetectionReject, TagDetection};
pub use detector::{DetectError, TagDetector};
pub use judge::DetectorSettings;

/// A grey image, row by row from the top, `width` bytes a row.
#[derive(Clone, Copy, Debug)]
pub struct GreyImage<'a> {
    pub width: usize,
    pub height: usize,
    pub data: &'a [u8],
}

/// A tag that is believed.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectedTag {
    /// Corners as printed: bottom left, bottom right, top right, top left; pixel centres at whole numbers.
    pub detection: TagDetection,
    /// Of each corner, in the same order, px2. Neighbouring corners share a side and are not independent.
    pub covariances_px2: [Matrix2<f64>; 4],
}

/// What one image showed; tags by id, rejects by id and place.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detected {
    pub tags: Vec<DetectedTag>,
    pub rejects: Vec<DetectionReject>,
}

#[cfg(test)]
mod synthetic;
#[cfg(test)]
mod tag36h11_tests;
#[cfg(test)]
mod tests;

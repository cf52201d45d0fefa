//! Detection of AprilTags (those families of the C library that its crate has) in fisheye images.
//!
//! `decoder` finds and decodes quadrilaterals with the AprilTag project's C library, which assumes straight sides.
//! `fit` fits each tag again with the lens model, because a fisheye bends the sides. The fit gives corners and a
//! covariance of each. `gates` rejects doubtful tags with a reason. `detector` joins these steps.
//! `armcal-lab detection` measures the detector on images with known truth.
#![warn(missing_docs)]

mod bearings;
mod contrast;
mod decoder;
mod detection;
mod detector;
mod duplicates;
mod error;
mod fit;
mod gates;
mod homography;
mod image;
mod jpeg;
mod normal;
mod pattern;
mod samples;
mod settings;

pub use detection::{DetectedTag, ImageDetections};
pub use detector::TagDetector;
pub use error::DetectError;
pub use image::GreyImage;
pub use jpeg::{GreyPicture, grey_of_jpeg};
pub use settings::DetectorSettings;

#[cfg(test)]
mod synthetic;
#[cfg(test)]
mod tag_family_tests;
#[cfg(test)]
mod tests;

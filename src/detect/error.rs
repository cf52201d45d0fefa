//! Errors of the detector.

use armcal_core::codes::{Code, Coded};

/// Reason why an image could not be searched for tags.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum DetectError {
    #[error("the image holds {bytes} bytes, not {width} x {height}")]
    Size { bytes: usize, width: usize, height: usize },
    #[error("the image is {width} x {height} pixels, the lens's is {lens_width} x {lens_height}")]
    Resolution { width: usize, height: usize, lens_width: usize, lens_height: usize },
    #[error("the JPEG cannot be read: {0}")]
    Jpeg(String),
    #[error("the AprilTag library failed: {0}")]
    Library(String),
}

impl Coded for DetectError {
    fn code(&self) -> Code {
        match self {
            Self::Size { .. } | Self::Resolution { .. } | Self::Jpeg(_) => Code::ImageInvalid,
            Self::Library(_) => Code::Internal,
        }
    }
}

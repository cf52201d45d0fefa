//! The detector behind the reader of recordings.

use armcal_core::input::{ImageDetector, ImageProblem, RecordedImage, TagCorners};
use armcal_core::optics::CameraModel;
use armcal_detect::{DetectorSettings, GreyImage, TagDetector};

use super::grey::grey;

/// Finds tags of family 36h11 in recorded images of one camera.
#[derive(Debug)]
pub struct RecordedImageDetector {
    lens: CameraModel,
    /// Made for the first image: most recordings have none.
    detector: Option<TagDetector>,
}

impl RecordedImageDetector {
    /// A detector for images of `lens`.
    #[must_use]
    pub fn new(lens: &CameraModel) -> Self {
        Self { lens: *lens, detector: None }
    }
}

impl ImageDetector for RecordedImageDetector {
    fn detect(&mut self, image: &RecordedImage) -> Result<Vec<TagCorners>, ImageProblem> {
        let unusable = |error: armcal_detect::DetectError| ImageProblem::Unusable(error.to_string());
        let data = grey(image, self.lens.resolution_px())?;
        let [width, height] = self.lens.resolution_px().map(|n| n as usize);
        let detector = match &mut self.detector {
            Some(detector) => detector,
            none => none.insert(TagDetector::new(&self.lens, DetectorSettings::default()).map_err(unusable)?),
        };
        let found = detector.detect(GreyImage { width, height, data: &data }).map_err(unusable)?;
        Ok(found.tags.into_iter().map(|tag| (tag.detection.id, tag.detection.corners_px)).collect())
    }
}

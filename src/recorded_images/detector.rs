//! The detector behind the reader of recordings.

use armcal_core::input::{ImageDetector, ImageProblem, RecordedImage, TagCorners};
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_detect::{DetectorSettings, GreyImage, TagDetector};

use super::grey::grey;

/// Finds tags of one family in recorded images of one camera.
#[derive(Debug)]
pub struct RecordedImageDetector {
    lens: CameraModel,
    family: TagFamily,
    /// Made for the first image: most recordings have none.
    detector: Option<TagDetector>,
}

impl RecordedImageDetector {
    /// A detector for images of `lens`.
    #[must_use]
    pub fn new(lens: &CameraModel, family: TagFamily) -> Self {
        Self { lens: *lens, family, detector: None }
    }
}

impl ImageDetector for RecordedImageDetector {
    fn family(&self) -> TagFamily {
        self.family
    }

    fn detect(&mut self, image: &RecordedImage) -> Result<Vec<TagCorners>, ImageProblem> {
        let unusable = |error: armcal_detect::DetectError| ImageProblem::Unusable(error.to_string());
        let data = grey(image, self.lens.resolution_px())?;
        let [width, height] = self.lens.resolution_px().map(|n| n as usize);
        let detector = match &mut self.detector {
            Some(detector) => detector,
            none => {
                let settings = DetectorSettings::of_family(self.family);
                none.insert(TagDetector::new(&self.lens, settings).map_err(unusable)?)
            }
        };
        let found = detector.detect(GreyImage { width, height, data: &data }).map_err(unusable)?;
        Ok(found.tags.into_iter().map(|tag| (tag.detection.id, tag.detection.corners_px)).collect())
    }
}

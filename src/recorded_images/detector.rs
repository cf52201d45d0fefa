//! The tag detector that the reader of recordings uses.

use armcal_core::input::{ImageDetector, ImageProblem, RecordedImage, TagCorners};
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_detect::{DetectorSettings, GreyImage, TagDetector};

use super::grey::grey;

/// Finds tags of one family in recorded images.
#[derive(Debug)]
pub struct RecordedImageDetector {
    family: TagFamily,
    /// Lenses by the camera's number; a detector is made for a camera's first image, because most recordings have none.
    cameras: Vec<(CameraModel, Option<TagDetector>)>,
}

impl RecordedImageDetector {
    /// A detector for images through `lenses`, one of each camera.
    pub fn new<'a>(lenses: impl IntoIterator<Item = &'a CameraModel>, family: TagFamily) -> Self {
        Self { family, cameras: lenses.into_iter().map(|lens| (*lens, None)).collect() }
    }
}

impl ImageDetector for RecordedImageDetector {
    fn family(&self) -> TagFamily {
        self.family
    }

    fn detect(&mut self, camera: usize, image: &RecordedImage) -> Result<Vec<TagCorners>, ImageProblem> {
        let unusable = |error: armcal_detect::DetectError| ImageProblem::Unusable(error.to_string());
        let unknown = || ImageProblem::Unusable(format!("the image is of camera {camera}, whose lens is not known"));
        let (lens, detector) = self.cameras.get_mut(camera).ok_or_else(unknown)?;
        let data = grey(image, lens.resolution_px())?;
        let [width, height] = lens.resolution_px().map(|n| n as usize);
        let detector = match detector {
            Some(detector) => detector,
            none => {
                let settings = DetectorSettings::of_family(self.family);
                none.insert(TagDetector::new(lens, settings).map_err(unusable)?)
            }
        };
        let found = detector.detect(GreyImage { width, height, data: &data }).map_err(unusable)?;
        Ok(found.tags.into_iter().map(|tag| (tag.detection.id, tag.detection.corners_px)).collect())
    }
}

//! The tag detector for the images of a live camera.

use armcal_core::input::{ImageProblem, RecordedImage};
use armcal_core::log::ros::CompressedImage;
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_core::streams::{CameraImage, DetectionRejects, Message, TagDetections};
use armcal_detect::{DetectorSettings, GreyImage, TagDetector};
use armcal_live::TagFinder;

use super::grey::grey;

/// Finds tags of one family in the images of one live camera.
#[derive(Debug)]
pub struct LiveTagFinder {
    lens: CameraModel,
    family: TagFamily,
    /// Detector, made for the first image.
    detector: Option<TagDetector>,
}

impl LiveTagFinder {
    /// A detector for images of `lens`.
    #[must_use]
    pub fn new(lens: &CameraModel, family: TagFamily) -> Self {
        Self { lens: *lens, family, detector: None }
    }
}

impl TagFinder for LiveTagFinder {
    fn find(&mut self, image: &CameraImage) -> Result<Vec<Message>, String> {
        let stamp = image.stamp;
        let (format, data) = ("jpeg".to_owned(), image.jpeg.clone());
        let image = RecordedImage::Compressed(CompressedImage { format, data, ..CompressedImage::default() });
        let resolution_px = self.lens.resolution_px();
        let data = grey(&image, resolution_px).map_err(|problem| match problem {
            ImageProblem::Damaged => "it is damaged".to_owned(),
            ImageProblem::TooFewBytes => "it has too few bytes for its pixels".to_owned(),
            ImageProblem::Unusable(why) => why,
        })?;
        let [width, height] = resolution_px.map(|n| n as usize);
        let detector = match &mut self.detector {
            Some(detector) => detector,
            none => {
                let made = TagDetector::new(&self.lens, DetectorSettings::of_family(self.family));
                none.insert(made.map_err(|error| error.to_string())?)
            }
        };
        let found = detector.detect(GreyImage { width, height, data: &data }).map_err(|error| error.to_string())?;
        let tags = found.tags.into_iter().map(|tag| tag.detection).collect();
        let mut messages = vec![Message::Detections(TagDetections { stamp, tags })];
        if !found.rejects.is_empty() {
            messages.push(Message::Rejects(DetectionRejects { stamp, rejects: found.rejects }));
        }
        Ok(messages)
    }
}

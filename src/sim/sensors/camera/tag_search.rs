//! Computer of the camera: a thread that compresses images and searches them for tags while the world continues.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;

use crate::error::SimError;
use crate::imaging::Frame;
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_core::streams::{
    CameraImage, DetectionRejects, LateError, LateMessages, LateSender, Message, TagDetections,
};
use armcal_core::time::Stamp;
use armcal_detect::{DetectError, DetectorSettings, GreyImage, TagDetector, grey_of_jpeg};

/// Number of images that may wait; a camera that is further ahead waits.
const QUEUE: usize = 2;

/// Sender of images to the thread, which ends when the last sender is dropped.
#[derive(Debug)]
pub(super) struct TagSearch {
    images: SyncSender<Job>,
}

/// Recorded parts of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kept {
    TagsAlone,
    TagsAndImage,
}

struct Job {
    frame: Frame,
    stamp: Stamp,
    kept: Kept,
    messages: LateSender,
}

/// State of the thread.
struct Searcher {
    detector: TagDetector,
    jpeg_quality: u8,
}

impl TagSearch {
    /// Starts the search of images of a nominal lens.
    ///
    /// # Errors
    /// [`SimError::Detector`] where the detector or the thread does not start.
    pub(super) fn start(lens: &CameraModel, family: TagFamily, jpeg_quality: u8) -> Result<Self, SimError> {
        let settings = DetectorSettings::of_family(family);
        let (images, jobs) = sync_channel::<Job>(QUEUE);
        let (started, has_started) = sync_channel(1);
        let lens = *lens;
        let failed = |error: &dyn std::fmt::Display| SimError::Detector(error.to_string());
        let work = move || {
            let mut searcher = match TagDetector::new(&lens, settings) {
                Ok(detector) => Searcher { detector, jpeg_quality },
                Err(error) => {
                    let _ = started.send(Err(error));
                    return;
                }
            };
            let _ = started.send(Ok(()));
            for Job { frame, stamp, kept, messages } in jobs {
                // If the world is gone, nobody waits for its images.
                let _ = messages.send(searcher.search(&frame, stamp, kept));
            }
        };
        thread::Builder::new().name("camera".to_owned()).spawn(work).map_err(|error| failed(&error))?;
        has_started.recv().map_err(|error| failed(&error))?.map_err(|error| failed(&error))?;
        Ok(Self { images })
    }

    /// Returns the messages of an image, which arrive later.
    pub(super) fn search(&self, frame: Frame, stamp: Stamp, kept: Kept) -> LateMessages {
        let (messages, late) = LateMessages::pair();
        // Without a thread the sender is dropped, and `late` reports it.
        let _ = self.images.send(Job { frame, stamp, kept, messages });
        late
    }
}

impl Searcher {
    fn search(&mut self, frame: &Frame, stamp: Stamp, kept: Kept) -> Result<Vec<Message>, LateError> {
        // The camera delivers JPEG. The detector reads the same pixels as in the recording, even if this image is not
        // recorded.
        let jpeg = jpeg_bytes(frame, self.jpeg_quality)?;
        let unusable = |error: DetectError| SimError::Detector(error.to_string());
        let size_px = [frame.width, frame.height].map(|n| n as u32);
        let seen = grey_of_jpeg(&jpeg, size_px).map_err(unusable)?;
        let image = GreyImage { width: seen.width, height: seen.height, data: &seen.data };
        let found = self.detector.detect(image).map_err(unusable)?;
        let tags = found.tags.into_iter().map(|tag| tag.detection).collect();
        let mut messages = vec![Message::Detections(TagDetections { stamp, tags })];
        if !found.rejects.is_empty() {
            messages.push(Message::Rejects(DetectionRejects { stamp, rejects: found.rejects }));
        }
        if kept == Kept::TagsAndImage {
            messages.push(Message::Image(CameraImage { stamp, jpeg }));
        }
        Ok(messages)
    }
}

/// Compresses an image to JPEG; colours at half the resolution.
fn jpeg_bytes(frame: &Frame, quality: u8) -> Result<Vec<u8>, SimError> {
    use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
    let side = |n: usize| u16::try_from(n).map_err(|_| SimError::Jpeg(format!("a side of {n} pixels is too long")));
    let mut out = Vec::with_capacity(frame.rgb.len() / 10);
    let mut encoder = Encoder::new(&mut out, quality);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    let (width, height) = (side(frame.width)?, side(frame.height)?);
    encoder.encode(&frame.rgb, width, height, ColorType::Rgb).map_err(|error| SimError::Jpeg(error.to_string()))?;
    Ok(out)
}

//! Image annotations of detected tags, for viewers.

use crate::session::constants::annotations::{LINE_LOOP, OUTLINE};
use armcal_core::log::ros::{ImageAnnotations, PixelPoint, PointsAnnotation, TextAnnotation, Time};
use armcal_core::streams::{Message, TagDetection, TagDetections};
use armcal_core::time::Stamp;

/// Joins an image and its detections, in either order of arrival.
#[derive(Default)]
pub(crate) struct ImageMarks {
    image: Option<Stamp>,
    detections: Option<TagDetections>,
}

impl ImageMarks {
    /// Returns the annotations if this message is the second of the two.
    pub(crate) fn hear(&mut self, message: &Message) -> Option<ImageAnnotations> {
        match message {
            Message::Image(image) => self.image = Some(image.stamp),
            Message::Detections(detections) => self.detections = Some(detections.clone()),
            _ => return None,
        }
        let detections = self.detections.as_ref().filter(|found| Some(found.stamp) == self.image)?;
        let timestamp = Time::try_from(detections.stamp).ok()?;
        self.image = None;
        Some(ImageAnnotations {
            timestamp,
            points: detections.tags.iter().map(|tag| outline(timestamp, tag)).collect(),
            texts: detections.tags.iter().map(|tag| name(timestamp, tag)).collect(),
            ..ImageAnnotations::default()
        })
    }
}

fn outline(timestamp: Time, tag: &TagDetection) -> PointsAnnotation {
    PointsAnnotation {
        timestamp,
        kind: LINE_LOOP,
        points: tag.corners_px.iter().map(|&[x, y]| PixelPoint { x, y }).collect(),
        outline_color: OUTLINE,
        thickness: 2.0,
        ..PointsAnnotation::default()
    }
}

fn name(timestamp: Time, tag: &TagDetection) -> TextAnnotation {
    let [x, y] = tag.corners_px[0];
    TextAnnotation {
        timestamp,
        position: PixelPoint { x, y },
        text: tag.id.to_string(),
        font_size: 18.0,
        text_color: OUTLINE,
        ..TextAnnotation::default()
    }
}

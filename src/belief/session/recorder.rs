//! Keeps every message and remembers the latest of those that the loop steers by.

use std::collections::BTreeSet;

use crate::session::annotations::ImageMarks;
use crate::session::online_belief::OnlineBelief;
use crate::session::transforms::BelievedFrames;
use armcal_core::log::ros::{ImageAnnotations, TfMessage};
use armcal_core::log::{LogError, Recording, RecordingWriter, RosMessage, read_recording, topics};
use armcal_core::streams::{JointCounts, MarkKind, Message, Sink, SinkError, Thermometer};
use armcal_core::time::Stamp;

/// Hears every message after it was recorded. It must not wait.
pub type MessageListener = Box<dyn FnMut(Stamp, &Message) + Send>;

/// A recording being written, and the latest readings.
pub struct Recorder {
    pub(crate) writer: RecordingWriter,
    pub(crate) latest_counts: Option<JointCounts>,
    /// Latest of the oil's thermometer.
    pub(crate) oil_c: Option<f64>,
    /// Latest of the depth gauge.
    pub(crate) pressure_pa: Option<f64>,
    /// Latest measured gap between the jaws.
    pub(crate) opening_m: Option<f64>,
    /// Tags seen since it was last set to zero.
    pub(crate) tags_seen: usize,
    /// Which they were.
    pub(crate) ids_seen: BTreeSet<u32>,
    /// Hears every message while the arm works.
    pub(crate) online: Option<OnlineBelief>,
    listener: Option<MessageListener>,
    /// Draws the arm for viewers.
    pub(crate) frames: Option<BelievedFrames>,
    image_marks: ImageMarks,
}

impl Recorder {
    /// Writes to `writer`; no reading is known yet.
    #[must_use]
    pub fn new(writer: RecordingWriter) -> Self {
        Self {
            writer,
            latest_counts: None,
            oil_c: None,
            pressure_pa: None,
            opening_m: None,
            tags_seen: 0,
            ids_seen: BTreeSet::new(),
            online: None,
            listener: None,
            frames: None,
            image_marks: ImageMarks::default(),
        }
    }

    /// Tells every message, such as to a viewer. Nothing of the recording depends on it.
    #[must_use]
    pub fn with_listener(self, listener: Option<MessageListener>) -> Self {
        Self { listener, ..self }
    }

    /// The same, with the arm as believed and the tags found in images for viewers.
    #[must_use]
    pub fn with_frames(self, frames: BelievedFrames) -> Self {
        Self { frames: Some(frames), ..self }
    }

    /// The recording so far, read from its bytes on disk.
    ///
    /// # Errors
    /// [`LogError`] when it cannot be flushed or read.
    pub fn read_back(&mut self) -> Result<Recording, LogError> {
        self.writer.flush()?;
        read_recording(self.writer.path())
    }

    /// Writes what viewers draw by this message.
    fn draw(&mut self, log_time: Stamp, message: &Message) -> Result<(), LogError> {
        let Some(frames) = &mut self.frames else { return Ok(()) };
        if let Message::JointStates(states) = message
            && let Some(transforms) = frames.hear(states)
        {
            self.writer.write_ros(topics::TF, &TfMessage::SCHEMA, log_time, &transforms)?;
        }
        if let Some(marks) = self.image_marks.hear(message) {
            self.writer.write_ros(topics::IMAGE_MARKS, &ImageAnnotations::SCHEMA, log_time, &marks)?;
        }
        Ok(())
    }

    /// The writer, to add to the recording or to finish it.
    #[must_use]
    pub fn into_writer(self) -> RecordingWriter {
        self.writer
    }
}

impl Sink for Recorder {
    fn record(&mut self, log_time: Stamp, message: &Message) -> Result<(), SinkError> {
        match message {
            Message::JointSensors(sample) => self.latest_counts = Some(sample.counts),
            Message::Temperature(sample) if sample.thermometer == Thermometer::Oil => {
                self.oil_c = Some(sample.temperature_c)
            }
            Message::Pressure(sample) => self.pressure_pa = Some(sample.pressure_pa),
            Message::Gripper(sample) => self.opening_m = Some(sample.opening_m),
            Message::Detections(detections) => {
                self.tags_seen += detections.tags.len();
                self.ids_seen.extend(detections.tags.iter().map(|tag| tag.id));
            }
            _ => {}
        }
        self.writer.record(log_time, message)?;
        self.draw(log_time, message)?;
        if let Some(online) = &mut self.online {
            online.hear(log_time, message);
        }
        if let Some(listener) = &mut self.listener {
            listener(log_time, message);
        }
        // A view that was captured is on disk before the arm moves on.
        let is_touch = matches!(message, Message::Touch(_));
        if is_touch || matches!(message, Message::Mark(mark) if !matches!(mark.kind, MarkKind::Phase(_))) {
            self.writer.flush()?;
        }
        Ok(())
    }
}

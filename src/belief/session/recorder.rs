//! Records every message and keeps the latest of those that the control loop needs.

use std::collections::{BTreeSet, VecDeque};

use crate::session::annotations::ImageMarks;
use crate::session::online_belief::OnlineBelief;
use crate::session::transforms::BelievedFrames;
use armcal_core::log::ros::{ImageAnnotations, TfMessage};
use armcal_core::log::{LogError, Recording, RecordingWriter, RosMessage, read_recording, topics};
use armcal_core::streams::{JointCounts, LateMessages, MarkKind, Message, Sink, SinkError, Thermometer};
use armcal_core::time::Stamp;

/// Callback for every recorded message. It must not block.
pub type MessageListener = Box<dyn FnMut(Stamp, &Message) + Send>;

/// A recording being written, and the latest readings.
pub struct Recorder {
    pub(crate) writer: RecordingWriter,
    pub(crate) latest_counts: Option<JointCounts>,
    /// Latest reading of the oil's thermometer, degrees C.
    pub(crate) oil_c: Option<f64>,
    /// Latest reading of the depth gauge, Pa.
    pub(crate) pressure_pa: Option<f64>,
    /// Latest measured gap between the jaws, m.
    pub(crate) opening_m: Option<f64>,
    seen: TagsSeen,
    /// Online estimate that takes in every message while the arm works.
    pub(crate) online: Option<OnlineBelief>,
    listener: Option<MessageListener>,
    /// Draws the arm for viewers.
    pub(crate) frames: Option<BelievedFrames>,
    image_marks: ImageMarks,
    /// Messages that are outstanding, and those that wait for them.
    waiting: VecDeque<Waiting>,
}

/// Tags detected since the count began.
#[derive(Clone, Debug, Default)]
pub(crate) struct TagsSeen {
    pub n: usize,
    pub ids: BTreeSet<u32>,
}

enum Waiting {
    Late(Stamp, LateMessages),
    Behind(Stamp, Message),
}

impl Recorder {
    /// Returns a recorder on `writer`; no reading is known yet.
    #[must_use]
    pub fn new(writer: RecordingWriter) -> Self {
        Self {
            writer,
            latest_counts: None,
            oil_c: None,
            pressure_pa: None,
            opening_m: None,
            seen: TagsSeen::default(),
            online: None,
            listener: None,
            frames: None,
            image_marks: ImageMarks::default(),
            waiting: VecDeque::new(),
        }
    }

    /// Passes every message to `listener`, for instance a viewer. The recording does not depend on it.
    #[must_use]
    pub fn with_listener(self, listener: Option<MessageListener>) -> Self {
        Self { listener, ..self }
    }

    /// Adds the believed arm and the tags detected in images, for viewers.
    #[must_use]
    pub fn with_frames(self, frames: BelievedFrames) -> Self {
        Self { frames: Some(frames), ..self }
    }

    /// Returns the recording so far, read from its bytes on disk.
    ///
    /// # Errors
    /// [`LogError`] if it cannot be flushed or read.
    pub fn read_back(&mut self) -> Result<Recording, LogError> {
        self.settle()?;
        self.writer.flush()?;
        read_recording(self.writer.path())
    }

    /// Starts the count of detected tags.
    pub(crate) fn begin_count(&mut self) -> Result<(), LogError> {
        self.settle()?;
        self.seen = TagsSeen::default();
        Ok(())
    }

    /// Returns the tags detected since the count began.
    pub(crate) fn tags_seen(&mut self) -> Result<&TagsSeen, LogError> {
        self.settle()?;
        Ok(&self.seen)
    }

    /// Waits for outstanding messages, and records all. If some do not come, the others are recorded.
    pub(crate) fn settle(&mut self) -> Result<(), LogError> {
        self.catch_up(|late| Some(late.wait()))
    }

    /// Records waiting messages, in order, up to the first ones that `take` does not get.
    fn catch_up(
        &mut self,
        take: impl Fn(&LateMessages) -> Option<Result<Vec<Message>, SinkError>>,
    ) -> Result<(), LogError> {
        let mut result = Ok(());
        while let Some(first) = self.waiting.pop_front() {
            let (log_time, late) = match first {
                Waiting::Behind(log_time, message) => {
                    result = result.and(self.keep(log_time, &message));
                    continue;
                }
                Waiting::Late(log_time, late) => (log_time, late),
            };
            match take(&late) {
                None => {
                    self.waiting.push_front(Waiting::Late(log_time, late));
                    break;
                }
                Some(Ok(messages)) => {
                    for message in &messages {
                        result = result.and(self.keep(log_time, message));
                    }
                }
                Some(Err(source)) => {
                    let path = self.writer.path().to_owned();
                    result = result.and(Err(LogError::Late { path, source }));
                }
            }
        }
        result
    }

    /// Writes a message and passes it on.
    fn keep(&mut self, log_time: Stamp, message: &Message) -> Result<(), LogError> {
        if let Message::Detections(detections) = message {
            self.seen.n += detections.tags.len();
            self.seen.ids.extend(detections.tags.iter().map(|tag| tag.id));
        }
        self.writer.write(log_time, message)?;
        self.draw(log_time, message)?;
        if let Some(online) = &mut self.online {
            online.hear(log_time, message);
        }
        if let Some(listener) = &mut self.listener {
            listener(log_time, message);
        }
        // A captured view is on disk before the arm moves on.
        if needs_flush(message) {
            self.writer.flush()?;
        }
        Ok(())
    }

    /// Writes the messages that viewers draw because of this one.
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

    /// Returns the writer, to add to the recording or to finish it.
    #[must_use]
    pub fn into_writer(mut self) -> RecordingWriter {
        // A session without errors has settled. After a failure no caller can handle another one.
        let _ = self.settle();
        self.writer
    }
}

/// True if the message must be on disk before anything else happens.
fn needs_flush(message: &Message) -> bool {
    match message {
        Message::Touch(_) => true,
        Message::Mark(mark) => !matches!(mark.kind, MarkKind::Phase(_)),
        _ => false,
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
            _ => {}
        }
        if needs_flush(message) {
            self.settle()?;
        } else {
            self.catch_up(LateMessages::take_finished)?;
        }
        if self.waiting.is_empty() {
            return Ok(self.keep(log_time, message)?);
        }
        self.waiting.push_back(Waiting::Behind(log_time, message.clone()));
        Ok(())
    }

    fn record_late(&mut self, log_time: Stamp, messages: LateMessages) -> Result<(), SinkError> {
        self.waiting.push_back(Waiting::Late(log_time, messages));
        // The online estimate is queried between messages.
        if self.online.is_some() {
            self.settle()?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::log::RecordingHeader;
    use armcal_core::streams::{JointSensorSample, LateSender, LogLevel, LogLine, TagDetection, TagDetections};
    use armcal_core::time::SIMULATION_EPOCH;
    use std::thread;

    fn at(n: i64) -> Stamp {
        SIMULATION_EPOCH.plus_s(0.01 * n as f64)
    }

    fn reading(n: i64) -> Message {
        Message::JointSensors(JointSensorSample { stamp: at(n), counts: JointCounts::from_slice(&[n as f64]) })
    }

    fn seen(n: i64) -> Vec<Message> {
        let tag = TagDetection { id: n as u32, corners_px: [[1.0, 2.0]; 4], decision_margin: 50.0 };
        vec![
            Message::Detections(TagDetections { stamp: at(n), tags: vec![tag] }),
            Message::Log(LogLine {
                stamp: at(n),
                level: LogLevel::Info,
                name: "camera".to_owned(),
                text: format!("image {n}"),
            }),
        ]
    }

    /// Records thirty readings; every fifth comes with an image, which `record` passes on.
    fn recorded(mut record: impl FnMut(&mut Recorder, i64)) -> (tempfile::TempDir, Recorder) {
        let folder = tempfile::tempdir().expect("a folder");
        let header = RecordingHeader::new(vec!["j1".to_owned()]);
        let writer = RecordingWriter::create(folder.path().join("run.mcap"), header);
        let mut recorder = Recorder::new(writer.expect("a recording"));
        for n in 0..30 {
            if n % 5 == 0 {
                record(&mut recorder, n);
            }
            recorder.record(at(n), &reading(n)).expect("recorded");
            assert_eq!(recorder.latest_counts, Some(JointCounts::from_slice(&[n as f64])), "it does not wait");
        }
        (folder, recorder)
    }

    fn now(recorder: &mut Recorder, n: i64) {
        seen(n).iter().for_each(|message| recorder.record(at(n), message).expect("recorded"));
    }

    /// Pending detections, by image.
    type Searches = Vec<(i64, LateSender)>;

    fn later(recorder: &mut Recorder, n: i64, searches: &mut Searches) {
        let (sender, late) = LateMessages::pair();
        recorder.record_late(at(n), late).expect("taken");
        searches.push((n, sender));
    }

    /// Ends the pending detections, the last image first.
    fn end(searches: Searches) {
        searches.into_iter().rev().for_each(|(n, sender)| sender.send(Ok(seen(n))).expect("it waits"));
    }

    /// The recording has the same bytes regardless of the duration of the detections.
    #[test]
    fn late_messages_keep_their_place() {
        let (at_once_folder, at_once) = recorded(now);
        let mut searches = Searches::new();
        let (late_folder, mut late) = recorded(|recorder, n| {
            // The first two end while the arm continues.
            if n == 10 {
                end(std::mem::take(&mut searches));
            }
            later(recorder, n, &mut searches);
        });
        let beside = thread::spawn(move || end(searches));
        assert_eq!(late.tags_seen().expect("all came").n, 6);
        beside.join().expect("it ended");
        at_once.into_writer().finish().expect("whole");
        late.into_writer().finish().expect("whole");
        let bytes = |folder: &tempfile::TempDir| std::fs::read(folder.path().join("run.mcap")).expect("it is there");
        assert!(bytes(&at_once_folder) == bytes(&late_folder));
    }

    #[test]
    fn a_recording_that_is_read_back_has_what_came_late() {
        let mut searches = Searches::new();
        let (_folder, mut late) = recorded(|recorder, n| later(recorder, n, &mut searches));
        let beside = thread::spawn(move || end(searches));
        let recording = late.read_back().expect("it reads");
        beside.join().expect("it ended");
        assert_eq!(recording.messages.len(), 30 + 12);
        assert!(recording.messages.is_sorted_by_key(|(log_time, _)| *log_time));
    }

    /// A failed detection is reported, and later messages are recorded.
    #[test]
    fn messages_that_never_come_are_told() {
        let mut searches = Searches::new();
        let (folder, mut recorder) = recorded(|recorder, n| later(recorder, n, &mut searches));
        // The sender of this one is dropped.
        searches.remove(3);
        end(searches);
        let error = recorder.settle().expect_err("one is missing").to_string();
        insta::assert_snapshot!("messages_that_never_come", error.replace(&folder.path().display().to_string(), ".."));
        recorder.settle().expect("it was told");
        assert_eq!(recorder.read_back().expect("it reads").messages.len(), 30 + 10);
    }
}

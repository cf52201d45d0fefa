//! Reader of recordings of simulated and real arms.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::error::{DecodeRejection, LogError};
use super::message_codec::Stream;
use super::messages::joints::FirstJoints;
use super::order::{StampOrder, StampRegression};
use super::raw::{ChunkOrder, Completeness, RawMessage, RawSummary, for_each_raw, for_each_raw_twice};
use super::topics::VIEWER_TOPICS;
use crate::streams::Message;
use crate::time::Stamp;

/// Topics that differ from those of our recordings, and topics to keep undecoded.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TopicMap {
    /// Topic of the raw joint readings, instead of `/joint_sensors`, which is then not read.
    pub joint_sensors: Option<String>,
    /// Topic of the detections, instead of `/camera/wrist/detections`.
    pub detections: Option<String>,
    /// Topics whose messages are kept undecoded, such as `/tf`. None of them yields [`Message`]s.
    pub raw: BTreeSet<String>,
    /// Streams that are read; `None`: all.
    pub only: Option<BTreeSet<Stream>>,
}

/// A message kept undecoded, see [`TopicMap::raw`]; `super::decode` reads its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawRecord {
    /// Topic of the message, as recorded.
    pub topic: String,
    /// Name of the message's type; empty if the file has none.
    pub schema_name: String,
    /// Encoding of the message, such as `cdr`.
    pub message_encoding: String,
    /// Recorder's clock.
    pub log_time: Stamp,
    /// Encoded message, as recorded.
    pub data: Vec<u8>,
}

/// The messages of a recording, checked: every number in them is finite, and all joint messages have the same joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// The file, as given.
    pub path: PathBuf,
    /// Messages with their log times, ordered by them; messages of equal log time are in the order of the file.
    pub messages: Vec<(Stamp, Message)>,
    /// Names of the joints as in the joint messages, base first; empty if there are none.
    pub joint_names: Vec<String>,
    /// Completeness of the file: read to its end or not.
    pub completeness: Completeness,
    /// Corrections to the order of the file's chunks.
    pub chunk_order: ChunkOrder,
    /// Number of usable messages that are not in `messages`, by stream.
    pub left_in_file: BTreeMap<Stream, u64>,
    /// Messages kept undecoded, in the same order.
    pub raw: Vec<RawRecord>,
    /// Number of messages on unknown topics, by topic.
    pub unknown_topics: BTreeMap<String, u64>,
    /// Number of rejected messages, by "topic: reason".
    pub rejected: BTreeMap<String, u64>,
    /// Number of times that log time goes backwards, in the order of the file.
    pub non_monotonic: u64,
    /// First step back of the stamps of joint sensors and detections, by topic.
    pub stamp_regressions: BTreeMap<String, StampRegression>,
}

/// Reads a recording with our own topic names, see [`read_recording_with`]. Camera images are not kept;
/// `for_each_image` reads them.
///
/// # Errors
/// The errors of [`read_recording_with`].
pub fn read_recording(path: impl AsRef<Path>) -> Result<Recording, LogError> {
    let is_kept = |_: Stamp, message: &Message| !matches!(message, Message::Image(_));
    scan_recording(path, &TopicMap::default(), |_| {}, is_kept).map(|(recording, _)| recording)
}

/// Reads a recording with its images. Cuts, damage and unusable messages are no errors; the result counts them.
///
/// # Errors
/// [`LogError::Read`], [`LogError::Empty`], [`LogError::NotMcap`].
pub fn read_recording_with(path: impl AsRef<Path>, map: &TopicMap) -> Result<Recording, LogError> {
    scan_recording(path, map, |_| {}, |_, _| true).map(|(recording, _)| recording)
}

/// Reads a recording of any length. `on_raw` gets every message before it is decoded; of the decoded messages, `keep`
/// selects those that stay in memory. The counts of the result are of all messages.
///
/// # Errors
/// The errors of [`read_recording_with`].
pub fn scan_recording(
    path: impl AsRef<Path>,
    map: &TopicMap,
    mut on_raw: impl FnMut(&RawMessage<'_>),
    mut keep: impl FnMut(Stamp, &Message) -> bool,
) -> Result<(Recording, RawSummary), LogError> {
    let path = path.as_ref();
    let mut collector = Collector::new(map);
    let summary = for_each_raw(path, |message| {
        on_raw(message);
        collector.take(message, |raw, message| keep(raw.log_time(), message));
    })?;
    Ok((collector.finish(path, &summary), summary))
}

/// Selection of the messages that stay in memory, if it depends on the whole recording.
pub trait Choice {
    /// Takes a message of the first pass, and the part of the file in which it lies.
    fn note(&mut self, part: u64, message: &Message);
    /// Returns the parts to read again, after the first pass.
    fn parts(&mut self) -> BTreeSet<u64>;
    /// Returns true if a message of these parts stays in memory.
    fn keeps(&self, message: &Message) -> bool;
}

/// Reads a recording of any length in two passes: all of it, then the parts that `choice` needs. The counts of the
/// result are of all messages.
///
/// # Errors
/// The errors of [`read_recording_with`].
pub fn read_chosen(path: &Path, map: &TopicMap, choice: &mut impl Choice) -> Result<Recording, LogError> {
    let mut all = Collector::new(map);
    let (summary, again) = for_each_raw_twice(path, |raw| {
        all.take(raw, |raw, message| {
            choice.note(raw.part, message);
            false
        });
    })?;
    let mut chosen = Collector { joints: all.joints.clone(), ..Collector::new(map) };
    let parts = choice.parts();
    again
        .visit(parts, |raw| chosen.take(raw, |_, message| choice.keeps(message)))
        .map_err(|source| LogError::Read { path: path.to_owned(), source })?;
    for (_, message) in &chosen.messages {
        if let Some(n) = all.left_in_file.get_mut(&Stream::of(message)) {
            *n = n.saturating_sub(1);
        }
    }
    all.left_in_file.retain(|_, n| *n > 0);
    Ok(Collector { messages: chosen.messages, ..all }.finish(path, &summary))
}

/// Decodes messages and counts the unusable ones.
pub(super) struct Collector<'a> {
    map: &'a TopicMap,
    streams: BTreeMap<&'a str, Stream>,
    /// Topic of each stream, and the joints of its first message.
    joints: BTreeMap<Stream, (String, FirstJoints)>,
    messages: Vec<(Stamp, Message)>,
    left_in_file: BTreeMap<Stream, u64>,
    raw: Vec<RawRecord>,
    unknown_topics: BTreeMap<String, u64>,
    rejected: BTreeMap<String, u64>,
    latest: Stamp,
    non_monotonic: u64,
    order: BTreeMap<Stream, StampOrder>,
}

impl<'a> Collector<'a> {
    pub(super) fn new(map: &'a TopicMap) -> Self {
        let mut streams: BTreeMap<&str, Stream> = Stream::ALL.iter().map(|&stream| (stream.topic(), stream)).collect();
        let mapped = [(Stream::JointSensors, &map.joint_sensors), (Stream::Detections, &map.detections)];
        for (stream, topic) in mapped {
            if let Some(topic) = topic {
                streams.remove(stream.topic());
                streams.insert(topic, stream);
            }
        }
        let is_read = |stream: &Stream| map.only.as_ref().is_none_or(|only| only.contains(stream));
        streams.retain(|&topic, stream| !map.raw.contains(topic) && is_read(stream));
        Self {
            map,
            streams,
            joints: BTreeMap::new(),
            messages: Vec::new(),
            left_in_file: BTreeMap::new(),
            raw: Vec::new(),
            unknown_topics: BTreeMap::new(),
            rejected: BTreeMap::new(),
            latest: Stamp { nanos: i64::MIN },
            non_monotonic: 0,
            order: BTreeMap::new(),
        }
    }

    pub(super) fn take(&mut self, raw: &RawMessage<'_>, keep: impl FnOnce(&RawMessage<'_>, &Message) -> bool) {
        let topic = raw.topic();
        let Some(&stream) = self.streams.get(topic) else {
            return self.take_other(raw);
        };
        let (_, first) = self.joints.entry(stream).or_insert_with(|| (topic.to_owned(), FirstJoints::default()));
        match check(stream, raw).and_then(|()| stream.decode(raw.data, first)) {
            Ok(message) => {
                self.count_order(raw.log_time());
                if let Some(stamp) = ordered_stamp(&message) {
                    self.order.entry(stream).or_default().add(stamp);
                }
                if keep(raw, &message) {
                    self.messages.push((raw.log_time(), message));
                } else {
                    *self.left_in_file.entry(stream).or_default() += 1;
                }
            }
            Err(rejection) => self.reject(topic, &rejection, 1),
        }
    }

    /// Names of the joints in the sensors' messages so far.
    pub(super) fn sensor_joints(&self) -> Option<&[String]> {
        self.joints.get(&Stream::JointSensors)?.1.names.as_deref()
    }

    fn take_other(&mut self, raw: &RawMessage<'_>) {
        let topic = raw.topic();
        if self.map.raw.contains(topic) {
            self.count_order(raw.log_time());
            self.raw.push(RawRecord {
                topic: topic.to_owned(),
                schema_name: raw.schema_name().to_owned(),
                message_encoding: raw.channel.message_encoding.clone(),
                log_time: raw.log_time(),
                data: raw.data.to_vec(),
            });
        } else if !VIEWER_TOPICS.contains(&topic) {
            match self.unknown_topics.get_mut(topic) {
                Some(n) => *n += 1,
                None => _ = self.unknown_topics.insert(topic.to_owned(), 1),
            }
        }
    }

    fn count_order(&mut self, log_time: Stamp) {
        self.non_monotonic += u64::from(log_time < self.latest);
        self.latest = log_time;
    }

    fn reject(&mut self, topic: &str, rejection: &DecodeRejection, count: u64) {
        *self.rejected.entry(format!("{topic}: {rejection}")).or_default() += count;
    }

    pub(super) fn finish(mut self, path: &Path, summary: &RawSummary) -> Recording {
        let stamp_regressions = self
            .order
            .iter()
            .filter_map(|(stream, order)| {
                let named = self.streams.iter().find(|(_, of)| *of == stream);
                Some((named?.0.to_string(), order.first_regression()?))
            })
            .collect();
        let joint_names = self.settle_joint_names();
        self.messages.sort_by_key(|(log_time, _)| *log_time);
        self.raw.sort_by_key(|record| record.log_time);
        Recording {
            path: path.to_owned(),
            messages: self.messages,
            joint_names,
            completeness: summary.completeness.clone(),
            chunk_order: summary.chunk_order,
            left_in_file: self.left_in_file,
            raw: self.raw,
            unknown_topics: self.unknown_topics,
            rejected: self.rejected,
            non_monotonic: self.non_monotonic,
            stamp_regressions,
        }
    }

    /// Returns the names of the arm's joints: those of the joint sensors, or else of the first other stream of joints.
    /// Messages of streams with other names are rejected.
    fn settle_joint_names(&mut self) -> Vec<String> {
        // Stream orders the sensors first.
        let named: Vec<(Stream, String, Vec<String>)> = std::mem::take(&mut self.joints)
            .into_iter()
            .filter_map(|(stream, (topic, first))| Some((stream, topic, first.names?)))
            .collect();
        let Some((_, _, joint_names)) = named.first().cloned() else {
            return Vec::new();
        };
        for (stream, topic, _) in named.iter().filter(|(_, _, names)| *names != joint_names) {
            let before = self.messages.len();
            self.messages.retain(|(_, message)| Stream::of(message) != *stream);
            let n = (before - self.messages.len()) as u64 + self.left_in_file.remove(stream).unwrap_or(0);
            self.reject(topic, &DecodeRejection::OtherJoints, n);
        }
        joint_names
    }
}

/// Returns the stamp of a message whose stream must be in the order of time.
fn ordered_stamp(message: &Message) -> Option<Stamp> {
    match message {
        Message::JointSensors(sample) => Some(sample.stamp),
        Message::Detections(detections) => Some(detections.stamp),
        _ => None,
    }
}

/// Checks encoding, type and log time of a message before it is decoded.
fn check(stream: Stream, raw: &RawMessage<'_>) -> Result<(), DecodeRejection> {
    if raw.channel.message_encoding != "cdr" {
        return Err(DecodeRejection::MessageEncoding { found: raw.channel.message_encoding.clone() });
    }
    let expected = stream.schema().name;
    // ROS writes package/msg/Type; some converters omit `msg`.
    if raw.schema_name() != expected && raw.schema_name() != expected.replace("/msg/", "/") {
        return Err(DecodeRejection::Type { found: raw.schema_name().to_owned(), expected });
    }
    if i64::try_from(raw.log_time_nanos).is_err() {
        return Err(DecodeRejection::LogTimeRange);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::messages::{JointState, TfMessage, TransformStamped};
    use super::super::schema::RosMessage;
    use super::super::{RecordingWriter, decode, samples, topics};
    use super::*;
    use crate::streams::Sink;
    use crate::time::SIMULATION_EPOCH;

    fn joint_state(names: &[&str], position: &[f64]) -> JointState {
        let name = names.iter().map(|&name| name.into()).collect();
        JointState { name, position: position.to_vec(), ..Default::default() }
    }

    /// A recording of joint states on any topics.
    fn of_joints(path: &Path, messages: &[(&str, JointState)]) {
        let mut writer = RecordingWriter::create(path, samples::header()).unwrap();
        for (topic, message) in messages {
            writer.write_ros(topic, &JointState::SCHEMA, SIMULATION_EPOCH, message).unwrap();
        }
        writer.finish().unwrap();
    }

    #[test]
    fn every_message_round_trips_through_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let messages: Vec<_> = samples::one_of_each().into_iter().map(|m| (SIMULATION_EPOCH, m)).collect();
        samples::write(&path, &messages, 1000);
        let recording = read_recording_with(&path, &TopicMap::default()).unwrap();
        assert_eq!(recording.messages, messages);
        let without: Vec<_> = messages.iter().filter(|(_, m)| !matches!(m, Message::Image(_))).cloned().collect();
        assert!(without.len() < messages.len());
        assert_eq!(read_recording(&path).unwrap().messages, without);
        assert_eq!(recording.joint_names, samples::header().joint_names);
        assert_eq!(recording.completeness, Completeness::Whole);
        assert!(recording.rejected.is_empty() && recording.unknown_topics.is_empty());
    }

    #[test]
    fn bad_values_are_counted_by_topic_and_reason() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let good = joint_state(&["a", "b"], &[1.0, 2.0]);
        let messages = [
            ("/joint_sensors", joint_state(&["a", "b"], &[f64::NAN, 2.0])),
            ("/joint_sensors", good.clone()),
            ("/joint_sensors", joint_state(&["a", "b"], &[f64::INFINITY, 2.0])),
            ("/joint_sensors", joint_state(&["b", "a"], &[1.0, 2.0])),
            ("/joint_states", joint_state(&["gripper"], &[0.1])),
            ("/elsewhere", good),
            ("/marks", joint_state(&["a", "b"], &[1.0, 2.0])),
        ];
        of_joints(&path, &messages);
        let recording = read_recording(&path).unwrap();
        assert_eq!(recording.messages.len(), 1);
        assert_eq!(recording.joint_names, ["a", "b"]);
        let rejected = recording.rejected.iter().map(|(key, count)| format!("{count} x {key}\n"));
        insta::assert_snapshot!("rejected", rejected.collect::<String>());
        assert_eq!(recording.unknown_topics, [("/elsewhere".to_string(), 1)].into());
    }

    #[test]
    fn topic_map_renames_and_keeps_raw_messages() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let mut writer = RecordingWriter::create(&path, samples::header()).unwrap();
        let joints = joint_state(&["a"], &[5.0]);
        writer.write_ros("/joint_states", &JointState::SCHEMA, SIMULATION_EPOCH, &joints).unwrap();
        let tf = TfMessage { transforms: vec![TransformStamped::default()] };
        writer.write_ros(topics::TF, &TfMessage::SCHEMA, SIMULATION_EPOCH, &tf).unwrap();
        writer.finish().unwrap();

        let map = TopicMap {
            joint_sensors: Some("/joint_states".into()),
            raw: [topics::TF.to_string()].into(),
            ..Default::default()
        };
        let recording = read_recording_with(&path, &map).unwrap();
        assert!(matches!(&recording.messages[..], [(_, Message::JointSensors(sample))] if sample.counts[0] == 5.0));
        assert_eq!(recording.raw.len(), 1);
        assert_eq!(decode::<TfMessage>(&recording.raw[0].data), Ok(tf));
    }

    #[test]
    fn messages_are_ordered_by_log_time_and_steps_back_are_counted() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let mut messages = samples::stream(30);
        messages.swap(3, 9);
        let mut writer = RecordingWriter::create(&path, samples::header()).unwrap();
        for (log_time, message) in &messages {
            writer.record(*log_time, message).unwrap();
        }
        writer.finish().unwrap();
        let recording = read_recording(&path).unwrap();
        assert!(recording.non_monotonic > 0);
        messages.sort_by_key(|(log_time, _)| *log_time);
        assert!(recording.messages == messages);
    }
}

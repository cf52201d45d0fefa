//! Writer of recordings. The file is written in place and kept when the run is killed.
//!
//! The file only grows: at any moment the bytes on disk are the beginning of the finished file, whole chunks and at
//! most one cut record. A chunk ends, and goes to the operating system, after 2 s of log time, 1 MiB or a flush. The
//! bytes depend only on the calls, not on clock, machine load or environment.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, Compression, McapError, WriteOptions};
use serde::Serialize;

use super::cdr;
use super::error::{EncodeError, LogError};
use super::header::RecordingHeader;
use super::message_codec::{Stream, encode_message};
use super::schema::RosSchema;
use crate::streams::{Message, Sink, SinkError};
use crate::time::Stamp;

/// Uncompressed size at which a chunk ends, bytes.
const CHUNK_BYTES: u64 = 1 << 20;
/// Log time after which a chunk ends, ns: the longest span that a kill can lose. Shorter chunks compress worse.
const CHUNK_NANOS: u64 = 2_000_000_000;
const ZSTD_LEVEL: u32 = 3;

pub(super) type FileWriter = mcap::Writer<NoSeek<BufWriter<File>>>;

struct OpenChannel {
    id: u16,
    schema_name: String,
    next_sequence: u32,
}

/// An unfinished recording; the module describes the state of the file on disk.
///
/// Dropping it finishes the file and ignores errors; [`Self::finish`] returns them.
pub struct RecordingWriter {
    path: PathBuf,
    header: RecordingHeader,
    file: FileWriter,
    channels: BTreeMap<String, OpenChannel>,
    last_log_time_nanos: u64,
    /// Log time of the first message since the last flush.
    unflushed_since_nanos: Option<u64>,
    bytes: Vec<u8>,
}

impl RecordingWriter {
    /// Creates the file, replacing a file of that name. The directory must exist.
    ///
    /// # Errors
    /// [`LogError::NoDirectory`], [`LogError::Create`] (no permission, a directory of that name), [`LogError::Write`].
    pub fn create(path: impl AsRef<Path>, header: RecordingHeader) -> Result<Self, LogError> {
        let path = path.as_ref().to_owned();
        let file = create_file(&path)?;
        let mut writer = Self {
            path,
            header,
            file,
            channels: BTreeMap::new(),
            last_log_time_nanos: 0,
            unflushed_since_nanos: None,
            bytes: Vec::new(),
        };
        // The file has its opening bytes from the start.
        writer.flush()?;
        Ok(writer)
    }

    /// Path of the written file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes any message as CDR to any topic. The first message of a topic declares its type.
    ///
    /// # Errors
    /// [`LogError::Encode`], [`LogError::SchemaChanged`], [`LogError::Write`].
    pub fn write_ros<T: Serialize + ?Sized>(
        &mut self,
        topic: &str,
        schema: &RosSchema,
        log_time: Stamp,
        message: &T,
    ) -> Result<(), LogError> {
        let mut bytes = std::mem::take(&mut self.bytes);
        let encoded = cdr::encode(message, &mut bytes).map_err(|error| self.encode_error(topic, error.into()));
        let written = encoded.and_then(|()| self.write_bytes(topic, schema, log_time, &bytes));
        self.bytes = bytes;
        written
    }

    /// Attaches a file, such as the robot's URDF, and ends the current chunk. The estimator never reads attachments.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn attach(&mut self, name: &str, media_type: &str, bytes: &[u8]) -> Result<(), LogError> {
        let attachment = Attachment {
            log_time: self.last_log_time_nanos,
            create_time: 0,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: bytes.into(),
        };
        self.file.attach(&attachment).map_err(|source| self.write_error(source))
    }

    /// Adds a metadata record, such as the versions of a run, and ends the current chunk. The estimator never reads
    /// metadata.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn metadata(&mut self, name: &str, metadata: BTreeMap<String, String>) -> Result<(), LogError> {
        let record = Metadata { name: name.to_owned(), metadata };
        self.file.write_metadata(&record).map_err(|source| self.write_error(source))
    }

    /// Ends the current chunk: everything written so far can then be read from disk and survives a kill.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn flush(&mut self) -> Result<(), LogError> {
        self.unflushed_since_nanos = None;
        self.file.flush().map_err(|source| self.write_error(source))
    }

    /// Writes index and footer and closes the file.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn finish(mut self) -> Result<(), LogError> {
        // mcap flushes down to the file at the end; a full disk is noticed here.
        self.file.finish().map(|_| ()).map_err(|source| self.write_error(source))
    }

    fn write_bytes(&mut self, topic: &str, schema: &RosSchema, log_time: Stamp, data: &[u8]) -> Result<(), LogError> {
        let nanos = u64::try_from(log_time.nanos)
            .map_err(|_| self.encode_error(topic, EncodeError::LogTimeRange { log_time }))?;
        let (channel_id, sequence) = self.channel(topic, schema)?;
        let header = MessageHeader { channel_id, sequence, log_time: nanos, publish_time: nanos };
        self.file.write_to_known_channel(&header, data).map_err(|source| self.write_error(source))?;
        self.last_log_time_nanos = nanos;
        let since = *self.unflushed_since_nanos.get_or_insert(nanos);
        if nanos.abs_diff(since) >= CHUNK_NANOS { self.flush() } else { Ok(()) }
    }

    /// Returns the channel of `topic`, opened on first use, and the number of its next message.
    fn channel(&mut self, topic: &str, schema: &RosSchema) -> Result<(u16, u32), LogError> {
        if !self.channels.contains_key(topic) {
            let opened = self
                .file
                .add_schema(schema.name, "ros2msg", schema.text.as_bytes())
                .and_then(|schema_id| self.file.add_channel(schema_id, topic, "cdr", &BTreeMap::new()));
            let id = opened.map_err(|source| self.write_error(source))?;
            let channel = OpenChannel { id, schema_name: schema.name.to_owned(), next_sequence: 0 };
            self.channels.insert(topic.to_owned(), channel);
        }
        let channel = self.channels.get_mut(topic).filter(|channel| channel.schema_name == schema.name);
        let Some(channel) = channel else {
            return Err(self.schema_changed(topic, schema));
        };
        let sequence = channel.next_sequence;
        channel.next_sequence = sequence.wrapping_add(1);
        Ok((channel.id, sequence))
    }

    fn schema_changed(&self, topic: &str, schema: &RosSchema) -> LogError {
        LogError::SchemaChanged {
            path: self.path.clone(),
            topic: topic.to_owned(),
            first: self.channels.get(topic).map(|channel| channel.schema_name.clone()).unwrap_or_default(),
            now: schema.name.to_owned(),
        }
    }

    fn write_error(&self, source: McapError) -> LogError {
        LogError::Write { path: self.path.clone(), source }
    }

    /// Returns the error of a message of `topic` without a ROS form.
    #[must_use]
    pub fn encode_error(&self, topic: &str, source: EncodeError) -> LogError {
        LogError::Encode { path: self.path.clone(), topic: topic.to_owned(), source }
    }
}

impl RecordingWriter {
    /// Adds a message.
    ///
    /// # Errors
    /// [`LogError`] if the message has no ROS form, or the file cannot be written.
    pub fn write(&mut self, log_time: Stamp, message: &Message) -> Result<(), LogError> {
        let stream = Stream::of(message);
        let mut bytes = std::mem::take(&mut self.bytes);
        let encoded = encode_message(message, &self.header, &mut bytes)
            .map_err(|source| self.encode_error(stream.topic(), source));
        let written = encoded.and_then(|()| self.write_bytes(stream.topic(), stream.schema(), log_time, &bytes));
        self.bytes = bytes;
        written
    }
}

impl Sink for RecordingWriter {
    fn record(&mut self, log_time: Stamp, message: &Message) -> Result<(), SinkError> {
        Ok(self.write(log_time, message)?)
    }
}

/// Creates the file of a recording, with the options that make its bytes repeatable.
pub(super) fn create_file(path: &Path) -> Result<FileWriter, LogError> {
    let directory = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if !directory.is_dir() {
        return Err(LogError::NoDirectory { path: path.to_owned(), directory: directory.to_owned() });
    }
    let file = File::create(path).map_err(|source| LogError::Create { path: path.to_owned(), source })?;
    // A writer without seeking assembles a chunk in memory and appends it at once.
    WriteOptions::new()
        .profile("ros2")
        .library(concat!("armcal ", env!("CARGO_PKG_VERSION")))
        .chunk_size(Some(CHUNK_BYTES))
        .compression(Some(Compression::Zstd))
        .compression_level(ZSTD_LEVEL)
        .compression_threads(0)
        .disable_seeking(true)
        .create(NoSeek::new(BufWriter::new(file)))
        .map_err(|source| LogError::Write { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::super::messages::{Log, StringMessage};
    use super::super::reader::read_recording;
    use super::super::schema::RosMessage;
    use super::super::{Completeness, samples, topics};
    use super::*;

    fn with_everything(path: &Path) {
        let mut writer = RecordingWriter::create(path, samples::header()).unwrap();
        let description = StringMessage { data: "<robot/>".into() };
        let start = crate::time::SIMULATION_EPOCH;
        writer.write_ros(topics::ROBOT_DESCRIPTION, &StringMessage::SCHEMA, start, &description).unwrap();
        writer.attach("arm.urdf", "application/xml", b"<robot/>").unwrap();
        writer.metadata("run", [("armcal".to_string(), "0.1".to_string())].into()).unwrap();
        for (log_time, message) in samples::stream(3000) {
            writer.record(log_time, &message).unwrap();
        }
        writer.finish().unwrap();
    }

    #[test]
    fn same_messages_give_the_same_bytes() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (dir.path().join("a.mcap"), dir.path().join("b.mcap"));
        with_everything(&a);
        with_everything(&b);
        assert!(std::fs::read(a).unwrap() == std::fs::read(b).unwrap());
    }

    #[test]
    fn what_was_flushed_is_read_while_writing_goes_on() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let messages = samples::stream(500);
        let mut writer = RecordingWriter::create(&path, samples::header()).unwrap();
        let mut written = 0;
        for part in messages.chunks(200) {
            for (log_time, message) in part {
                writer.record(*log_time, message).unwrap();
            }
            writer.flush().unwrap();
            written += part.len();
            let recording = read_recording(&path).unwrap();
            assert!(recording.messages == messages[..written]);
            assert!(matches!(recording.completeness, Completeness::Cut { .. }));
        }
        writer.finish().unwrap();
        assert_eq!(read_recording(&path).unwrap().completeness, Completeness::Whole);
    }

    #[test]
    fn bytes_on_disk_are_always_the_beginning_of_the_finished_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let mut writer = RecordingWriter::create(&path, samples::header()).unwrap();
        let mut beginnings = Vec::new();
        for (n, (log_time, message)) in samples::stream(2000).iter().enumerate() {
            writer.record(*log_time, message).unwrap();
            if n % 250 == 0 {
                writer.flush().unwrap();
            }
            if n % 100 == 0 {
                beginnings.push(std::fs::read(&path).unwrap());
            }
        }
        writer.finish().unwrap();
        let whole = std::fs::read(&path).unwrap();
        assert!(beginnings.iter().all(|beginning| whole.starts_with(beginning)));
    }

    /// Even without a flush, a kill loses at most the unfinished chunk.
    #[test]
    fn no_more_than_two_seconds_are_missing_on_disk_at_any_moment() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let mut writer = RecordingWriter::create(&path, samples::header()).unwrap();
        assert!(matches!(read_recording(&path).unwrap().completeness, Completeness::Cut { .. }));
        for (n, (log_time, message)) in samples::stream(9000).iter().enumerate() {
            writer.record(*log_time, message).unwrap();
            if n % 700 == 699 {
                let on_disk = read_recording(&path).unwrap();
                let newest = on_disk.messages.last().map_or(crate::time::SIMULATION_EPOCH, |(log_time, _)| *log_time);
                let missing_s = log_time.since_s(newest);
                assert!((0.0..=2.01).contains(&missing_s), "{missing_s} s");
            }
        }
    }

    #[test]
    fn missing_directory_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let error = RecordingWriter::create(dir.path().join("no/run.mcap"), samples::header()).err().unwrap();
        assert!(matches!(error, LogError::NoDirectory { .. }), "{error}");
        let error = RecordingWriter::create(dir.path(), samples::header()).err().unwrap();
        assert!(matches!(error, LogError::Create { .. }), "{error}");
    }

    #[test]
    fn topic_keeps_its_type() {
        let dir = tempfile::tempdir().unwrap();
        let mut writer = RecordingWriter::create(dir.path().join("run.mcap"), samples::header()).unwrap();
        let (start, text) = (crate::time::SIMULATION_EPOCH, StringMessage::default());
        writer.write_ros("/x", &StringMessage::SCHEMA, start, &text).unwrap();
        let error = writer.write_ros("/x", &Log::SCHEMA, start, &Log::default()).unwrap_err();
        assert!(matches!(error, LogError::SchemaChanged { .. }), "{error}");
    }
}

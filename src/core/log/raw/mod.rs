//! Every message of any MCAP file as bytes, as far as the file can be read.
//!
//! The file may be whole, cut off at any byte, still being written, or hold flipped bits: whole chunks that pass their
//! checksum are read, damaged ones are skipped and counted, and no length in the file is believed before it is checked
//! against the file's size. Memory needed is that of the largest chunk, not of the file.

mod chunk;
mod contents;
mod foreign;
mod record;
mod scan;
mod window;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::rc::Rc;

use super::error::LogError;
use crate::time::Stamp;
pub use contents::{AttachmentInfo, ChunkTotals, FileContents};
use scan::ScanError;

/// Type of a topic's messages, as the file declares it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    pub name: String,
    pub encoding: String,
    pub data: Vec<u8>,
}

/// A topic, as the file declares it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    pub topic: String,
    pub message_encoding: String,
    pub metadata: BTreeMap<String, String>,
    /// `None` where the channel declares no type, or one that the file lacks.
    pub schema: Option<Rc<Schema>>,
}

/// One message, undecoded.
#[derive(Clone, Copy, Debug)]
pub struct RawMessage<'a> {
    pub channel: &'a Channel,
    /// Recorder's clock, nanoseconds since the Unix epoch.
    pub log_time_nanos: u64,
    /// Sender's clock, or the log time.
    pub publish_time_nanos: u64,
    pub sequence: u32,
    pub data: &'a [u8],
}

impl RawMessage<'_> {
    #[must_use]
    pub fn topic(&self) -> &str {
        &self.channel.topic
    }

    /// Name of the type, such as `sensor_msgs/msg/JointState`; empty where the file has none.
    #[must_use]
    pub fn schema_name(&self) -> &str {
        self.channel.schema.as_ref().map_or("", |schema| &schema.name)
    }

    /// Log time; past the year 2262 (only in damaged or foreign files) that year's last stamp.
    #[must_use]
    pub fn log_time(&self) -> Stamp {
        Stamp { nanos: i64::try_from(self.log_time_nanos).unwrap_or(i64::MAX) }
    }
}

/// How much of a recording's messages could be read. Attachments and metadata do not count: belief never reads them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Completeness {
    /// Footer and all messages are there.
    Whole,
    /// The end is missing: still being written, killed, or copied in part.
    Cut { reason: String, readable_messages: u64 },
    /// Bytes changed after they were written.
    Damaged {
        /// The first damage, with its place in the file.
        reason: String,
        lost_chunks: u64,
        /// Bytes of the file that were skipped.
        lost_bytes: u64,
        /// `None` where the file's own count is lost too.
        lost_messages: Option<u64>,
        readable_messages: u64,
    },
}

/// What [`for_each_raw`] found besides messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawSummary {
    pub completeness: Completeness,
    pub readable_messages: u64,
    pub contents: FileContents,
}

/// Hands every readable message of an MCAP file to `visit`, in the order of the file.
///
/// A chunk's messages are visited once its checksum has been verified. From a cut last chunk, the messages before the cut
/// are visited unverified.
///
/// # Errors
/// [`LogError::Read`], [`LogError::Empty`], [`LogError::NotMcap`]. Damage and cuts are no errors, see [`Completeness`].
pub fn for_each_raw(path: impl AsRef<Path>, visit: impl FnMut(&RawMessage<'_>)) -> Result<RawSummary, LogError> {
    let path = path.as_ref();
    scan::scan(open(path)?, visit).map_err(|error| of_scan(path, error))
}

/// What a file holds besides messages. Its messages are passed over, so damage within chunks is not noticed, and large
/// files are read quickly.
///
/// # Errors
/// As [`for_each_raw`].
pub fn file_contents(path: impl AsRef<Path>) -> Result<FileContents, LogError> {
    let path = path.as_ref();
    scan::scan_contents(open(path)?).map_err(|error| of_scan(path, error))
}

fn open(path: &Path) -> Result<File, LogError> {
    if path.is_dir() {
        let source = std::io::Error::other(describe_folder(path));
        return Err(LogError::Read { path: path.to_owned(), source });
    }
    File::open(path).map_err(|source| LogError::Read { path: path.to_owned(), source })
}

/// Recordings in the folder, for it may be that of a run or of a ROS 2 bag.
fn describe_folder(path: &Path) -> String {
    let names = std::fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let mut names: Vec<String> = names.filter_map(|name| name.into_string().ok()).collect();
    names.retain(|name| name.ends_with(".mcap") || name.ends_with(".mcap.partial"));
    names.sort();
    match names.len() {
        0 => "it is a folder, and no .mcap file lies in it".to_owned(),
        n if n <= 8 => format!("it is a folder; name one of its files: {}", names.join(", ")),
        n => format!("it is a folder; name one of its {n} .mcap files"),
    }
}

fn of_scan(path: &Path, error: ScanError) -> LogError {
    match error {
        ScanError::Read(source) => LogError::Read { path: path.to_owned(), source },
        ScanError::Empty => LogError::Empty { path: path.to_owned() },
        ScanError::NotMcap { found } => LogError::NotMcap { path: path.to_owned(), found },
    }
}

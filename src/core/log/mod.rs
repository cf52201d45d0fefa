//! Recordings: the streams of an arm as an MCAP file of ROS 2 messages.
//!
//! [`RecordingWriter`] is a sink of `streams` and writes bytes that depend on its input only. [`read_recording`] gives the
//! messages back, from simulated and real arms alike, and says what a cut or damaged file has lost. Below it,
//! [`for_each_raw`] and [`decode`] read any topic of any MCAP file with the same care. Belief hashes the messages that it
//! used with [`hash_messages`], never a file, and [`strip`] proves that nothing else of the file matters.

mod attachments;
mod cdr;
mod decode;
mod encode;
mod error;
mod hash;
mod images;
mod order;
mod raw;
mod reader;
pub mod ros;
mod schema;
mod strip;
pub mod topics;
mod writer;

#[cfg(test)]
mod samples;

pub use attachments::read_attachments;
pub use cdr::{CdrError, decode, encode};
pub use error::{DecodeRejection, EncodeError, LogError};
pub use hash::{MessageHasher, hash_messages};
pub use images::for_each_image;
pub use order::{StampOrder, StampRegression};
pub use raw::{
    AttachmentInfo, Channel, ChunkTotals, Completeness, FileContents, RawMessage, RawSummary, Schema, file_contents,
    for_each_raw,
};
pub use reader::{RawRecord, Recording, TopicMap, read_recording, read_recording_with, scan_recording};
pub use schema::{RosMessage, RosSchema};
pub use strip::strip;
pub use writer::{RecordingHeader, RecordingWriter};

//! Recordings: the streams of an arm as an MCAP file of ROS 2 messages.
//!
//! [`RecordingWriter`] is a sink of `streams`; its bytes depend on its input only. [`read_recording`] reads recordings
//! of simulated and real arms and reports the losses of a cut or damaged file. [`GrowingRecording`] reads one that is
//! still being written. [`for_each_raw`] and [`decode`] read any topic of any MCAP file. The table
//! `message_codec::Stream` names topic, ROS type and codec of each stream; `messages` holds the codecs.
//! [`hash_messages`] hashes messages, not files; [`strip`] copies only the messages.

#[macro_use]
mod schema;

mod attachments;
mod cdr;
mod error;
mod growing;
mod hash;
mod header;
mod images;
mod message_codec;
pub mod messages;
mod order;
mod raw;
mod reader;
mod strip;
pub mod topics;
mod writer;

#[cfg(test)]
mod samples;

pub use attachments::read_attachments;
pub use cdr::{CdrError, decode, encode};
pub use error::{DecodeRejection, EncodeError, LogError};
pub use growing::GrowingRecording;
pub use hash::{MessageHasher, hash_messages};
pub use header::RecordingHeader;
pub use images::for_each_image;
pub use message_codec::{Stream, encode_message};
/// The ROS types of the messages.
pub use messages as ros;
pub use order::{StampOrder, StampRegression};
pub use raw::{
    AttachmentInfo, Channel, ChunkOrder, ChunkTotals, Completeness, FILE_START_BYTES, FileContents, Growth,
    ROS1_ADVICE, RawMessage, RawSummary, Schema, describe_file, file_contents, for_each_raw,
};
pub use reader::{
    Choice, RawRecord, Recording, TopicMap, read_chosen, read_recording, read_recording_with, scan_recording,
};
pub use schema::{RosMessage, RosSchema, is_type};
pub use strip::strip;
pub use writer::RecordingWriter;

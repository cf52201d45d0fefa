//! Completeness of a recording.

use super::contents::FileContents;
use super::order::ChunkOrder;

/// Whether all messages of a recording could be read, and the file is as it was written. Attachments and metadata count
/// where the file has a checksum over all of its data.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Completeness {
    /// Footer and all messages are present.
    #[default]
    Whole,
    /// The end is missing: still being written, killed, or copied in part.
    Cut {
        /// Place of the end in the file, and what is incomplete there.
        reason: String,
        /// Number of messages read.
        readable_messages: u64,
    },
    /// Bytes changed after they were written.
    Damaged {
        /// The first damage, with its place in the file.
        reason: String,
        /// Number of chunks that were skipped, at least in part.
        lost_chunks: u64,
        /// Bytes of the file that were skipped.
        lost_bytes: u64,
        /// `None` where the file's own count is lost too.
        lost_messages: Option<u64>,
        /// Number of messages read.
        readable_messages: u64,
    },
}

/// Completeness and contents of a file whose messages have been read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RawSummary {
    /// Whether all messages could be read.
    pub completeness: Completeness,
    /// Number of messages read.
    pub readable_messages: u64,
    /// What was put right in the order of the chunks.
    pub chunk_order: ChunkOrder,
    /// Everything but the messages.
    pub contents: FileContents,
}

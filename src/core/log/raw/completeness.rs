//! Completeness of a recording.

use super::contents::FileContents;
use super::order::ChunkOrder;

/// Completeness of a recording: true to the written file, with all messages readable. Attachments and metadata count if
/// the file has a checksum over all of its data.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Completeness {
    /// Footer and all messages are present.
    #[default]
    Whole,
    /// The end is missing: still being written, killed, or copied in part.
    Cut {
        /// Position of the end in the file, and the incomplete item there.
        reason: String,
        /// Number of messages read.
        readable_messages: u64,
    },
    /// Bytes changed after they were written.
    Damaged {
        /// First damage, with its position in the file.
        reason: String,
        /// Number of chunks that were skipped, at least in part.
        lost_chunks: u64,
        /// Bytes of the file that were skipped.
        lost_bytes: u64,
        /// Number of lost messages; `None` if the file's own count is lost too.
        lost_messages: Option<u64>,
        /// Number of messages read.
        readable_messages: u64,
    },
}

/// Completeness and contents of a file whose messages have been read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RawSummary {
    /// Completeness of the messages and the file.
    pub completeness: Completeness,
    /// Number of messages read.
    pub readable_messages: u64,
    /// Corrections to the order of the chunks.
    pub chunk_order: ChunkOrder,
    /// Contents of the file other than messages.
    pub contents: FileContents,
}

//! Completeness of a recording.

use super::contents::FileContents;

/// Whether all messages of a recording could be read. Attachments and metadata do not count: belief never reads them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Completeness {
    /// Footer and all messages are present.
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

/// Completeness and contents of a file whose messages have been read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawSummary {
    pub completeness: Completeness,
    pub readable_messages: u64,
    pub contents: FileContents,
}

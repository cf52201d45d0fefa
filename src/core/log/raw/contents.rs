//! Contents of a file other than messages.

use std::collections::BTreeMap;

use mcap::records::op;

use super::record::{ChunkHead, Fields};

/// Maximum number of bytes read of a header, metadata or attachment record.
pub const MAX_HEAD_BYTES: u64 = 1 << 20;

/// Maximum number of bytes of such records that are kept in all.
const MAX_KEPT_BYTES: usize = 16 << 20;
/// Memory of one such record in addition to its texts, bytes.
const ENTRY_BYTES: usize = 1024;

/// Number and bytes of the chunks of one compression.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChunkTotals {
    /// Number of chunks.
    pub chunks: u64,
    /// Stored size of the chunks.
    pub compressed_bytes: u64,
    /// Unpacked size of the chunks, as their headers declare it.
    pub uncompressed_bytes: u64,
}

/// An attached file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AttachmentInfo {
    /// File name given by the writer.
    pub name: String,
    /// Media type, such as `application/xml`.
    pub media_type: String,
    /// Length of the attached data.
    pub bytes: u64,
    /// Start of the record's fields in the file, and their length.
    pub(in crate::log) record: (u64, u64),
}

/// Contents of a file other than messages, as far as they can be read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileContents {
    /// Length of the file, bytes.
    pub bytes: u64,
    /// Profile: `ros2`, `ros1`, empty or another.
    pub profile: String,
    /// Name of the program that wrote the file.
    pub library: String,
    /// Readable chunks by compression: `zstd`, `lz4` or empty.
    pub chunks: BTreeMap<&'static str, ChunkTotals>,
    /// Attachments in the order of the file; their data stay in the file.
    pub attachments: Vec<AttachmentInfo>,
    /// Name and key-value pairs of each record, in the order of the file.
    pub metadata: Vec<(String, BTreeMap<String, String>)>,
    pub(super) kept_bytes: usize,
}

impl FileContents {
    pub(super) fn add_chunk(&mut self, head: &ChunkHead) {
        let totals = self.chunks.entry(head.compression).or_default();
        totals.chunks += 1;
        totals.compressed_bytes += head.compressed_bytes;
        totals.uncompressed_bytes += head.uncompressed_bytes;
    }

    /// Adds a header, metadata or attachment record. `body` is the beginning of its fields, `record` their position.
    /// `None` if it is malformed, or exceeds the limit of kept bytes.
    pub(super) fn take(&mut self, opcode: u8, body: &[u8], record: (u64, u64)) -> Option<()> {
        let mut fields = Fields(body);
        // The data of an attachment stay in the file.
        self.kept_bytes += ENTRY_BYTES + if opcode == op::ATTACHMENT { 0 } else { body.len() };
        if self.kept_bytes > MAX_KEPT_BYTES {
            return None;
        }
        match opcode {
            op::HEADER => (self.profile, self.library) = (fields.text()?, fields.text()?),
            op::METADATA => self.metadata.push((fields.text()?, fields.pairs()?)),
            op::ATTACHMENT => {
                let _log_and_create_time = (fields.u64()?, fields.u64()?);
                let (name, media_type, bytes) = (fields.text()?, fields.text()?, fields.u64()?);
                if bytes > record.1 {
                    return None;
                }
                self.attachments.push(AttachmentInfo { name, media_type, bytes, record });
            }
            _ => {}
        }
        Some(())
    }
}

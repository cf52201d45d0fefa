//! Limits on the cost of reading a file: bytes unpacked, records, declarations.

use std::fmt;

/// Maximum length of a chunk or record that is read, packed or unpacked, bytes: three times this is in memory at once.
pub const MAX_RECORD_BYTES: u64 = 1 << 27;
/// Maximum length of a summary, a cut chunk or a record within it, bytes.
pub const MAX_UNCHECKED_BYTES: u64 = 1 << 26;
/// Unpacked size that is allowed for every chunk: zeros compress to almost nothing.
const ALWAYS_ALLOWED_BYTES: u64 = 1 << 26;
/// Largest compression ratio of a chunk beyond that; recordings reach 10.
const MAX_RATIO: u64 = 256;
/// Unpacked size that is allowed for every file, and the largest compression ratio of a whole file beyond that.
const ALWAYS_ALLOWED_FILE_BYTES: u64 = 8 << 30;
const MAX_FILE_RATIO: u64 = 32;
/// Number of records that is allowed for every chunk and for every file, and stored bytes of each record beyond that.
const ALWAYS_ALLOWED_RECORDS: u64 = 1 << 20;
const ALWAYS_ALLOWED_FILE_RECORDS: u64 = 1 << 24;
const MIN_BYTES_PER_RECORD: u64 = 4;
/// Cost of a chunk in addition to its records, in records: the start of unpacking takes as long.
const RECORDS_PER_CHUNK: u64 = 128;
/// Maximum number of bytes of different topics and types that a file may declare.
pub const MAX_DECLARED_BYTES: usize = 1 << 26;

/// Returns the largest plausible unpacked size of a chunk of `compressed_bytes`.
pub fn unpacked_limit(compressed_bytes: u64) -> u64 {
    let limit = compressed_bytes.saturating_mul(MAX_RATIO).saturating_add(ALWAYS_ALLOWED_BYTES);
    limit.min(MAX_RECORD_BYTES)
}

/// Returns the maximum number of records read of a chunk of `compressed_bytes`.
pub fn record_limit(compressed_bytes: u64) -> u64 {
    ALWAYS_ALLOWED_RECORDS + compressed_bytes / MIN_BYTES_PER_RECORD
}

/// Remaining bytes to unpack and records to read of a file.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    bytes: u64,
    records: u64,
}

/// Error: the budget is exhausted.
#[derive(Clone, Copy, Debug)]
pub struct Exhausted;

impl fmt::Display for Exhausted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the file unpacks to too many bytes or records for its size; the rest is not read")
    }
}

impl Budget {
    pub fn of_file(file_bytes: u64) -> Self {
        Self {
            bytes: file_bytes.saturating_mul(MAX_FILE_RATIO).saturating_add(ALWAYS_ALLOWED_FILE_BYTES),
            records: file_bytes / MIN_BYTES_PER_RECORD + ALWAYS_ALLOWED_FILE_RECORDS,
        }
    }

    /// Adds the allowance for the growth of a file.
    pub fn grow(&mut self, from_bytes: u64, to_bytes: u64) {
        let more = to_bytes.saturating_sub(from_bytes);
        self.bytes = self.bytes.saturating_add(more.saturating_mul(MAX_FILE_RATIO));
        self.records = self.records.saturating_add(more / MIN_BYTES_PER_RECORD);
    }

    /// Subtracts the cost of a chunk.
    pub fn spend(&mut self, bytes: u64, records: u64) -> Result<(), Exhausted> {
        let left = self.bytes.checked_sub(bytes).zip(self.records.checked_sub(records + RECORDS_PER_CHUNK));
        (self.bytes, self.records) = left.ok_or(Exhausted)?;
        Ok(())
    }
}

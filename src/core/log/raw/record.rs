//! MCAP records that messages need, with a check on every length.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::limits::MAX_DECLARED_BYTES;
use super::message::{Channel, RawMessage, Schema};

/// Magic bytes at both ends of the file.
pub const MAGIC: &[u8] = mcap::MAGIC;
/// Length of opcode and record length before each record.
pub const PREFIX_BYTES: usize = 9;
pub const FOOTER_BYTES: u64 = 20;
pub const DATA_END_BYTES: u64 = 4;

/// Maximum length of a chunk head: prefix, times, sizes, checksum and a compression name of four letters.
pub const CHUNK_HEAD_BYTES: usize = PREFIX_BYTES + 44;

/// Memory of a schema or channel in addition to its texts, bytes.
const DECLARATION_BYTES: usize = 1024;

/// Opcode and length of a record.
#[derive(Clone, Copy, Debug)]
pub struct Prefix {
    pub opcode: u8,
    pub len: u64,
}

impl Prefix {
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let mut fields = Fields(bytes);
        Some(Self { opcode: fields.u8()?, len: fields.u64()? })
    }
}

/// Little-endian fields, read one after the other; `None` at the end of the bytes.
pub struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*taken)
    }

    pub fn u8(&mut self) -> Option<u8> {
        self.array::<1>().map(|[byte]| byte)
    }

    pub fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Reads the bytes after a length of four bytes.
    fn blob(&mut self) -> Option<&'a [u8]> {
        let len = self.u32()?;
        self.take(usize::try_from(len).ok()?)
    }

    pub fn text(&mut self) -> Option<String> {
        self.blob().and_then(|bytes| std::str::from_utf8(bytes).ok()).map(str::to_owned)
    }

    /// Reads pairs of texts after a length of four bytes.
    pub fn pairs(&mut self) -> Option<BTreeMap<String, String>> {
        let mut fields = Fields(self.blob()?);
        let mut pairs = BTreeMap::new();
        while !fields.0.is_empty() {
            pairs.insert(fields.text()?, fields.text()?);
        }
        Some(pairs)
    }
}

/// Head of a chunk record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkHead {
    pub record_len: u64,
    /// Log time of the earliest message, as the head states it; 0 without messages.
    pub start_nanos: u64,
    pub checksum: u32,
    pub uncompressed_bytes: u64,
    /// Name of the compression: "zstd", "lz4" or "".
    pub compression: &'static str,
    pub compressed_bytes: u64,
    /// Length from the record's opcode to the compressed bytes.
    pub head_bytes: usize,
}

impl ChunkHead {
    /// Parses bytes from the chunk's opcode on; `None` unless they hold the whole head of a chunk of a known
    /// compression.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        Self::parse_body(bytes).filter(|_| bytes[0] == mcap::records::op::CHUNK)
    }

    /// Parses a chunk head with any opcode.
    pub fn parse_body(bytes: &[u8]) -> Option<Self> {
        let prefix = Prefix::parse(bytes)?;
        let mut fields = Fields(&bytes[PREFIX_BYTES..]);
        let (start_nanos, _end_nanos) = (fields.u64()?, fields.u64()?);
        let (uncompressed_bytes, checksum) = (fields.u64()?, fields.u32()?);
        let compression = match fields.blob()? {
            b"" => "",
            b"zstd" => "zstd",
            b"lz4" => "lz4",
            _ => return None,
        };
        let compressed_bytes = fields.u64()?;
        let head_bytes = bytes.len() - fields.0.len();
        let record_len = prefix.len;
        Some(Self { record_len, start_nanos, checksum, uncompressed_bytes, compression, compressed_bytes, head_bytes })
    }

    /// Returns true if the record's two lengths agree and the record fits into the `available` bytes from its opcode
    /// on. Random bytes pass with probability 2^-64.
    pub fn is_consistent(&self, available: u64) -> bool {
        let body = (self.head_bytes - PREFIX_BYTES) as u64;
        self.compressed_bytes.checked_add(body) == Some(self.record_len)
            && self.record_len <= available.saturating_sub(PREFIX_BYTES as u64)
    }
}

/// Returns true if the first bytes of a message index are consistent with its length.
pub fn is_message_index(body: &[u8], len: u64) -> bool {
    let mut fields = Fields(body);
    let _channel = fields.u16();
    fields.u32().is_some_and(|array_bytes| u64::from(array_bytes) + 6 == len && array_bytes % 16 == 0)
}

/// Returns the log time of a message record's fields; `None` if they are too few.
pub fn log_time_nanos(body: &[u8]) -> Option<u64> {
    let mut fields = Fields(body);
    let _channel_and_sequence = (fields.u16()?, fields.u32()?);
    fields.u64()
}

/// Schemas and channels read so far.
#[derive(Debug, Default)]
pub struct Tables {
    schemas: BTreeMap<u16, Rc<Schema>>,
    channels: BTreeMap<u16, Channel>,
    /// Bytes of all declarations, without repetitions.
    declared_bytes: usize,
}

impl Tables {
    /// Keeps a schema record; `None` if it is malformed.
    pub fn add_schema(&mut self, body: &[u8]) -> Option<()> {
        let mut fields = Fields(body);
        let id = fields.u16()?;
        let schema = Schema { name: fields.text()?, encoding: fields.text()?, data: fields.blob()?.to_vec() };
        if self.schemas.get(&id).is_none_or(|known| **known != schema) {
            self.declare(body)?;
            self.schemas.insert(id, Rc::new(schema));
        }
        Some(())
    }

    /// Keeps a channel record; `None` if it is malformed.
    pub fn add_channel(&mut self, body: &[u8]) -> Option<()> {
        let mut fields = Fields(body);
        let id = fields.u16()?;
        let schema = self.schemas.get(&fields.u16()?).cloned();
        let topic = fields.text()?;
        let message_encoding = fields.text()?;
        let channel = Channel { topic, message_encoding, metadata: fields.pairs()?, schema };
        if self.channels.get(&id) != Some(&channel) {
            self.declare(body)?;
            self.channels.insert(id, channel);
        }
        Some(())
    }

    /// Counts a declaration; `None` once a file has declared too much.
    fn declare(&mut self, body: &[u8]) -> Option<()> {
        self.declared_bytes += DECLARATION_BYTES + body.len();
        (self.declared_bytes <= MAX_DECLARED_BYTES).then_some(())
    }

    /// Returns the message of a record in a part of a file; `None` if it is malformed or its channel is unknown.
    pub fn message<'a>(&'a self, body: &'a [u8], part: u64) -> Option<RawMessage<'a>> {
        let mut fields = Fields(body);
        let channel = self.channels.get(&fields.u16()?)?;
        let sequence = fields.u32()?;
        let (log_time_nanos, publish_time_nanos) = (fields.u64()?, fields.u64()?);
        Some(RawMessage { channel, log_time_nanos, publish_time_nanos, sequence, part, data: fields.0 })
    }
}

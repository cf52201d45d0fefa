//! Pass through a file, record by record. After damage it continues at the next chunk.

use std::io::{self, Read, Seek};

use mcap::records::op;

use super::chunk;
use super::completeness::{Completeness, RawSummary};
use super::contents::{FileContents, MAX_HEAD_BYTES};
use super::file_type;
use super::message::RawMessage;
use super::record::{
    CHUNK_HEAD_BYTES, ChunkHead, DATA_END_BYTES, FOOTER_BYTES, Fields, MAGIC, PREFIX_BYTES, Prefix, Tables,
    is_message_index,
};
use super::window::Window;

/// Bytes searched at once for the next chunk.
const SEARCH_BYTES: u64 = 1 << 18;
/// Longest summary or cut chunk that is read; nothing else bounds the memory for it.
const MAX_UNCHECKED_BYTES: u64 = 1 << 28;
/// Prefix and fields of the last record, and the magic after it.
const TAIL_BYTES: u64 = PREFIX_BYTES as u64 + FOOTER_BYTES + MAGIC.len() as u64;

/// Why nothing of a file can be read.
#[derive(Debug)]
pub enum ScanError {
    Read(io::Error),
    Empty,
    NotMcap { found: String },
}

impl From<io::Error> for ScanError {
    fn from(error: io::Error) -> Self {
        Self::Read(error)
    }
}

/// Place where the pass continues after a record.
enum Next {
    At(u64),
    /// Nothing more can be read.
    End,
}

#[derive(Default)]
struct Damage {
    /// Of the first damage.
    reason: Option<String>,
    chunks: u64,
    bytes: u64,
}

impl Damage {
    fn note(&mut self, at: u64, what: &str) {
        self.reason.get_or_insert_with(|| format!("at byte {at}: {what}"));
    }
}

struct Scan<R, F> {
    window: Window<R>,
    visit: F,
    tables: Tables,
    damage: Damage,
    cut: Option<String>,
    readable: u64,
    /// Messages that the file's own summary counts.
    counted: Option<u64>,
    ends_with_magic: bool,
    has_chunks: bool,
    is_past_data: bool,
    contents: FileContents,
    /// Whether chunks are only counted.
    skips_chunks: bool,
    /// End of the last chunk, or of the opening magic: surely the beginning of a record.
    verified_end: u64,
}

/// Passes every readable message of `source` to `visit`.
pub fn scan<R: Read + Seek>(source: R, visit: impl FnMut(&RawMessage<'_>)) -> Result<RawSummary, ScanError> {
    let mut scan = begin(source, visit)?;
    scan.read_summary()?;
    scan.walk()?;
    let contents = std::mem::take(&mut scan.contents);
    Ok(RawSummary { readable_messages: scan.readable, completeness: scan.completeness(), contents })
}

/// Contents of `source` other than messages; its chunks are not read.
pub fn scan_contents<R: Read + Seek>(source: R) -> Result<FileContents, ScanError> {
    let mut scan = begin(source, |_| {})?;
    scan.skips_chunks = true;
    scan.walk()?;
    Ok(scan.contents)
}

fn begin<R: Read + Seek, F: FnMut(&RawMessage<'_>)>(source: R, visit: F) -> Result<Scan<R, F>, ScanError> {
    let mut window = Window::new(source)?;
    let bytes = window.len();
    let start = window.bytes(0, bytes.min(file_type::START_BYTES as u64) as usize)?;
    if start.is_empty() {
        return Err(ScanError::Empty);
    }
    if !start.starts_with(MAGIC) {
        return Err(ScanError::NotMcap { found: file_type::describe(start) });
    }
    Ok(Scan {
        window,
        visit,
        tables: Tables::default(),
        damage: Damage::default(),
        cut: None,
        readable: 0,
        counted: None,
        ends_with_magic: false,
        has_chunks: false,
        is_past_data: false,
        contents: FileContents { bytes, ..FileContents::default() },
        skips_chunks: false,
        verified_end: MAGIC.len() as u64,
    })
}

impl<R: Read + Seek, F: FnMut(&RawMessage<'_>)> Scan<R, F> {
    /// Reads channels and the count of messages from the end of a finished file. Thus a damaged chunk that declared
    /// channels does not make the messages of other chunks unreadable.
    fn read_summary(&mut self) -> io::Result<()> {
        let len = self.window.len();
        if len < MAGIC.len() as u64 + TAIL_BYTES {
            return Ok(());
        }
        let tail = self.window.bytes(len - TAIL_BYTES, TAIL_BYTES as usize)?;
        self.ends_with_magic = tail.ends_with(MAGIC);
        let is_footer =
            Prefix::parse(tail).is_some_and(|prefix| prefix.opcode == op::FOOTER && prefix.len == FOOTER_BYTES);
        if !self.ends_with_magic || !is_footer {
            return Ok(());
        }
        let summary_start = Fields(&tail[PREFIX_BYTES..]).u64().unwrap_or(0);
        if summary_start == 0 {
            return Ok(()); // A writer may omit the summary.
        }
        let end = len - MAGIC.len() as u64;
        let start = summary_start.checked_sub(PREFIX_BYTES as u64 + DATA_END_BYTES);
        let Some(start) = start.filter(|&start| start < end) else {
            self.damage.note(len - TAIL_BYTES, "the footer points outside the file");
            return Ok(());
        };
        if end - start > MAX_UNCHECKED_BYTES {
            self.damage.note(summary_start, "the summary is too long");
            return Ok(());
        }
        let bytes = self.window.bytes(start, usize::try_from(end - start).unwrap_or(usize::MAX))?;
        match chunk::verified_summary(bytes) {
            Ok(records) => self.take_summary(&records),
            Err(error) => self.damage.note(summary_start, &format!("the summary cannot be used: {error}")),
        }
        Ok(())
    }

    fn take_summary(&mut self, records: &[(u8, Vec<u8>)]) {
        for (opcode, body) in records {
            match *opcode {
                op::SCHEMA => _ = self.tables.add_schema(body),
                op::CHANNEL => _ = self.tables.add_channel(body),
                op::STATISTICS => self.counted = Fields(body).u64(),
                _ => {}
            }
        }
    }

    fn walk(&mut self) -> io::Result<()> {
        let mut at = MAGIC.len() as u64;
        while let Next::At(next) = self.record(at)? {
            at = next;
        }
        Ok(())
    }

    fn record(&mut self, at: u64) -> io::Result<Next> {
        let left = self.window.len() - at;
        if left < PREFIX_BYTES as u64 {
            let what = if left == 0 { "the file ends without a footer" } else { "the file ends within a record" };
            return self.broken(at, None, what);
        }
        let Some(prefix) = Prefix::parse(self.window.bytes(at, PREFIX_BYTES)?) else {
            return self.broken(at, None, "the file ends within a record");
        };
        let opcode = Some(prefix.opcode);
        let body_left = left - PREFIX_BYTES as u64;
        if prefix.opcode == 0 {
            return self.broken(at, opcode, "no record begins with 00");
        }
        if prefix.len > body_left {
            return self.broken(at, opcode, &format!("a record of {} bytes has {body_left}", prefix.len));
        }
        match prefix.opcode {
            op::CHUNK => return self.chunk(at, left),
            op::FOOTER => return self.footer(at, prefix),
            _ => {}
        }
        if let Some(what) = self.contradiction(at, prefix)? {
            return self.broken(at, opcode, what);
        }
        match prefix.opcode {
            op::DATA_END => self.is_past_data = true,
            op::SCHEMA | op::CHANNEL | op::MESSAGE if !self.skips_chunks => self.unchunked(at, prefix)?,
            op::HEADER | op::ATTACHMENT | op::METADATA => {
                let (at, len) = (at + PREFIX_BYTES as u64, prefix.len);
                let body = self.window.bytes(at, len.min(MAX_HEAD_BYTES) as usize)?;
                // Malformed ones are skipped: belief never reads them.
                let _ = self.contents.take(prefix.opcode, body, (at, len));
            }
            _ => {}
        }
        Ok(Next::At(at + PREFIX_BYTES as u64 + prefix.len))
    }

    /// Why a record contradicts its opcode. An opcode has no checksum; a changed one must neither hide a record nor
    /// turn another record into a message.
    fn contradiction(&mut self, at: u64, prefix: Prefix) -> io::Result<Option<&'static str>> {
        let left = self.window.len() - at;
        let start = self.window.bytes(at, left.min(CHUNK_HEAD_BYTES as u64) as usize)?;
        if ChunkHead::parse_body(start).is_some_and(|head| head.is_consistent(left)) {
            return Ok(Some("a chunk has another opcode"));
        }
        let is_index = is_message_index(&start[PREFIX_BYTES..], prefix.len);
        let is_first = at == MAGIC.len() as u64;
        Ok(match prefix.opcode {
            opcode if is_first && opcode != op::HEADER => Some("the first record is no header"),
            op::DATA_END if prefix.len != DATA_END_BYTES => Some("the data end has a wrong length"),
            op::MESSAGE_INDEX if !is_index => Some("a message index has a wrong length"),
            op::MESSAGE if self.is_past_data => Some("a message lies after the end of the data"),
            op::MESSAGE if self.has_chunks && is_index => Some("a message index has another opcode"),
            _ => None,
        })
    }

    fn unchunked(&mut self, at: u64, prefix: Prefix) -> io::Result<()> {
        let body = self.window.bytes(at + PREFIX_BYTES as u64, prefix.len as usize)?;
        if deliver(&mut self.tables, &mut self.visit, &mut self.readable, prefix.opcode, body).is_none() {
            self.damage.note(at, "a record cannot be used");
            self.damage.bytes += PREFIX_BYTES as u64 + prefix.len;
        }
        Ok(())
    }

    fn footer(&mut self, at: u64, prefix: Prefix) -> io::Result<Next> {
        let left = self.window.len() - at;
        if prefix.len != FOOTER_BYTES || left > TAIL_BYTES {
            return self.broken(at, Some(prefix.opcode), "a footer is not at the end");
        }
        if left < TAIL_BYTES {
            return self.broken(at, Some(prefix.opcode), "the file ends within the closing bytes");
        }
        if !self.ends_with_magic {
            self.damage.note(at, "the closing bytes after the footer are wrong");
        }
        Ok(Next::End)
    }

    fn chunk(&mut self, at: u64, left: u64) -> io::Result<Next> {
        let head = ChunkHead::parse(self.window.bytes(at, left.min(CHUNK_HEAD_BYTES as u64) as usize)?);
        let Some(head) = head.filter(|head| head.is_consistent(left)) else {
            return self.broken(at, Some(op::CHUNK), "the head of a chunk contradicts itself");
        };
        let record_bytes = PREFIX_BYTES as u64 + head.record_len;
        self.has_chunks = true;
        self.verified_end = at + record_bytes;
        if self.skips_chunks {
            return Ok(Next::At(at + record_bytes));
        }
        let bytes = self.window.bytes(at, usize::try_from(record_bytes).unwrap_or(usize::MAX))?;
        let (tables, visit, readable) = (&mut self.tables, &mut self.visit, &mut self.readable);
        let mut unusable = 0_u64;
        let read = chunk::for_each_record(bytes, &head, |opcode, body| {
            if deliver(tables, visit, readable, opcode, body).is_none() {
                unusable += 1;
            }
        });
        if let Err(error) = read {
            self.damage.note(at, &format!("a chunk cannot be read: {error}"));
            self.damage.chunks += 1;
            self.damage.bytes += record_bytes;
            return Ok(Next::At(at + record_bytes));
        }
        self.contents.add_chunk(&head);
        if unusable > 0 {
            self.damage
                .note(at, &format!("{unusable} records of a chunk cannot be used, their topic's declaration is lost"));
        }
        Ok(Next::At(at + record_bytes))
    }

    /// Continues at the next chunk after an impossible record; without one, the pass ends.
    fn broken(&mut self, at: u64, opcode: Option<u8>, what: &str) -> io::Result<Next> {
        let is_chunk = opcode == Some(op::CHUNK);
        // Not from `at`: a wrong length before it may have skipped chunks. A broken chunk is no candidate.
        if let Some(next) = self.find_chunk(self.verified_end)? {
            self.damage.note(at, what);
            self.damage.chunks += u64::from(is_chunk);
            self.damage.bytes += next - self.verified_end;
            return Ok(Next::At(next));
        }
        if self.ends_with_magic {
            self.damage.note(at, what);
            self.damage.chunks += u64::from(is_chunk);
            self.damage.bytes += self.window.len() - at;
            return Ok(Next::End);
        }
        self.cut = Some(format!("at byte {at} of {}: {what}", self.window.len()));
        if is_chunk {
            self.salvage(at)?;
        }
        Ok(Next::End)
    }

    /// Reads the messages at the beginning of a cut chunk.
    fn salvage(&mut self, at: u64) -> io::Result<()> {
        if self.skips_chunks {
            return Ok(());
        }
        let left = (self.window.len() - at).min(MAX_UNCHECKED_BYTES) as usize;
        let bytes = self.window.bytes(at, left)?;
        let Some(head) = ChunkHead::parse(&bytes[..left.min(CHUNK_HEAD_BYTES)]) else {
            return Ok(());
        };
        let (tables, visit, readable) = (&mut self.tables, &mut self.visit, &mut self.readable);
        chunk::for_each_record_of_cut(bytes, &head, |opcode, body| {
            let _ = deliver(tables, visit, readable, opcode, body);
        });
        Ok(())
    }

    /// The first place at or after `from` where a whole chunk may begin.
    fn find_chunk(&mut self, from: u64) -> io::Result<Option<u64>> {
        let overlap = CHUNK_HEAD_BYTES as u64 - 1;
        let mut at = from;
        while at < self.window.len() {
            let left = self.window.len() - at;
            let bytes = self.window.bytes(at, left.min(SEARCH_BYTES + overlap) as usize)?;
            let found = (0..bytes.len().min(SEARCH_BYTES as usize)).find(|&offset| {
                let bytes = &bytes[offset..];
                bytes[0] == op::CHUNK
                    && ChunkHead::parse(&bytes[..bytes.len().min(CHUNK_HEAD_BYTES)])
                        .is_some_and(|head| head.is_consistent(left - offset as u64))
            });
            if let Some(offset) = found {
                return Ok(Some(at + offset as u64));
            }
            at += SEARCH_BYTES;
        }
        Ok(None)
    }

    fn completeness(self) -> Completeness {
        let missing = self.counted.map(|counted| counted.saturating_sub(self.readable));
        let miscounted = missing
            .filter(|&missing| missing > 0)
            .map(|missing| format!("{missing} messages counted in the summary are missing"));
        let readable_messages = self.readable;
        match (self.damage.reason.or(miscounted), self.cut) {
            (Some(reason), cut) => Completeness::Damaged {
                reason: cut.map_or_else(|| reason.clone(), |cut| format!("{reason}; and cut {cut}")),
                lost_chunks: self.damage.chunks,
                lost_bytes: self.damage.bytes,
                lost_messages: missing,
                readable_messages,
            },
            (None, Some(reason)) => Completeness::Cut { reason, readable_messages },
            (None, None) => Completeness::Whole,
        }
    }
}

/// Processes one schema, channel or message record; `None` if it cannot be used. Others are skipped.
fn deliver(
    tables: &mut Tables,
    visit: &mut impl FnMut(&RawMessage<'_>),
    readable: &mut u64,
    opcode: u8,
    body: &[u8],
) -> Option<()> {
    match opcode {
        op::SCHEMA => tables.add_schema(body),
        op::CHANNEL => tables.add_channel(body),
        op::MESSAGE => {
            let message = tables.message(body)?;
            *readable += 1;
            visit(&message);
            Some(())
        }
        _ => Some(()),
    }
}

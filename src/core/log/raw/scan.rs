//! Pass through a file, record by record. After damage the pass continues at the next chunk.

mod chunks;
mod growing;
mod recovery;

pub use growing::{GrowingScan, Growth};

use chunks::Delivery;
use recovery::Damage;

use std::collections::BTreeSet;
use std::io::{self, Read, Seek};

use mcap::records::op;

use super::checksum::DataChecksum;
use super::chunk::{self, Unpacker};
use super::completeness::{Completeness, RawSummary};
use super::contents::{FileContents, MAX_HEAD_BYTES};
use super::file_type;
use super::limits::{Budget, MAX_RECORD_BYTES, MAX_UNCHECKED_BYTES};
use super::message::RawMessage;
use super::order::{ChunkOrder, HeadOrder, SurveyedChunk};
use super::record::{
    CHUNK_HEAD_BYTES, ChunkHead, DATA_END_BYTES, FOOTER_BYTES, Fields, MAGIC, PREFIX_BYTES, Prefix, Tables,
    is_message_index,
};
use super::window::Window;

/// Number of stored bytes of a part of a file.
const PART_BYTES: u64 = 1 << 16;
/// Length of the last record's prefix and fields, and the magic after it.
const TAIL_BYTES: u64 = PREFIX_BYTES as u64 + FOOTER_BYTES + MAGIC.len() as u64;

/// Reason why nothing of a file can be read.
#[derive(Debug)]
pub enum ScanError {
    Read(io::Error),
    Empty,
    NotMcap {
        found: String,
    },
    /// An SQLite file that is not a bag of rosbag2.
    NotBag {
        found: String,
    },
    /// A growing file became shorter than the bytes read of it.
    Truncated {
        bytes: u64,
        read: u64,
    },
    /// The bytes read of a growing file have changed.
    Rewritten,
}

impl From<io::Error> for ScanError {
    fn from(error: io::Error) -> Self {
        Self::Read(error)
    }
}

/// Position at which the pass continues after a record.
enum Next {
    At(u64),
    /// The same position, once the file has grown.
    Later,
    /// End of the pass: nothing more can be read.
    End,
}

/// State of the file's end.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ending {
    /// The file no longer grows: an incomplete record is cut.
    Closed,
    /// The file may grow: an incomplete record is still being written.
    Open,
}

/// Use of chunks in a pass.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ChunkUse {
    /// Only the heads of chunks are read.
    Heads,
    /// Chunks are read for their times and channels.
    Survey,
    /// Messages of chunks are visited.
    Messages,
}

/// State of a pass through a file.
struct Pass {
    chunk_use: ChunkUse,
    damage: Damage,
    cut: Option<String>,
    has_chunks: bool,
    is_past_data: bool,
    contents: FileContents,
    /// End of the last chunk, or of the opening magic: certainly the beginning of a record.
    verified_end: u64,
    checksum: DataChecksum,
    /// True if a chunk has no checksum of its own. mcap 0.26 for Rust omits such chunks from the checksum of all data.
    has_unchecked_chunks: bool,
    heads: HeadOrder,
    surveyed: Vec<SurveyedChunk>,
    budget: Budget,
    /// Number of records of all chunks.
    records: u64,
}

impl Pass {
    fn new(chunk_use: ChunkUse, bytes: u64) -> Self {
        Self {
            chunk_use,
            damage: Damage::default(),
            cut: None,
            has_chunks: false,
            is_past_data: false,
            contents: FileContents { bytes, ..FileContents::default() },
            verified_end: MAGIC.len() as u64,
            checksum: DataChecksum::default(),
            has_unchecked_chunks: false,
            heads: HeadOrder::default(),
            surveyed: Vec::new(),
            budget: Budget::of_file(bytes),
            records: 0,
        }
    }
}

struct Scan<R, F> {
    window: Window<R>,
    visit: F,
    unpacker: Unpacker,
    tables: Tables,
    readable: u64,
    /// Number of messages that the file's own summary counts, and of copies among them.
    counted: Option<u64>,
    copied: u64,
    ends_with_magic: bool,
    /// Parts whose messages are visited; `None`: all.
    parts: Option<BTreeSet<u64>>,
    ending: Ending,
    /// Length of an open file from which on a lost position is searched again.
    search_at_bytes: u64,
    pass: Pass,
}

/// Passes every readable message of `source` to `visit`.
pub fn scan<R: Read + Seek, F: FnMut(&RawMessage<'_>)>(
    source: R,
    visit: F,
) -> Result<(RawSummary, SecondPass<R>), ScanError> {
    let mut scan = begin(source, visit)?;
    scan.walk()?;
    let of_chunks = if scan.pass.heads.is_doubtful { ChunkUse::Survey } else { ChunkUse::Messages };
    scan.pass = Pass::new(of_chunks, scan.window.len());
    scan.read_summary()?;
    scan.walk()?;
    let chunk_order = scan.visit_surveyed()?;
    let summary = RawSummary { chunk_order, ..scan.summary() };
    Ok((summary, SecondPass { of_chunks, scan: scan.with_visit(()) }))
}

/// A file whose messages were visited, for a second visit of some of its parts.
pub struct SecondPass<R> {
    scan: Scan<R, ()>,
    of_chunks: ChunkUse,
}

impl<R: Read + Seek> SecondPass<R> {
    /// Visits the messages of these parts in the same order.
    pub fn visit(self, parts: BTreeSet<u64>, visit: impl FnMut(&RawMessage<'_>)) -> io::Result<()> {
        let mut scan = self.scan.with_visit(visit);
        scan.pass = Pass::new(self.of_chunks, scan.window.len());
        scan.parts = Some(parts);
        scan.walk()?;
        scan.visit_surveyed()?;
        Ok(())
    }
}

/// Returns the contents of `source` other than messages; its chunks are not read.
pub fn scan_contents<R: Read + Seek>(source: R) -> Result<FileContents, ScanError> {
    let mut scan = begin(source, |_| {})?;
    scan.walk()?;
    Ok(scan.pass.contents)
}

fn begin<R: Read + Seek, F: FnMut(&RawMessage<'_>)>(source: R, visit: F) -> Result<Scan<R, F>, ScanError> {
    let mut scan = Scan::new(Window::new(source)?, visit);
    scan.check_start()?;
    Ok(scan)
}

/// Returns the part of a file that a record outside of chunks, or a whole chunk, belongs to.
fn part_of(at: u64) -> u64 {
    at / PART_BYTES
}

impl<R: Read + Seek, F> Scan<R, F> {
    fn new(window: Window<R>, visit: F) -> Self {
        let pass = Pass::new(ChunkUse::Heads, window.len());
        Self {
            window,
            visit,
            unpacker: Unpacker::default(),
            tables: Tables::default(),
            readable: 0,
            counted: None,
            copied: 0,
            ends_with_magic: false,
            parts: None,
            ending: Ending::Closed,
            search_at_bytes: 0,
            pass,
        }
    }

    fn check_start(&mut self) -> Result<(), ScanError> {
        let bytes = self.window.len().min(file_type::START_BYTES as u64);
        match self.window.bytes(0, bytes as usize)? {
            [] => Err(ScanError::Empty),
            start if start.starts_with(MAGIC) => Ok(()),
            start => Err(ScanError::NotMcap { found: file_type::describe(start) }),
        }
    }

    fn summary(&mut self) -> RawSummary {
        RawSummary {
            completeness: self.completeness(),
            readable_messages: self.readable,
            chunk_order: ChunkOrder::default(),
            contents: std::mem::take(&mut self.pass.contents),
        }
    }

    fn with_visit<G>(self, visit: G) -> Scan<R, G> {
        Scan {
            window: self.window,
            visit,
            unpacker: self.unpacker,
            tables: self.tables,
            readable: self.readable,
            counted: self.counted,
            copied: self.copied,
            ends_with_magic: self.ends_with_magic,
            parts: self.parts,
            ending: self.ending,
            search_at_bytes: self.search_at_bytes,
            pass: self.pass,
        }
    }

    fn is_visited(&self, at: u64) -> bool {
        self.parts.as_ref().is_none_or(|parts| parts.contains(&part_of(at)))
    }
}

impl<R: Read + Seek, F: FnMut(&RawMessage<'_>)> Scan<R, F> {
    /// Reads channels and the count of messages from the end of a finished file. So damage of a chunk that declared
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
            self.pass.damage.note(len - TAIL_BYTES, "the footer points outside the file");
            return Ok(());
        };
        if end - start > MAX_UNCHECKED_BYTES {
            self.pass.damage.note(summary_start, "the summary is too long");
            return Ok(());
        }
        let bytes = self.window.bytes(start, usize::try_from(end - start).unwrap_or(usize::MAX))?;
        match chunk::verified_summary(bytes) {
            Ok(records) => self.take_summary(&records),
            Err(error) => self.pass.damage.note(summary_start, &format!("the summary cannot be used: {error}")),
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
        while let Next::At(next) = self.step(at)? {
            at = next;
        }
        Ok(())
    }

    fn step(&mut self, at: u64) -> io::Result<Next> {
        let next = self.record(at)?;
        if let Next::At(next) = next
            && self.pass.chunk_use != ChunkUse::Heads
            && !self.pass.is_past_data
            && self.parts.is_none()
        {
            self.pass.checksum.add_until(&mut self.window, next)?;
        }
        Ok(next)
    }

    fn record(&mut self, at: u64) -> io::Result<Next> {
        if self.ending == Ending::Open && self.is_unfinished(at)? {
            return Ok(Next::Later);
        }
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
            op::DATA_END => self.data_end(at)?,
            op::SCHEMA | op::CHANNEL | op::MESSAGE if self.pass.chunk_use != ChunkUse::Heads => {
                self.unchunked(at, prefix)?;
            }
            op::HEADER | op::ATTACHMENT | op::METADATA => {
                let (at, len) = (at + PREFIX_BYTES as u64, prefix.len);
                let body = self.window.bytes(at, len.min(MAX_HEAD_BYTES) as usize)?;
                // Malformed records are skipped: the estimator never reads them.
                let _ = self.pass.contents.take(prefix.opcode, body, (at, len));
            }
            _ => {}
        }
        Ok(Next::At(at + PREFIX_BYTES as u64 + prefix.len))
    }

    /// Returns the reason why a record contradicts its opcode. An opcode has no checksum; a changed one must neither
    /// hide a record nor turn another record into a message.
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
            op::MESSAGE if self.pass.is_past_data => Some("a message lies after the end of the data"),
            op::MESSAGE if self.pass.has_chunks && is_index => Some("a message index has another opcode"),
            _ => None,
        })
    }

    fn unchunked(&mut self, at: u64, prefix: Prefix) -> io::Result<()> {
        if !self.is_visited(at) {
            return Ok(());
        }
        let is_used = prefix.len <= MAX_RECORD_BYTES && {
            let body = self.window.bytes(at + PREFIX_BYTES as u64, prefix.len as usize)?;
            let mut delivery = Delivery { tables: &mut self.tables, readable: &mut self.readable, part: part_of(at) };
            delivery.record(prefix.opcode, body, &mut self.visit).is_some()
        };
        if !is_used {
            self.pass.damage.note(at, "a record cannot be used");
            self.pass.damage.bytes += PREFIX_BYTES as u64 + prefix.len;
        }
        Ok(())
    }

    /// Handles the end of the data section; its checksum, if it has one, covers all bytes before.
    fn data_end(&mut self, at: u64) -> io::Result<()> {
        let body = self.window.bytes(at + PREFIX_BYTES as u64, DATA_END_BYTES as usize)?;
        let stated = Fields(body).u32().unwrap_or(0);
        let is_checked = stated != 0 && !self.pass.has_unchecked_chunks && self.parts.is_none();
        if self.pass.chunk_use != ChunkUse::Heads && !self.pass.is_past_data && is_checked {
            self.pass.checksum.add_until(&mut self.window, at)?;
            if self.pass.checksum.value() != stated {
                let what = "the checksum of all data is wrong: something before was changed, moved, added or removed";
                self.pass.damage.note(at, what);
            }
        }
        self.pass.is_past_data = true;
        Ok(())
    }

    fn footer(&mut self, at: u64, prefix: Prefix) -> io::Result<Next> {
        if self.ending == Ending::Open {
            // The summary did not exist when the file was opened.
            self.read_summary()?;
        }
        let left = self.window.len() - at;
        if prefix.len != FOOTER_BYTES || left > TAIL_BYTES {
            return self.broken(at, Some(prefix.opcode), "a footer is not at the end");
        }
        if left < TAIL_BYTES {
            return self.broken(at, Some(prefix.opcode), "the file ends within the closing bytes");
        }
        if !self.ends_with_magic {
            self.pass.damage.note(at, "the closing bytes after the footer are wrong");
        }
        Ok(Next::End)
    }
}

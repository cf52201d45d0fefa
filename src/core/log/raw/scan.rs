//! Pass through a file, record by record. After damage it continues at the next chunk.

use std::collections::BTreeSet;
use std::io::{self, Read, Seek};

use mcap::records::op;

use super::checksum::DataChecksum;
use super::chunk::{self, ChunkError, Unpacker};
use super::completeness::{Completeness, RawSummary};
use super::contents::{FileContents, MAX_HEAD_BYTES};
use super::file_type;
use super::limits::{Budget, MAX_RECORD_BYTES, MAX_UNCHECKED_BYTES, unpacked_limit};
use super::message::RawMessage;
use super::order::{ChunkOrder, HeadOrder, SurveyedChunk, in_order};
use super::record::{
    CHUNK_HEAD_BYTES, ChunkHead, DATA_END_BYTES, FOOTER_BYTES, Fields, MAGIC, PREFIX_BYTES, Prefix, Tables,
    is_message_index, log_time_nanos,
};
use super::window::Window;

/// Bytes searched at once for the next chunk: few at first, as it is often near, so that they are in memory already.
const FIRST_SEARCH_BYTES: u64 = 1 << 10;
const SEARCH_BYTES: u64 = 1 << 18;
/// Stored bytes of a part of a file.
const PART_BYTES: u64 = 1 << 16;
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

/// What a pass does with chunks.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ChunkUse {
    /// Their heads are looked at.
    Heads,
    /// They are read for their times and channels.
    Survey,
    /// Their messages are visited.
    Messages,
}

/// What a pass has come to know.
struct Pass {
    chunk_use: ChunkUse,
    damage: Damage,
    cut: Option<String>,
    has_chunks: bool,
    is_past_data: bool,
    contents: FileContents,
    /// End of the last chunk, or of the opening magic: surely the beginning of a record.
    verified_end: u64,
    checksum: DataChecksum,
    /// Whether a chunk has no checksum of its own. mcap 0.26 for Rust leaves such chunks out of that of all data.
    has_unchecked_chunks: bool,
    heads: HeadOrder,
    surveyed: Vec<SurveyedChunk>,
    budget: Budget,
    /// Of all chunks.
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
    /// Messages that the file's own summary counts, and those of them that are copies.
    counted: Option<u64>,
    copied: u64,
    ends_with_magic: bool,
    /// Parts whose messages are visited; `None`: all.
    parts: Option<BTreeSet<u64>>,
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
    let contents = std::mem::take(&mut scan.pass.contents);
    let (readable_messages, completeness) = (scan.readable, scan.completeness());
    let again = SecondPass { of_chunks, scan: scan.with_visit(()) };
    Ok((RawSummary { readable_messages, completeness, chunk_order, contents }, again))
}

/// A file whose messages were visited, to visit those of some of its parts again.
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

/// Contents of `source` other than messages; its chunks are not read.
pub fn scan_contents<R: Read + Seek>(source: R) -> Result<FileContents, ScanError> {
    let mut scan = begin(source, |_| {})?;
    scan.walk()?;
    Ok(scan.pass.contents)
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
        unpacker: Unpacker::default(),
        tables: Tables::default(),
        readable: 0,
        counted: None,
        copied: 0,
        ends_with_magic: false,
        parts: None,
        pass: Pass::new(ChunkUse::Heads, bytes),
    })
}

/// The part of a file that a record outside of chunks belongs to, a chunk whole.
fn part_of(at: u64) -> u64 {
    at / PART_BYTES
}

impl<R, F> Scan<R, F> {
    fn with_visit<G>(self, visit: G) -> Scan<R, G> {
        let Self { window, visit: _, unpacker, tables, readable, counted, copied, ends_with_magic, parts, pass } = self;
        Scan { window, visit, unpacker, tables, readable, counted, copied, ends_with_magic, parts, pass }
    }

    fn is_visited(&self, at: u64) -> bool {
        self.parts.as_ref().is_none_or(|parts| parts.contains(&part_of(at)))
    }
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
        while let Next::At(next) = self.record(at)? {
            at = next;
            if self.pass.chunk_use != ChunkUse::Heads && !self.pass.is_past_data && self.parts.is_none() {
                self.pass.checksum.add_until(&mut self.window, at)?;
            }
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
            op::DATA_END => self.data_end(at)?,
            op::SCHEMA | op::CHANNEL | op::MESSAGE if self.pass.chunk_use != ChunkUse::Heads => {
                self.unchunked(at, prefix)?;
            }
            op::HEADER | op::ATTACHMENT | op::METADATA => {
                let (at, len) = (at + PREFIX_BYTES as u64, prefix.len);
                let body = self.window.bytes(at, len.min(MAX_HEAD_BYTES) as usize)?;
                // Malformed ones are skipped: belief never reads them.
                let _ = self.pass.contents.take(prefix.opcode, body, (at, len));
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

    /// The data section ends here; its checksum, where it has one, covers all bytes before.
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

    fn chunk(&mut self, at: u64, left: u64) -> io::Result<Next> {
        let head = ChunkHead::parse(self.window.bytes(at, left.min(CHUNK_HEAD_BYTES as u64) as usize)?);
        let Some(head) = head.filter(|head| head.is_consistent(left)) else {
            return self.broken(at, Some(op::CHUNK), "the head of a chunk contradicts itself");
        };
        let record_bytes = PREFIX_BYTES as u64 + head.record_len;
        self.pass.has_chunks = true;
        self.pass.has_unchecked_chunks |= head.checksum == 0 && head.uncompressed_bytes > 0;
        self.pass.verified_end = at + record_bytes;
        if self.pass.chunk_use == ChunkUse::Heads {
            self.pass.heads.add(&head);
            return Ok(Next::At(at + record_bytes));
        }
        if head.compressed_bytes > MAX_RECORD_BYTES {
            let what = format!("a chunk of {} bytes; at most {MAX_RECORD_BYTES} are read", head.compressed_bytes);
            self.lose_chunk(at, record_bytes, &what);
            return Ok(Next::At(at + record_bytes));
        }
        let records = self.pass.records;
        // A chunk that states more is not unpacked.
        let is_unpacked = head.uncompressed_bytes <= unpacked_limit(head.compressed_bytes);
        let unpacked = if is_unpacked { head.uncompressed_bytes } else { 0 };
        let read = match self.pass.chunk_use {
            ChunkUse::Survey => self.survey_chunk(at, &head)?,
            _ => self.visit_chunk(at, &head)?,
        };
        match read {
            Ok(()) => self.pass.contents.add_chunk(&head),
            Err(error) => self.lose_chunk(at, record_bytes, &format!("a chunk cannot be read: {error}")),
        }
        if let Err(exhausted) = self.pass.budget.spend(unpacked, self.pass.records - records) {
            self.pass.damage.note(at, &exhausted.to_string());
            self.pass.damage.bytes += left - record_bytes;
            return Ok(Next::End);
        }
        Ok(Next::At(at + record_bytes))
    }

    fn lose_chunk(&mut self, at: u64, record_bytes: u64, what: &str) {
        self.pass.damage.note(at, what);
        self.pass.damage.chunks += 1;
        self.pass.damage.bytes += record_bytes;
    }

    /// Visits the messages of a chunk.
    fn visit_chunk(&mut self, at: u64, head: &ChunkHead) -> io::Result<Result<(), ChunkError>> {
        if !self.is_visited(at) {
            return Ok(Ok(()));
        }
        let bytes = self.window.bytes(at, PREFIX_BYTES + head.record_len as usize)?;
        let visit = &mut self.visit;
        let mut delivery = Delivery { tables: &mut self.tables, readable: &mut self.readable, part: part_of(at) };
        let (records, mut unusable) = (&mut self.pass.records, 0_u64);
        let read = self.unpacker.for_each_record(bytes, head, |opcode, body| {
            *records += 1;
            if delivery.record(opcode, body, visit).is_none() {
                unusable += 1;
            }
        });
        if unusable > 0 {
            let what = format!("{unusable} records of a chunk cannot be used, their topic's declaration is lost");
            self.pass.damage.note(at, &what);
        }
        Ok(read)
    }

    /// Takes the channels of a chunk and the time of its messages.
    fn survey_chunk(&mut self, at: u64, head: &ChunkHead) -> io::Result<Result<(), ChunkError>> {
        let record_bytes = PREFIX_BYTES + head.record_len as usize;
        let bytes = self.window.bytes(at, record_bytes)?;
        let hash = *blake3::hash(bytes).as_bytes();
        let (tables, records) = (&mut self.tables, &mut self.pass.records);
        let mut chunk = SurveyedChunk { at, record_bytes, hash, messages: 0, nanos: None };
        let read = self.unpacker.for_each_record(bytes, head, |opcode, body| {
            *records += 1;
            match opcode {
                op::SCHEMA => _ = tables.add_schema(body),
                op::CHANNEL => _ = tables.add_channel(body),
                op::MESSAGE => {
                    chunk.messages += 1;
                    if let Some(nanos) = log_time_nanos(body) {
                        let (first, last) = chunk.nanos.unwrap_or((nanos, nanos));
                        chunk.nanos = Some((first.min(nanos), last.max(nanos)));
                    }
                }
                _ => {}
            }
        });
        if read.is_ok() {
            self.pass.surveyed.push(chunk);
        }
        Ok(read)
    }

    /// Visits the messages of the surveyed chunks in the order of time.
    fn visit_surveyed(&mut self) -> io::Result<ChunkOrder> {
        let (chunks, order, copied_messages) = in_order(std::mem::take(&mut self.pass.surveyed));
        self.copied = copied_messages;
        for chunk in chunks {
            let bytes = self.window.bytes(chunk.at, chunk.record_bytes)?;
            if let Some(head) = ChunkHead::parse(&bytes[..bytes.len().min(CHUNK_HEAD_BYTES)]) {
                // It was read before.
                let _ = self.visit_chunk(chunk.at, &head)?;
            }
        }
        Ok(order)
    }

    /// Continues at the next chunk after an impossible record; without one, the pass ends.
    fn broken(&mut self, at: u64, opcode: Option<u8>, what: &str) -> io::Result<Next> {
        let is_chunk = opcode == Some(op::CHUNK);
        // Not from `at`: a wrong length before it may have skipped chunks. A broken chunk is no candidate.
        if let Some(next) = self.find_chunk(self.pass.verified_end)? {
            self.pass.damage.note(at, what);
            self.pass.damage.chunks += u64::from(is_chunk);
            self.pass.damage.bytes += next - self.pass.verified_end;
            return Ok(Next::At(next));
        }
        if self.ends_with_magic {
            self.pass.damage.note(at, what);
            self.pass.damage.chunks += u64::from(is_chunk);
            self.pass.damage.bytes += self.window.len() - at;
            return Ok(Next::End);
        }
        self.pass.cut = Some(format!("at byte {at} of {}: {what}", self.window.len()));
        if is_chunk {
            self.salvage(at)?;
        }
        Ok(Next::End)
    }

    /// Reads the messages at the beginning of a cut chunk.
    fn salvage(&mut self, at: u64) -> io::Result<()> {
        if self.pass.chunk_use == ChunkUse::Heads || !self.is_visited(at) {
            return Ok(());
        }
        let left = (self.window.len() - at).min(MAX_UNCHECKED_BYTES) as usize;
        let bytes = self.window.bytes(at, left)?;
        let Some(head) = ChunkHead::parse(&bytes[..left.min(CHUNK_HEAD_BYTES)]) else {
            return Ok(());
        };
        let visit = &mut self.visit;
        let mut delivery = Delivery { tables: &mut self.tables, readable: &mut self.readable, part: part_of(at) };
        chunk::for_each_record_of_cut(bytes, &head, |opcode, body| _ = delivery.record(opcode, body, visit));
        Ok(())
    }

    /// The first place at or after `from` where a whole chunk may begin.
    fn find_chunk(&mut self, from: u64) -> io::Result<Option<u64>> {
        let overlap = CHUNK_HEAD_BYTES as u64 - 1;
        let (mut at, mut step) = (from, FIRST_SEARCH_BYTES);
        while at < self.window.len() {
            let left = self.window.len() - at;
            let bytes = self.window.bytes(at, left.min(step + overlap) as usize)?;
            let found = (0..bytes.len().min(step as usize)).find(|&offset| {
                let bytes = &bytes[offset..];
                bytes[0] == op::CHUNK
                    && ChunkHead::parse(&bytes[..bytes.len().min(CHUNK_HEAD_BYTES)])
                        .is_some_and(|head| head.is_consistent(left - offset as u64))
            });
            if let Some(offset) = found {
                return Ok(Some(at + offset as u64));
            }
            at += step;
            step = (2 * step).min(SEARCH_BYTES);
        }
        Ok(None)
    }

    fn completeness(&mut self) -> Completeness {
        let missing = self.counted.map(|counted| counted.saturating_sub(self.readable + self.copied));
        let miscounted = missing
            .filter(|&missing| missing > 0)
            .map(|missing| format!("{missing} messages counted in the summary are missing"));
        let readable_messages = self.readable;
        let (damage, cut) = (std::mem::take(&mut self.pass.damage), self.pass.cut.take());
        match (damage.reason.or(miscounted), cut) {
            (Some(reason), cut) => Completeness::Damaged {
                reason: cut.map_or_else(|| reason.clone(), |cut| format!("{reason}; and cut {cut}")),
                lost_chunks: damage.chunks,
                lost_bytes: damage.bytes,
                lost_messages: missing,
                readable_messages,
            },
            (None, Some(reason)) => Completeness::Cut { reason, readable_messages },
            (None, None) => Completeness::Whole,
        }
    }
}

/// Where records of one part of a file go to.
struct Delivery<'a> {
    tables: &'a mut Tables,
    readable: &'a mut u64,
    part: u64,
}

impl Delivery<'_> {
    /// Processes one schema, channel or message record; `None` if it cannot be used. Others are skipped.
    fn record(&mut self, opcode: u8, body: &[u8], visit: &mut impl FnMut(&RawMessage<'_>)) -> Option<()> {
        match opcode {
            op::SCHEMA => self.tables.add_schema(body),
            op::CHANNEL => self.tables.add_channel(body),
            op::MESSAGE => {
                let message = self.tables.message(body, self.part)?;
                *self.readable += 1;
                visit(&message);
                Some(())
            }
            _ => Some(()),
        }
    }
}

//! Chunks: their messages, and the order in which they are visited.

use std::io::{self, Read, Seek};

use mcap::records::op;

use super::{CHUNK_HEAD_BYTES, ChunkHead, ChunkUse, MAX_RECORD_BYTES, Next, PREFIX_BYTES, RawMessage, Scan, part_of};
use crate::log::raw::chunk::ChunkError;
use crate::log::raw::limits::unpacked_limit;
use crate::log::raw::order::{ChunkOrder, SurveyedChunk, in_order};
use crate::log::raw::record::{Tables, log_time_nanos};

impl<R: Read + Seek, F: FnMut(&RawMessage<'_>)> Scan<R, F> {
    pub(super) fn chunk(&mut self, at: u64, left: u64) -> io::Result<Next> {
        let head = ChunkHead::parse(self.window.bytes(at, left.min(CHUNK_HEAD_BYTES as u64) as usize)?);
        let Some(head) = head.filter(|head| head.is_consistent(left)) else {
            return self.broken(at, Some(op::CHUNK), "the head of a chunk contradicts itself");
        };
        let record_bytes = PREFIX_BYTES as u64 + head.record_len;
        self.pass.has_chunks = true;
        self.pass.has_unchecked_chunks |= head.checksum == 0 && head.uncompressed_bytes > 0;
        self.pass.verified_end = at + record_bytes;
        self.pass.heads.add(&head);
        if self.pass.chunk_use == ChunkUse::Heads {
            return Ok(Next::At(at + record_bytes));
        }
        if head.compressed_bytes > MAX_RECORD_BYTES {
            let what = format!("a chunk of {} bytes; at most {MAX_RECORD_BYTES} are read", head.compressed_bytes);
            self.lose_chunk(at, record_bytes, &what);
            return Ok(Next::At(at + record_bytes));
        }
        let records = self.pass.records;
        // A chunk that states a larger size is not unpacked.
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
            let what = format!("{unusable} records of a chunk are unusable: the declaration of their topic is lost");
            self.pass.damage.note(at, &what);
        }
        Ok(read)
    }

    /// Records the channels of a chunk and the time of its messages.
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
    pub(super) fn visit_surveyed(&mut self) -> io::Result<ChunkOrder> {
        let (chunks, order, copied_messages) = in_order(std::mem::take(&mut self.pass.surveyed));
        self.copied = copied_messages;
        for chunk in chunks {
            let bytes = self.window.bytes(chunk.at, chunk.record_bytes)?;
            if let Some(head) = ChunkHead::parse(&bytes[..bytes.len().min(CHUNK_HEAD_BYTES)]) {
                // The chunk was read before.
                let _ = self.visit_chunk(chunk.at, &head)?;
            }
        }
        Ok(order)
    }
}

/// Destination of the records of one part of a file.
pub(super) struct Delivery<'a> {
    pub tables: &'a mut Tables,
    pub readable: &'a mut u64,
    pub part: u64,
}

impl Delivery<'_> {
    /// Processes one schema, channel or message record; `None` if it cannot be used. Others are skipped.
    pub fn record(&mut self, opcode: u8, body: &[u8], visit: &mut impl FnMut(&RawMessage<'_>)) -> Option<()> {
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

//! Recovery after damage: the losses, and the position at which the pass continues.

use std::io::{self, Read, Seek};

use mcap::records::op;

use super::chunks::Delivery;
use super::{CHUNK_HEAD_BYTES, ChunkHead, ChunkUse, Completeness, Ending, Next, RawMessage, Scan, part_of};
use crate::log::raw::chunk;
use crate::log::raw::limits::MAX_UNCHECKED_BYTES;

/// Number of bytes searched at once for the next chunk: few at first, because it is often near and then already in
/// memory.
const FIRST_SEARCH_BYTES: u64 = 1 << 10;
const SEARCH_BYTES: u64 = 1 << 18;

#[derive(Default)]
pub(super) struct Damage {
    /// Reason of the first damage.
    pub reason: Option<String>,
    pub chunks: u64,
    pub bytes: u64,
}

impl Damage {
    pub fn note(&mut self, at: u64, what: &str) {
        self.reason.get_or_insert_with(|| format!("at byte {at}: {what}"));
    }
}

impl<R: Read + Seek, F> Scan<R, F> {
    pub(super) fn completeness(&mut self) -> Completeness {
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

impl<R: Read + Seek, F: FnMut(&RawMessage<'_>)> Scan<R, F> {
    pub(super) fn lose_chunk(&mut self, at: u64, record_bytes: u64, what: &str) {
        self.pass.damage.note(at, what);
        self.pass.damage.chunks += 1;
        self.pass.damage.bytes += record_bytes;
    }

    /// Continues at the next chunk after an impossible record; without one, the pass ends.
    pub(super) fn broken(&mut self, at: u64, opcode: Option<u8>, what: &str) -> io::Result<Next> {
        let is_chunk = opcode == Some(op::CHUNK);
        // The search does not start at `at`: a wrong length before it may have skipped chunks. A broken chunk is no
        // candidate.
        if let Some(next) = self.find_next_chunk()? {
            self.pass.damage.note(at, what);
            self.pass.damage.chunks += u64::from(is_chunk);
            self.pass.damage.bytes += next - self.pass.verified_end;
            return Ok(Next::At(next));
        }
        if self.ending == Ending::Open {
            return Ok(Next::Later);
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

    /// Finds the next chunk behind all verified bytes. An open file is searched again when it is a quarter longer, so
    /// that the search does not grow with a recording of hours.
    fn find_next_chunk(&mut self) -> io::Result<Option<u64>> {
        let (from, bytes) = (self.pass.verified_end, self.window.len());
        if self.ending == Ending::Open && bytes < self.search_at_bytes {
            return Ok(None);
        }
        let found = self.find_chunk(from)?;
        if found.is_none() {
            self.search_at_bytes = bytes + (bytes - from) / 4;
        }
        Ok(found)
    }

    /// Returns the first position at or after `from` where a whole chunk may begin.
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
}

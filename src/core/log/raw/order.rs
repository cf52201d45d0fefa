//! Order of a file's chunks: by the log times of their messages, without exact copies.

use std::collections::BTreeSet;

use super::record::ChunkHead;

/// What was put right in the order of a file's chunks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChunkOrder {
    /// Chunks that lie behind one of a later time; they were read in the order of time.
    pub moved: u64,
    /// Chunks that are exact copies of others; they were read once.
    pub copies: u64,
}

/// Whether the heads of the chunks, in the order of the file, leave their order in doubt.
#[derive(Default)]
pub struct HeadOrder {
    latest_nanos: u64,
    /// Checksum and size of the chunks of that time.
    latest: BTreeSet<(u32, u64)>,
    pub is_doubtful: bool,
}

impl HeadOrder {
    pub fn add(&mut self, head: &ChunkHead) {
        if head.start_nanos == 0 {
            return; // No messages.
        }
        self.is_doubtful |= head.start_nanos < self.latest_nanos;
        if head.start_nanos > self.latest_nanos {
            self.latest_nanos = head.start_nanos;
            self.latest.clear();
        }
        self.is_doubtful |= !self.latest.insert((head.checksum, head.compressed_bytes));
    }
}

/// A chunk that can be read.
pub struct SurveyedChunk {
    /// Place of its record in the file.
    pub at: u64,
    pub record_bytes: usize,
    /// Of the whole record.
    pub hash: [u8; 32],
    pub messages: u64,
    /// Log time of the earliest message.
    pub first_nanos: Option<u64>,
}

/// The chunks in the order of time, each once; the number of messages in the copies that are left out.
pub fn in_order(chunks: Vec<SurveyedChunk>) -> (Vec<SurveyedChunk>, ChunkOrder, u64) {
    let (mut order, mut copied_messages) = (ChunkOrder::default(), 0);
    let (mut known, mut latest_nanos, mut nanos) = (BTreeSet::new(), 0, 0);
    let mut kept: Vec<(u64, SurveyedChunk)> = Vec::new();
    for chunk in chunks {
        if !known.insert(chunk.hash) {
            order.copies += 1;
            copied_messages += chunk.messages;
            continue;
        }
        // One without messages stays where it is.
        nanos = chunk.first_nanos.unwrap_or(nanos);
        order.moved += u64::from(nanos < latest_nanos);
        latest_nanos = latest_nanos.max(nanos);
        kept.push((nanos, chunk));
    }
    kept.sort_by_key(|(nanos, _)| *nanos);
    (kept.into_iter().map(|(_, chunk)| chunk).collect(), order, copied_messages)
}

//! Order of a file's chunks: by the log times of their messages, without exact copies.

use std::collections::BTreeSet;

use super::record::ChunkHead;

/// Corrections to the order of a file's chunks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChunkOrder {
    /// Number of chunks behind one of a later time; they were read in the order of time.
    pub moved: u64,
    /// Number of chunks that are exact copies of others; they were read once.
    pub copies: u64,
}

/// Check of the chunk heads, in the order of the file, for chunks out of order or copied.
#[derive(Default)]
pub struct HeadOrder {
    latest_nanos: u64,
    /// Checksum and size of the chunks at the latest time.
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
    /// Position of the chunk's record in the file.
    pub at: u64,
    pub record_bytes: usize,
    /// Hash of the whole record.
    pub hash: [u8; 32],
    pub messages: u64,
    /// Log times of the earliest and the latest message.
    pub nanos: Option<(u64, u64)>,
}

/// Returns the chunks in the order of time, each once, and the number of messages in omitted copies. If sorting does
/// not reduce their overlap, times go backwards within chunks, and the order is kept.
pub fn in_order(chunks: Vec<SurveyedChunk>) -> (Vec<SurveyedChunk>, ChunkOrder, u64) {
    let (mut order, mut copied_messages) = (ChunkOrder::default(), 0);
    let (mut known, mut latest_nanos, mut nanos) = (BTreeSet::new(), 0, (0, 0));
    let mut kept: Vec<((u64, u64), SurveyedChunk)> = Vec::new();
    for chunk in chunks {
        if !known.insert(chunk.hash) {
            order.copies += 1;
            copied_messages += chunk.messages;
            continue;
        }
        // A chunk without messages keeps its position.
        nanos = chunk.nanos.unwrap_or(nanos);
        order.moved += u64::from(nanos.0 < latest_nanos);
        latest_nanos = latest_nanos.max(nanos.0);
        kept.push((nanos, chunk));
    }
    let mut sorted: Vec<(u64, u64)> = kept.iter().map(|(nanos, _)| *nanos).collect();
    sorted.sort_unstable();
    if overlap_nanos(&sorted) < overlap_nanos(kept.iter().map(|(nanos, _)| nanos)) {
        kept.sort_by_key(|(nanos, _)| *nanos);
    } else {
        order.moved = 0;
    }
    (kept.into_iter().map(|(_, chunk)| chunk).collect(), order, copied_messages)
}

/// Returns the total time by which chunks of these times begin before the end of the previous ones.
fn overlap_nanos<'a>(spans: impl IntoIterator<Item = &'a (u64, u64)>) -> u128 {
    let mut end = 0;
    spans
        .into_iter()
        .map(|&(first, last)| {
            let overlap = u128::from(u64::saturating_sub(end, first));
            end = end.max(last);
            overlap
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the numbers of the chunks in the order of reading.
    fn read_as(spans: &[(u64, u64)]) -> (Vec<u64>, u64) {
        let chunk = |(n, span): (usize, &(u64, u64))| SurveyedChunk {
            at: n as u64,
            record_bytes: 0,
            hash: [n as u8; 32],
            messages: 1,
            nanos: Some(*span),
        };
        let (chunks, order, _) = in_order(spans.iter().enumerate().map(chunk).collect());
        (chunks.iter().map(|chunk| chunk.at).collect(), order.moved)
    }

    #[test]
    fn swapped_chunks_are_sorted_and_a_clock_that_steps_back_moves_nothing() {
        assert_eq!(read_as(&[(1, 9), (20, 29), (10, 19), (30, 39)]), (vec![0, 2, 1, 3], 1));
        // Writers on several threads overlap a little.
        assert_eq!(read_as(&[(1, 11), (20, 31), (10, 21), (30, 39)]), (vec![0, 2, 1, 3], 1));
        // One message of the third chunk was stamped too early.
        assert_eq!(read_as(&[(1, 9), (10, 19), (4, 29), (30, 39)]), (vec![0, 1, 2, 3], 0));
    }
}

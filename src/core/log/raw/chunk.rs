//! Chunks and summary, unpacked and verified by mcap's decompressors and checksums.

use mcap::McapResult;
use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::record::ChunkHead;

/// Limit of a chunk's unpacked size, whatever the chunk states.
const MAX_CHUNK_BYTES: u64 = 1 << 30;
/// Unpacked size that every chunk may have: zeros compress to almost nothing.
const ALWAYS_ALLOWED_BYTES: u64 = 1 << 26;
/// Largest compression ratio beyond that; recordings reach 10.
const MAX_RATIO: u64 = 256;
/// The largest record within a cut chunk.
const MAX_CUT_RECORD_BYTES: usize = 1 << 26;

/// Passes the records of a whole chunk to `visit` after its checksum is verified (where it has one). `bytes` is the
/// record from its opcode on, with a consistent `head`.
pub fn for_each_record(bytes: &[u8], head: &ChunkHead, visit: impl FnMut(u8, &[u8])) -> McapResult<()> {
    let limit = head.compressed_bytes.saturating_mul(MAX_RATIO).saturating_add(ALWAYS_ALLOWED_BYTES);
    let limit = limit.min(MAX_CHUNK_BYTES).max(head.compressed_bytes);
    if head.uncompressed_bytes > limit {
        return Err(mcap::McapError::ChunkTooLarge(head.uncompressed_bytes));
    }
    let options = options()
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(usize::try_from(limit).unwrap_or(usize::MAX));
    drive(options, bytes, visit)
}

/// Passes the whole records of a cut chunk to `visit`, unverified. `bytes` runs from the chunk's opcode to the end of
/// the file.
pub fn for_each_record_of_cut(bytes: &[u8], head: &ChunkHead, visit: impl FnMut(u8, &[u8])) {
    let compressed = &bytes[head.head_bytes..];
    // A new head: lengths as found, the unpacked size open, no checksum.
    let mut chunk = vec![op::CHUNK];
    let body_bytes = 40 + head.compression.len() + compressed.len();
    chunk.extend_from_slice(&(body_bytes as u64).to_le_bytes());
    chunk.extend_from_slice(&[0; 16]);
    chunk.extend_from_slice(&(1_u64 << 40).to_le_bytes());
    chunk.extend_from_slice(&[0; 4]);
    chunk.extend_from_slice(&(head.compression.len() as u32).to_le_bytes());
    chunk.extend_from_slice(head.compression.as_bytes());
    chunk.extend_from_slice(&(compressed.len() as u64).to_le_bytes());
    chunk.extend_from_slice(compressed);
    // The error comes from the cut.
    let _ = drive(options().with_record_length_limit(MAX_CUT_RECORD_BYTES), &chunk, visit);
}

/// Records of the summary section, footer included, if its checksum holds. `bytes` runs from the data end record in
/// front of the summary to the end of the footer.
pub fn verified_summary(bytes: &[u8]) -> McapResult<Vec<(u8, Vec<u8>)>> {
    let mut records = Vec::new();
    let options = options().with_validate_summary_section_crc(true).with_record_length_limit(bytes.len());
    drive(options, bytes, |opcode, body| records.push((opcode, body.to_vec())))?;
    Ok(records)
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default().with_skip_start_magic(true).with_skip_end_magic(true)
}

fn drive(options: LinearReaderOptions, mut bytes: &[u8], mut visit: impl FnMut(u8, &[u8])) -> McapResult<()> {
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (next, rest) = bytes.split_at(wanted.min(bytes.len()));
                reader.insert(next.len())[..next.len()].copy_from_slice(next);
                reader.notify_read(next.len());
                bytes = rest;
            }
            LinearReadEvent::Record { opcode, data } => visit(opcode, data),
        }
    }
    Ok(())
}

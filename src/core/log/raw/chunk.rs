//! Chunks and summary, unpacked and verified with mcap's decompressors and checksums.

use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, McapResult};

use super::limits::{MAX_RECORD_BYTES, MAX_UNCHECKED_BYTES, record_limit, unpacked_limit};
use super::record::{ChunkHead, PREFIX_BYTES};

/// Reason why a chunk is not read, or not to its end.
#[derive(Debug, thiserror::Error)]
pub enum ChunkError {
    #[error(transparent)]
    Mcap(#[from] McapError),
    #[error("it unpacks to {bytes} bytes; its size allows {limit}")]
    Bytes { bytes: u64, limit: u64 },
    #[error("it has more than {limit} records")]
    Records { limit: u64 },
    #[error("no record begins with 00")]
    NoRecord,
}

/// Unpacks whole chunks. Its buffers are large and are reused from chunk to chunk.
#[derive(Default)]
pub struct Unpacker {
    /// Reader, positioned at the end of a chunk.
    reader: Option<Box<LinearReader>>,
}

impl Unpacker {
    /// Passes the records of a whole chunk to `visit` after verification of its checksum (if it has one). `bytes` is
    /// the record from its opcode on, with a consistent `head`.
    pub fn for_each_record(
        &mut self,
        bytes: &[u8],
        head: &ChunkHead,
        visit: impl FnMut(u8, &[u8]),
    ) -> Result<(), ChunkError> {
        let limit = unpacked_limit(head.compressed_bytes);
        if head.uncompressed_bytes > limit {
            return Err(ChunkError::Bytes { bytes: head.uncompressed_bytes, limit });
        }
        let options = options().with_prevalidate_chunk_crcs(true).with_record_length_limit(MAX_RECORD_BYTES as usize);
        let mut reader = self.reader.take().unwrap_or_else(|| Box::new(LinearReader::new_with_options(options)));
        let unpacked = drive_chunk(&mut reader, bytes, head, visit)?;
        if unpacked == head.uncompressed_bytes {
            self.reader = Some(reader);
            return Ok(());
        }
        // The chunk ends within a record, or states a wrong size.
        end(&mut reader)
    }
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
    // The cut causes the error.
    let options = options().with_record_length_limit(MAX_UNCHECKED_BYTES as usize);
    let _ = drive_chunk(&mut LinearReader::new_with_options(options), &chunk, head, visit);
}

/// Returns schemas, channels and statistics of the summary section, if its checksum is right. `bytes` runs from the
/// data end record before the summary to the end of the footer.
pub fn verified_summary(bytes: &[u8]) -> McapResult<Vec<(u8, Vec<u8>)>> {
    let mut records = Vec::new();
    let options = options().with_validate_summary_section_crc(true).with_record_length_limit(bytes.len());
    let mut reader = LinearReader::new_with_options(options);
    drive(&mut reader, bytes, |opcode, body| {
        if matches!(opcode, op::SCHEMA | op::CHANNEL | op::STATISTICS) {
            records.push((opcode, body.to_vec()));
        }
        Ok::<(), McapError>(())
    })?;
    end::<McapError>(&mut reader)?;
    Ok(records)
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default().with_skip_start_magic(true).with_skip_end_magic(true)
}

/// Passes records on until one is impossible, or they are too many or too long for the stored bytes. Returns their
/// bytes.
fn drive_chunk(
    reader: &mut LinearReader,
    bytes: &[u8],
    head: &ChunkHead,
    mut visit: impl FnMut(u8, &[u8]),
) -> Result<u64, ChunkError> {
    let compressed_bytes = (bytes.len() - head.head_bytes) as u64;
    let (byte_limit, record_limit) = (unpacked_limit(compressed_bytes), record_limit(compressed_bytes));
    let (mut unpacked, mut records) = (0, 0);
    drive(reader, bytes, |opcode, body| {
        records += 1;
        unpacked += (PREFIX_BYTES + body.len()) as u64;
        match opcode {
            0 => Err(ChunkError::NoRecord),
            _ if records > record_limit => Err(ChunkError::Records { limit: record_limit }),
            _ if unpacked > byte_limit => Err(ChunkError::Bytes { bytes: unpacked, limit: byte_limit }),
            _ => {
                visit(opcode, body);
                Ok(())
            }
        }
    })?;
    Ok(unpacked)
}

/// Passes records on until the reader requests more than `bytes`.
fn drive<E: From<McapError>>(
    reader: &mut LinearReader,
    mut bytes: &[u8],
    mut visit: impl FnMut(u8, &[u8]) -> Result<(), E>,
) -> Result<(), E> {
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(_) if bytes.is_empty() => break,
            LinearReadEvent::ReadRequest(wanted) => {
                let (next, rest) = bytes.split_at(wanted.min(bytes.len()));
                reader.insert(next.len())[..next.len()].copy_from_slice(next);
                reader.notify_read(next.len());
                bytes = rest;
            }
            LinearReadEvent::Record { opcode, data } => visit(opcode, data)?,
        }
    }
    Ok(())
}

/// Checks that nothing is missing, once no more bytes come.
fn end<E: From<McapError>>(reader: &mut LinearReader) -> Result<(), E> {
    while let Some(event) = reader.next_event() {
        if let LinearReadEvent::ReadRequest(_) = event? {
            reader.notify_read(0);
        }
    }
    Ok(())
}

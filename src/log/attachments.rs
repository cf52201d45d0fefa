//! Files attached to a recording. For viewers: belief never reads them.

use std::path::Path;

use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::error::LogError;

/// Attachments are drawings; a larger one is passed over.
const MAX_BYTES: usize = 16 << 20;

/// Name and bytes of every readable attachment, in the order of the file. A cut file gives those before the cut.
///
/// # Errors
/// [`LogError::Read`].
pub fn read_attachments(path: impl AsRef<Path>) -> Result<Vec<(String, Vec<u8>)>, LogError> {
    let path = path.as_ref();
    let read = |source| LogError::Read { path: path.to_owned(), source };
    let bytes = std::fs::read(path).map_err(read)?;
    let mut rest = bytes.as_slice();
    let options = LinearReaderOptions::default().with_skip_end_magic(true).with_emit_chunks(true);
    let mut reader = LinearReader::new_with_options(options.with_record_length_limit(bytes.len()));
    let mut found = Vec::new();
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let n = wanted.min(rest.len());
                reader.insert(n).copy_from_slice(&rest[..n]);
                reader.notify_read(n);
                rest = &rest[n..];
            }
            Ok(LinearReadEvent::Record { data, opcode }) => {
                if let Ok(Record::Attachment { header, data, .. }) = mcap::parse_record(opcode, data)
                    && data.len() <= MAX_BYTES
                {
                    found.push((header.name, data.into_owned()));
                }
            }
            // What follows a damage cannot be found without its lengths; what came before it is good.
            Err(_) => break,
        }
    }
    Ok(found)
}

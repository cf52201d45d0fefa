//! Files attached to a recording. They serve viewers; belief never reads them.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use mcap::records::{Record, op};

use super::error::LogError;
use super::raw::file_contents;

/// Larger attachments are skipped; the URDF and other files of a robot are smaller.
const MAX_BYTES: u64 = 16 << 20;

/// Name and bytes of every attachment that passes its checksum, in the order of the file. A cut file gives those before
/// the cut. Messages are skipped.
///
/// # Errors
/// As [`super::for_each_raw`].
pub fn read_attachments(path: impl AsRef<Path>) -> Result<Vec<(String, Vec<u8>)>, LogError> {
    let path = path.as_ref();
    let read = |source| LogError::Read { path: path.to_owned(), source };
    let contents = file_contents(path)?;
    let mut file = File::open(path).map_err(read)?;
    let mut found = Vec::new();
    for attachment in contents.attachments.iter().filter(|attachment| attachment.bytes <= MAX_BYTES) {
        let (at, len) = attachment.record;
        let mut record = Vec::new();
        file.seek(SeekFrom::Start(at)).map_err(read)?;
        // The head of a valid attachment is small compared with its data.
        Read::by_ref(&mut file).take(len.min(2 * MAX_BYTES)).read_to_end(&mut record).map_err(read)?;
        if let Ok(Record::Attachment { header, data, .. }) = mcap::parse_record(op::ATTACHMENT, &record) {
            found.push((header.name, data.into_owned()));
        }
    }
    Ok(found)
}

//! Files attached to a recording. They serve viewers; the estimator never reads them.

use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use mcap::records::{Record, op};

use super::error::LogError;
use super::raw::file_contents;
use crate::files;

/// Maximum length of an attachment that is read; the URDF and other files of a robot are smaller.
const MAX_BYTES: u64 = 16 << 20;
/// Limits over all attachments that are read.
const MAX_TOTAL_BYTES: u64 = 64 << 20;
const MAX_ATTACHMENTS: usize = 1000;

/// Returns name and bytes of every attachment that passes its checksum, in the order of the file, up to 64 MiB in all.
/// A cut file gives the attachments before the cut. Messages are skipped.
///
/// # Errors
/// The errors of [`super::for_each_raw`].
pub fn read_attachments(path: impl AsRef<Path>) -> Result<Vec<(String, Vec<u8>)>, LogError> {
    let path = path.as_ref();
    let read = |source| LogError::Read { path: path.to_owned(), source };
    let contents = file_contents(path)?;
    let mut file = files::open(path).map_err(read)?;
    let mut found = Vec::new();
    let mut left = MAX_TOTAL_BYTES;
    let mut fits = |bytes: u64| {
        let fits = bytes <= MAX_BYTES.min(left);
        left -= if fits { bytes } else { 0 };
        fits
    };
    for attachment in contents.attachments.iter().take(MAX_ATTACHMENTS).filter(|attachment| fits(attachment.bytes)) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{RecordingHeader, RecordingWriter};

    #[test]
    fn attachments_are_read_up_to_a_total() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.mcap");
        let mut writer = RecordingWriter::create(&path, RecordingHeader::new(Vec::new())).expect("a file");
        let bytes = vec![0; MAX_BYTES as usize + 1];
        for length in [MAX_BYTES as usize, MAX_BYTES as usize + 1, 3, 1 << 24, 1 << 24, 1 << 24, 5] {
            writer.attach("a", "text/plain", &bytes[..length]).expect("attached");
        }
        writer.finish().expect("finished");
        let lengths: Vec<usize> = read_attachments(&path).expect("it reads").iter().map(|(_, b)| b.len()).collect();
        assert_eq!(lengths, [1 << 24, 3, 1 << 24, 1 << 24, 5], "the fourth of 16 MiB is too much");
    }
}

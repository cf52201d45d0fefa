//! Reads the messages or the other contents of a file.

use std::fs::{File, Metadata};
use std::path::Path;

use super::completeness::RawSummary;
use super::contents::FileContents;
use super::message::RawMessage;
use super::scan::{GrowingScan, ScanError, SecondPass, scan, scan_contents};
use crate::files;
use crate::log::error::LogError;

/// Hands every readable message of an MCAP file to `visit`, in the order of the file.
///
/// A chunk's messages are visited once its checksum has been verified. From a cut last chunk, the messages before the
/// cut are visited unverified.
///
/// # Errors
/// [`LogError::Read`], [`LogError::Empty`], [`LogError::NotMcap`]. Damage and cuts are no errors, see
/// [`super::Completeness`].
pub fn for_each_raw(path: impl AsRef<Path>, visit: impl FnMut(&RawMessage<'_>)) -> Result<RawSummary, LogError> {
    for_each_raw_twice(path.as_ref(), visit).map(|(summary, _)| summary)
}

/// [`for_each_raw`], and what visits the messages of some parts again.
pub fn for_each_raw_twice(
    path: &Path,
    visit: impl FnMut(&RawMessage<'_>),
) -> Result<(RawSummary, SecondPass<File>), LogError> {
    scan(open(path)?, visit).map_err(|error| of_scan(path, error))
}

/// Contents of a file other than messages. Its messages are skipped: damage within chunks is not noticed, and large
/// files are read quickly.
///
/// # Errors
/// As [`for_each_raw`].
pub fn file_contents(path: impl AsRef<Path>) -> Result<FileContents, LogError> {
    let path = path.as_ref();
    scan_contents(open(path)?).map_err(|error| of_scan(path, error))
}

/// The start of reading a file that another program may still be writing.
pub fn begin_growing(path: &Path) -> Result<(GrowingScan<File>, Option<FileIdentity>), LogError> {
    let file = open(path)?;
    let read_error = |source| LogError::Read { path: path.to_owned(), source };
    let identity = file.metadata().map(|metadata| identity(&metadata)).map_err(read_error)?;
    Ok((GrowingScan::new(file).map_err(read_error)?, identity))
}

/// Device and number of a file, which stay when it is renamed.
pub type FileIdentity = (u64, u64);

/// What tells a file from another one in its place, where the system has that.
#[cfg(unix)]
pub fn identity(metadata: &Metadata) -> Option<FileIdentity> {
    use std::os::unix::fs::MetadataExt;
    Some((metadata.dev(), metadata.ino()))
}

/// What tells a file from another one in its place, where the system has that.
#[cfg(not(unix))]
pub fn identity(_: &Metadata) -> Option<FileIdentity> {
    None
}

fn open(path: &Path) -> Result<File, LogError> {
    let found = if path.is_dir() { Err(std::io::Error::other(describe_folder(path))) } else { files::open(path) };
    found.map_err(|source| LogError::Read { path: path.to_owned(), source })
}

/// Names the recordings in a folder, which may be that of a run or of a ROS 2 bag.
fn describe_folder(path: &Path) -> String {
    let names = std::fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let mut names: Vec<String> = names.filter_map(|name| name.into_string().ok()).collect();
    names.retain(|name| name.ends_with(".mcap") || name.ends_with(".mcap.partial"));
    names.sort();
    match names.len() {
        0 => "it is a folder without any .mcap file".to_owned(),
        n if n <= 8 => format!("it is a folder; name one of its files: {}", names.join(", ")),
        n => format!("it is a folder; name one of its {n} .mcap files"),
    }
}

pub fn of_scan(path: &Path, error: ScanError) -> LogError {
    match error {
        ScanError::Read(source) => LogError::Read { path: path.to_owned(), source },
        ScanError::Empty => LogError::Empty { path: path.to_owned() },
        ScanError::Truncated { bytes, read } => LogError::Truncated { path: path.to_owned(), bytes, read },
        ScanError::Rewritten => LogError::Replaced { path: path.to_owned() },
        ScanError::NotMcap { found } => LogError::NotMcap { path: path.to_owned(), found },
    }
}

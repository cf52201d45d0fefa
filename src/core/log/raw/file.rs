//! Reader of the messages or the other contents of a file.

use std::collections::BTreeSet;
use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;

use super::bag::{BagFiles, SecondBagPass, bag_contents, scan_bag};
use super::completeness::RawSummary;
use super::contents::FileContents;
use super::file_type::SQLITE;
use super::message::RawMessage;
use super::scan::{GrowingScan, ScanError, SecondPass, scan, scan_contents};
use crate::files;
use crate::log::error::LogError;

/// First bytes of a journal whose transaction is unfinished.
const JOURNAL_MAGIC: [u8; 8] = [0xd9, 0xd5, 0x05, 0xf9, 0x20, 0xa1, 0x63, 0xd7];

/// Passes every readable message of an MCAP file or a ROS 2 bag (`.db3`) to `visit`, in the order of the file.
///
/// A chunk's messages are visited once its checksum has been verified. From a cut last chunk, the messages before the
/// cut are visited unverified.
///
/// # Errors
/// [`LogError::Read`], [`LogError::Empty`], [`LogError::NotMcap`], [`LogError::NotBag`]. Damage and cuts are no errors,
/// see [`super::Completeness`].
pub fn for_each_raw(path: impl AsRef<Path>, visit: impl FnMut(&RawMessage<'_>)) -> Result<RawSummary, LogError> {
    for_each_raw_twice(path.as_ref(), visit).map(|(summary, _)| summary)
}

/// A file whose messages were visited, for a second visit of some of its parts.
pub enum SecondLook {
    Mcap(Box<SecondPass<File>>),
    Bag(Box<SecondBagPass<File>>),
}

impl SecondLook {
    /// Visits the messages of these parts in the same order.
    pub fn visit(self, parts: BTreeSet<u64>, visit: impl FnMut(&RawMessage<'_>)) -> io::Result<()> {
        match self {
            Self::Mcap(pass) => pass.visit(parts, visit),
            Self::Bag(pass) => pass.visit(&parts, visit),
        }
    }
}

/// Does the same as [`for_each_raw`], and returns the means to visit some parts again.
pub fn for_each_raw_twice(
    path: &Path,
    visit: impl FnMut(&RawMessage<'_>),
) -> Result<(RawSummary, SecondLook), LogError> {
    let found = match open_any(path)? {
        Opened::Mcap(file) => scan(file, visit).map(|(summary, again)| (summary, SecondLook::Mcap(Box::new(again)))),
        Opened::Bag(files) => {
            scan_bag(files, visit).map(|(summary, again)| (summary, SecondLook::Bag(Box::new(again))))
        }
    };
    found.map_err(|error| of_scan(path, error))
}

/// Returns the contents of a file other than messages. Its messages are skipped: damage within chunks is not noticed,
/// and large files are read quickly.
///
/// # Errors
/// The errors of [`for_each_raw`].
pub fn file_contents(path: impl AsRef<Path>) -> Result<FileContents, LogError> {
    let path = path.as_ref();
    let found = match open_any(path)? {
        Opened::Mcap(file) => scan_contents(file),
        Opened::Bag(files) => bag_contents(files),
    };
    found.map_err(|error| of_scan(path, error))
}

/// An opened file, by its first bytes.
enum Opened {
    /// An MCAP file, or anything except a bag.
    Mcap(File),
    Bag(BagFiles<File>),
}

fn open_any(path: &Path) -> Result<Opened, LogError> {
    let mut file = open(path)?;
    let read_error = |source| LogError::Read { path: path.to_owned(), source };
    let mut start = Vec::new();
    file.by_ref().take(SQLITE.len() as u64).read_to_end(&mut start).map_err(read_error)?;
    if start != SQLITE {
        return Ok(Opened::Mcap(file));
    }
    let beside = |ending: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(ending);
        match files::open(Path::new(&name)) {
            Ok(file) => Ok(Some(file)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(LogError::Read { path: name.into(), source }),
        }
    };
    let mut journal = Vec::new();
    if let Some(file) = beside("-journal")? {
        file.take(JOURNAL_MAGIC.len() as u64).read_to_end(&mut journal).map_err(read_error)?;
    }
    let is_in_transaction = journal == JOURNAL_MAGIC;
    Ok(Opened::Bag(BagFiles { bag: file, log: beside("-wal")?, is_in_transaction }))
}

/// Starts reading a file that another program may still be writing.
pub fn begin_growing(path: &Path) -> Result<(GrowingScan<File>, Option<FileIdentity>), LogError> {
    let file = open(path)?;
    let read_error = |source| LogError::Read { path: path.to_owned(), source };
    let identity = file.metadata().map(|metadata| identity(&metadata)).map_err(read_error)?;
    Ok((GrowingScan::new(file).map_err(read_error)?, identity))
}

/// Device and inode number of a file, which stay when it is renamed.
pub type FileIdentity = (u64, u64);

/// Returns the identity of a file, if the system has one. Another file under the same name has another identity.
#[cfg(unix)]
pub fn identity(metadata: &Metadata) -> Option<FileIdentity> {
    use std::os::unix::fs::MetadataExt;
    Some((metadata.dev(), metadata.ino()))
}

/// Returns the identity of a file, if the system has one. Another file under the same name has another identity.
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
    names.retain(|name| [".mcap", ".mcap.partial", ".db3"].iter().any(|ending| name.ends_with(ending)));
    names.sort();
    match names.len() {
        0 => "it is a folder without any .mcap or .db3 file".to_owned(),
        n if n <= 8 => format!("it is a folder; name one of its files: {}", names.join(", ")),
        n => format!("it is a folder; name one of its {n} .mcap and .db3 files"),
    }
}

pub fn of_scan(path: &Path, error: ScanError) -> LogError {
    match error {
        ScanError::Read(source) => LogError::Read { path: path.to_owned(), source },
        ScanError::Empty => LogError::Empty { path: path.to_owned() },
        ScanError::Truncated { bytes, read } => LogError::Truncated { path: path.to_owned(), bytes, read },
        ScanError::Rewritten => LogError::Replaced { path: path.to_owned() },
        ScanError::NotBag { found } => LogError::NotBag { path: path.to_owned(), found },
        ScanError::NotMcap { found } => LogError::NotMcap { path: path.to_owned(), found },
    }
}

//! A lock on a folder, so that one command at a time writes to it.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use crate::output::{OutputError, make_folder, refuse_link};

const LOCK: &str = "armcal.lock";

/// Lock that keeps others out of a folder while the value lives; the system releases it however the program ends.
#[derive(Debug)]
pub(crate) struct FolderLock {
    folder: PathBuf,
    is_new: bool,
    file: Option<File>,
}

impl FolderLock {
    /// Makes the folder, if necessary, and locks it.
    ///
    /// # Errors
    /// When the folder cannot be made or written to, or another process is writing into it.
    pub fn take(folder: &Path) -> Result<Self, OutputError> {
        let is_new = !folder.exists();
        make_folder(folder)?;
        let mut taken = Self { folder: folder.to_owned(), is_new, file: None };
        taken.file = Some(lock(folder)?);
        Ok(taken)
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        if self.file.is_some() {
            // The file is removed while the lock is held: a process that opens it later makes a new one.
            let _ = fs::remove_file(self.folder.join(LOCK));
        }
        if self.is_new {
            // This succeeds only if the folder is empty.
            let _ = fs::remove_dir(&self.folder);
        }
    }
}

fn lock(folder: &Path) -> Result<File, OutputError> {
    let path = folder.join(LOCK);
    refuse_link(&path)?;
    loop {
        let file = File::options()
            .create(true)
            .write(true)
            .truncate(false)
            .open(&path)
            .map_err(OutputError::of(folder, "cannot write into this folder"))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                let problem = "another run or calibration is writing into this folder; choose another with --out";
                return Err(OutputError::new(folder, problem));
            }
            // A file system without locks cannot lock the folder, but it can hold a run.
            Err(TryLockError::Error(error)) if error.kind() != std::io::ErrorKind::Unsupported => {
                return Err(OutputError::of(&path, "cannot be locked")(error));
            }
            _ => {}
        }
        // The previous run may have removed the file between our opening and locking it.
        if is_at(&file, &path) {
            return Ok(file);
        }
    }
}

/// True if the open file is still the one at `path`.
#[cfg(unix)]
pub(crate) fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |metadata: fs::Metadata| (metadata.dev(), metadata.ino());
    file.metadata().ok().map(id) == fs::symlink_metadata(path).ok().map(id)
}

#[cfg(not(unix))]
pub(crate) fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

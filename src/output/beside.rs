//! A file that is written next to its final path under a temporary name, and renamed once it is complete.
//!
//! The temporary file is `.NAME.RANDOM.partial`, new and no link, locked while it is written. A killed command's
//! leftovers are removed by the next command that writes to the same path.

use std::fs::{self, File};
use std::path::Path;

use tempfile::{Builder, NamedTempFile};

use crate::output::lock::is_at;
use crate::output::{OutputError, as_written, check_replaceable, make_folder, parent};

const SUFFIX: &str = ".partial";

/// A file that is being written; removed if dropped.
#[derive(Debug)]
pub(crate) struct Beside<'a> {
    path: &'a Path,
    file: NamedTempFile,
}

impl<'a> Beside<'a> {
    /// Begins the file that is to replace `path`.
    ///
    /// # Errors
    /// When the folder takes no files, or the object at `path` cannot be replaced by a file.
    pub fn begin(path: &'a Path) -> Result<Self, OutputError> {
        check_replaceable(path)?;
        let folder = parent(path);
        let prefix = prefix(path);
        remove_leftovers(folder, &prefix);
        loop {
            let mut builder = Builder::new();
            builder.prefix(&prefix).suffix(SUFFIX);
            // Permissions follow the umask: temporary files are private otherwise, and results are for others, too.
            #[cfg(unix)]
            builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
            let file = builder.tempfile_in(folder).map_err(OutputError::of(folder, "cannot write into this folder"))?;
            // On a file system without locks, leftovers stay.
            let _ = file.as_file().try_lock();
            // Another process that removes leftovers may have been quicker than the lock.
            if is_at(file.as_file(), file.path()) {
                return Ok(Self { path, file });
            }
        }
    }

    /// Temporary path of the file.
    #[cfg(feature = "viewer")]
    pub fn grows_at(&self) -> &Path {
        self.file.path()
    }

    /// Writes all bytes and syncs them to disk.
    pub fn write(mut self, bytes: &[u8]) -> Result<Self, OutputError> {
        use std::io::Write;
        self.file.write_all(&as_written(self.path, bytes)).map_err(OutputError::of(self.path, "cannot be written"))?;
        self.synced()
    }

    /// Syncs the file to disk before it takes its final name.
    fn synced(self) -> Result<Self, OutputError> {
        self.file.as_file().sync_all().map_err(OutputError::of(self.path, "cannot be written"))?;
        Ok(self)
    }

    /// Renames the file to its final path.
    pub fn put_in_place(self) -> Result<(), OutputError> {
        let path = self.path;
        let written = self.synced()?.file.persist(path);
        written.map(drop).map_err(|failed| OutputError::of(path, "cannot be put in place")(failed.error))
    }
}

/// Writes `bytes` to a temporary file and replaces `path` with it in one step.
#[cfg(feature = "sim")]
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    write_together(&[(path, bytes)])
}

/// Writes all of `files` to temporary files and then replaces each in one step; if one cannot be written, none is
/// replaced. The old last file is removed first and the new one comes last, because it vouches for the others.
pub fn write_together(files: &[(&Path, &[u8])]) -> Result<(), OutputError> {
    let written = files.iter().map(|(path, bytes)| Beside::begin(path)?.write(bytes)).collect::<Result<Vec<_>, _>>()?;
    if let [_, .., (last, _)] = files
        && last.is_file()
    {
        std::fs::remove_file(last).map_err(OutputError::of(last, "cannot be replaced"))?;
    }
    written.into_iter().try_for_each(Beside::put_in_place)
}

/// Checks that `path` can be written: its folder exists, is made if necessary, and takes files.
pub(crate) fn check_writable(path: &Path) -> Result<(), OutputError> {
    make_folder(parent(path))?;
    Beside::begin(path).map(drop)
}

/// Checks that a folder takes files, before the work that fills it. A folder that is made for this check is removed
/// again.
pub fn check_takes_files(folder: &Path) -> Result<(), OutputError> {
    let is_new = !folder.exists();
    check_writable(&folder.join("file"))?;
    if is_new {
        // A folder that is no longer empty stays.
        let _ = fs::remove_dir(folder);
    }
    Ok(())
}

fn prefix(path: &Path) -> String {
    format!(".{}.", path.file_name().unwrap_or_default().to_string_lossy())
}

/// Removes temporary files that no process holds any more. Files that cannot be examined do no harm.
fn remove_leftovers(folder: &Path, prefix: &str) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let is_ours = name.to_str().is_some_and(|name| name.starts_with(prefix) && name.ends_with(SUFFIX));
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_ours && is_file && File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok()) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leftovers_go_and_what_grows_stays() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.csv");
        let names = || fs::read_dir(dir.path()).unwrap().count();
        fs::write(dir.path().join(".a.csv.dead.partial"), "half").unwrap();
        fs::write(dir.path().join(".b.csv.dead.partial"), "of another").unwrap();
        let growing = Beside::begin(&path).unwrap();
        assert_eq!(names(), 2, "the leftover of a.csv is gone");
        let second = Beside::begin(&path).unwrap();
        assert_eq!(names(), 3, "two grow at once");
        growing.write(b"first").unwrap().put_in_place().unwrap();
        second.write(b"second").unwrap().put_in_place().unwrap();
        assert_eq!((fs::read(&path).unwrap().as_slice(), names()), (&b"second"[..], 2));
        drop(Beside::begin(&path).unwrap());
        assert_eq!(names(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_replaced_and_never_followed() {
        let dir = tempfile::tempdir().unwrap();
        let [path, target] = ["a.csv", "target"].map(|name| dir.path().join(name));
        fs::write(&target, "kept").unwrap();
        std::os::unix::fs::symlink(&target, &path).unwrap();
        std::os::unix::fs::symlink(&target, dir.path().join(".a.csv.x.partial")).unwrap();
        Beside::begin(&path).unwrap().write(b"new").unwrap().put_in_place().unwrap();
        assert_eq!((fs::read(&target).unwrap(), fs::read(&path).unwrap()), (b"kept".to_vec(), b"new".to_vec()));
    }
}

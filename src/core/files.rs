//! Files at paths that users name, read within limits.
//!
//! Only regular files are opened: a device may have no end, and a pipe no beginning. No file is read beyond the limit
//! of its kind, regardless of the size that it claims. Errors are ends of a sentence that begins with the file's name.

use std::fs::{File, FileType, metadata};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::{Component, Path};

/// Kind of a file's content, which limits its length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// TOML, YAML, URDF, a calibration's compact line.
    Text,
    /// Rows of a campaign or of a recorded motion.
    Table,
    /// A mesh: STL or OBJ.
    Mesh,
}

impl FileKind {
    /// Returns the maximum number of bytes that are read.
    #[must_use]
    pub fn max_bytes(self) -> u64 {
        match self {
            Self::Text => 8 << 20,
            Self::Table => 64 << 20,
            Self::Mesh => 200_000_000,
        }
    }
}

/// Opens a regular file; recordings, which are read piece by piece, have no limit of size.
///
/// # Errors
/// The system's error, or an error if the file is not a regular one.
pub fn open(file: &Path) -> Result<File> {
    // The type is checked first, because opening a pipe without a writer waits. It is checked again after opening,
    // because the file may have been replaced.
    check_regular(metadata(file)?.file_type())?;
    let opened = File::open(file)?;
    check_regular(opened.metadata()?.file_type())?;
    Ok(opened)
}

/// Returns the bytes of a regular file of this kind.
///
/// # Errors
/// The errors of [`open`], or an error if the file is too long.
pub fn read_bytes(file: &Path, kind: FileKind) -> Result<Vec<u8>> {
    read_within(open(file)?, kind)
}

/// Returns the text of a regular file of this kind.
///
/// # Errors
/// The errors of [`read_bytes`], or an error if the file is not UTF-8.
pub fn read_text(file: &Path, kind: FileKind) -> Result<String> {
    into_text(read_bytes(file, kind)?)
}

/// Returns the text that a file's bytes encode.
///
/// # Errors
/// An error if the bytes are not UTF-8; it names the encoding that their beginning states.
pub fn into_text(bytes: Vec<u8>) -> Result<String> {
    let is_utf16 = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
    String::from_utf8(bytes).map_err(|error| {
        let what = match is_utf16 {
            true => "it is a text in UTF-16; save it in UTF-8".to_owned(),
            false => {
                let at = error.utf8_error().valid_up_to();
                let line = 1 + error.as_bytes()[..at].iter().filter(|byte| **byte == b'\n').count();
                format!("line {line} is not a text in UTF-8 (byte {at}); save the file in UTF-8")
            }
        };
        Error::new(ErrorKind::InvalidData, what)
    })
}

/// Returns all bytes of `source`, such as stdin, read as a file of this kind.
///
/// # Errors
/// The system's error, or an error if the source is too long.
pub fn read_within(source: impl Read, kind: FileKind) -> Result<Vec<u8>> {
    let max = kind.max_bytes();
    let mut bytes = Vec::new();
    source.take(max + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > max {
        return Err(Error::new(ErrorKind::FileTooLarge, format!("it has more than {max} bytes")));
    }
    Ok(bytes)
}

/// Checks that no link leads from `file` out of `folder`. A file that is outside by its name passes. So does a file
/// that does not exist: reading it gives the better error.
///
/// # Errors
/// An error if a link leads out of the folder.
pub fn check_within(folder: &Path, file: &Path) -> Result<()> {
    let is_inside = |path: &Path| path.components().all(|part| matches!(part, Component::Normal(_)));
    if !file.strip_prefix(folder).is_ok_and(is_inside) {
        return Ok(());
    }
    let folder = if folder == Path::new("") { Path::new(".") } else { folder };
    let (Ok(folder), Ok(found)) = (folder.canonicalize(), file.canonicalize()) else { return Ok(()) };
    if found.starts_with(&folder) {
        return Ok(());
    }
    let problem = format!("it is a link out of its folder, to {}", found.display());
    Err(Error::new(ErrorKind::InvalidInput, problem))
}

fn check_regular(found: FileType) -> Result<()> {
    if found.is_file() {
        return Ok(());
    }
    let what = if found.is_dir() { "a folder" } else { "a pipe, a socket or a device" };
    Err(Error::new(ErrorKind::InvalidInput, format!("it is {what}, not a regular file")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    fn problem(file: &Path) -> ErrorKind {
        read_text(file, FileKind::Text).expect_err("refused").kind()
    }

    #[test]
    fn devices_pipes_and_folders_are_refused_at_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let [zeros, pipe] = ["zeros.toml", "pipe.toml"].map(|name| folder.path().join(name));
        symlink("/dev/zero", &zeros).expect("linked");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
        for file in [&zeros, &pipe, Path::new("/dev/zero")] {
            assert_eq!(problem(file), ErrorKind::InvalidInput, "{}", file.display());
            assert!(open(file).is_err());
        }
        assert_eq!(problem(folder.path()), ErrorKind::InvalidInput);
        assert_eq!(problem(&folder.path().join("none")), ErrorKind::NotFound);
    }

    #[test]
    fn a_file_is_read_up_to_the_limit_of_its_kind() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("long.toml");
        let mut bytes = vec![b' '; FileKind::Text.max_bytes() as usize];
        std::fs::write(&file, &bytes).expect("written");
        assert_eq!(read_text(&file, FileKind::Text).expect("it reads").len(), bytes.len());
        bytes.push(b' ');
        std::fs::write(&file, &bytes).expect("written");
        assert_eq!(problem(&file), ErrorKind::FileTooLarge);
        assert!(read_bytes(&file, FileKind::Table).is_ok());
        std::fs::write(&file, [0xff, 0xfe]).expect("written");
        assert_eq!(problem(&file), ErrorKind::InvalidData);
    }

    #[test]
    fn links_may_not_leave_their_folder() {
        let folder = tempfile::tempdir().expect("a folder");
        let (robot, outside) = (folder.path().join("robot"), folder.path().join("a.urdf"));
        std::fs::create_dir(&robot).expect("a folder");
        std::fs::write(&outside, "").expect("written");
        std::fs::write(robot.join("b.urdf"), "").expect("written");
        symlink(&outside, robot.join("out.urdf")).expect("linked");
        symlink("b.urdf", robot.join("in.urdf")).expect("linked");
        // The folder itself may be a link.
        let linked = folder.path().join("linked");
        symlink(&robot, &linked).expect("linked");
        for folder in [&robot, &linked] {
            assert!(check_within(folder, &folder.join("in.urdf")).is_ok());
            assert!(check_within(folder, &folder.join("none.urdf")).is_ok());
            assert!(check_within(folder, &folder.join("../a.urdf")).is_ok(), "a path may say so");
            let problem = check_within(folder, &folder.join("out.urdf")).expect_err("refused");
            assert_eq!(problem.kind(), ErrorKind::InvalidInput);
        }
    }
}

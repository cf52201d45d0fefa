//! Files that are put in place once they are complete.

use armcal_core::codes::{Code, Coded};
use armcal_core::text::printable;
use std::borrow::Cow;
use std::io::Error;
use std::path::{Path, PathBuf};

/// Extensions of text files that people read in terminals. Other files, a URDF among them, keep their bytes.
const TEXTS: [&str; 10] = ["csv", "html", "json", "jsonl", "md", "toml", "txt", "xml", "yaml", "yml"];

/// Reason that a file or folder could not be written; the source, if there is one, has the system's error.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct OutputError {
    pub path: PathBuf,
    problem: String,
    source: Option<Error>,
}

impl OutputError {
    pub(crate) fn of(path: &Path, problem: impl Into<String>) -> impl FnOnce(Error) -> Self {
        let problem = problem.into();
        move |source| Self { path: path.to_owned(), problem, source: Some(source) }
    }

    pub(crate) fn new(path: &Path, problem: impl Into<String>) -> Self {
        Self { path: path.to_owned(), problem: problem.into(), source: None }
    }
}

/// The bytes that are written for a file: in texts, control characters in third-party names are made harmless for
/// terminals.
pub(crate) fn as_written<'a>(path: &Path, bytes: &'a [u8]) -> Cow<'a, [u8]> {
    let ending = path.extension().and_then(|ending| ending.to_str());
    match std::str::from_utf8(bytes) {
        Ok(text) if ending.is_some_and(|ending| TEXTS.contains(&ending)) => match printable(text) {
            Cow::Borrowed(text) => Cow::Borrowed(text.as_bytes()),
            Cow::Owned(text) => Cow::Owned(text.into_bytes()),
        },
        _ => Cow::Borrowed(bytes),
    }
}

/// Checks that `path` can be replaced by a file: a folder or a device such as /dev/full cannot.
pub(crate) fn check_replaceable(path: &Path) -> Result<(), OutputError> {
    match std::fs::metadata(path) {
        Ok(found) if !found.is_file() => {
            Err(OutputError::new(path, "cannot be put in place: what is there is no file"))
        }
        _ => Ok(()),
    }
}

/// Refuses a link at `path`: files with predictable names must never be written through a link.
pub(crate) fn refuse_link(path: &Path) -> Result<(), OutputError> {
    match std::fs::symlink_metadata(path) {
        Ok(found) if found.is_symlink() => Err(OutputError::new(path, "is a link, and is not followed: remove it")),
        _ => Ok(()),
    }
}

/// The folder that holds `path`.
pub(crate) fn parent(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// `path` with `.partial` added: the name of a stream until it is complete.
#[cfg(feature = "closed-loop")]
pub(crate) fn partial(path: &Path) -> PathBuf {
    with_suffix(path, ".partial")
}

/// `path` with text added to its name.
#[cfg(feature = "closed-loop")]
pub(crate) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}

/// Renames the finished file `from` to `path`.
#[cfg(feature = "closed-loop")]
pub(crate) fn complete(from: &Path, path: &Path) -> Result<(), OutputError> {
    check_replaceable(path)?;
    std::fs::rename(from, path).map_err(OutputError::of(path, "cannot be put in place"))
}

/// Removes the file at `path`, if there is one.
#[cfg(any(feature = "closed-loop", feature = "viewer"))]
pub fn remove(path: &Path) -> Result<(), OutputError> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(OutputError::of(path, "cannot be removed")(error))
        }
        _ => Ok(()),
    }
}

/// Makes the output folder.
pub fn make_folder(folder: &Path) -> Result<(), OutputError> {
    std::fs::create_dir_all(folder).map_err(OutputError::of(folder, "cannot be made"))
}

impl Coded for OutputError {
    fn code(&self) -> Code {
        Code::FileUnwritable
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_texts_are_escaped_and_other_files_keep_their_bytes() {
        let name = "a = \"tip\u{202e}\u{9b}31m\"\n";
        for ending in TEXTS {
            let written = as_written(Path::new(&format!("b.{ending}")), name.as_bytes()).into_owned();
            assert_eq!(written, b"a = \"tip\\u202e\\u009b31m\"\n", "{ending}");
        }
        let json = serde_json::Value::from("tip\u{2066}").to_string();
        let written = as_written(Path::new("b.json"), json.as_bytes()).into_owned();
        assert!(written.is_ascii());
        assert_eq!(serde_json::from_slice::<String>(&written).expect("JSON"), "tip\u{2066}");
        for path in ["b.urdf", "b.stl", "b.mcap", "b"] {
            assert_eq!(*as_written(Path::new(path), name.as_bytes()), *name.as_bytes(), "{path}");
        }
        assert_eq!(*as_written(Path::new("b.toml"), b"\xff\x1b"), *b"\xff\x1b");
    }
}

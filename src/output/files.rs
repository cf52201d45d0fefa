//! Files put in place when they are whole.

use std::io::{Error, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// Why a file or folder could not be written; the source, if there is one, says what the system thinks of it.
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

/// Writes `bytes` beside `path` and puts them in its place in one step.
#[cfg(feature = "sim")]
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    write_together(&[(path, bytes)])
}

/// Writes all of `files` beside their places and then puts each in its place in one step; if one cannot be written,
/// none is replaced. The old last file goes first and the new one comes last: it vouches for the others.
pub(crate) fn write_together(files: &[(&Path, &[u8])]) -> Result<(), OutputError> {
    let written = files.iter().map(|(path, bytes)| write_beside(path, bytes)).collect::<Result<Vec<_>, _>>()?;
    if let [_, .., (last, _)] = files
        && last.is_file()
    {
        std::fs::remove_file(last).map_err(OutputError::of(last, "cannot be replaced"))?;
    }
    for (file, (path, _)) in written.into_iter().zip(files) {
        file.persist(path).map_err(|failed| OutputError::of(path, "cannot be put in place")(failed.error))?;
    }
    Ok(())
}

fn write_beside(path: &Path, bytes: &[u8]) -> Result<NamedTempFile, OutputError> {
    check_replaceable(path)?;
    let folder = parent(path);
    let mut file = NamedTempFile::new_in(folder).map_err(OutputError::of(folder, "cannot write into this folder"))?;
    file.write_all(bytes)
        .and_then(|()| file.as_file().sync_all())
        .map_err(OutputError::of(path, "cannot be written"))?;
    make_readable(file.path()).map_err(OutputError::of(path, "cannot be made readable"))?;
    Ok(file)
}

/// That `path` can be replaced by a file: a folder or a device such as /dev/full cannot.
pub(crate) fn check_replaceable(path: &Path) -> Result<(), OutputError> {
    match std::fs::metadata(path) {
        Ok(found) if !found.is_file() => {
            Err(OutputError::new(path, "cannot be put in place: what is there is no file"))
        }
        _ => Ok(()),
    }
}

/// That `path` can be written: its folder is there, made if need be, and takes files.
pub(crate) fn check_writable(path: &Path) -> Result<(), OutputError> {
    let folder = parent(path);
    make_folder(folder)?;
    check_replaceable(path)?;
    NamedTempFile::new_in(folder).map(drop).map_err(OutputError::of(folder, "cannot write into this folder"))
}

/// The folder that holds `path`.
pub(crate) fn parent(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Temporary files are private; results are for everybody whom the folder lets in.
fn make_readable(path: &Path) -> Result<(), Error> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o644))?;
    }
    #[cfg(not(unix))]
    let _ = path;
    Ok(())
}

/// `path` with `.partial` added: where a stream grows until it is whole.
#[cfg(any(feature = "sim", feature = "viewer"))]
pub(crate) fn partial(path: &Path) -> PathBuf {
    with_suffix(path, ".partial")
}

/// `path` with text added to its name.
#[cfg(any(feature = "sim", feature = "viewer"))]
pub(crate) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}

/// Puts a finished stream in its place.
#[cfg(any(feature = "sim", feature = "viewer"))]
pub(crate) fn complete(path: &Path) -> Result<(), OutputError> {
    check_replaceable(path)?;
    std::fs::rename(partial(path), path).map_err(OutputError::of(path, "cannot be put in place"))
}

/// Makes the output folder.
pub(crate) fn make_folder(folder: &Path) -> Result<(), OutputError> {
    std::fs::create_dir_all(folder).map_err(OutputError::of(folder, "cannot be made"))
}

//! Files that replace others only once they are whole.

use std::io::Write;
use std::path::Path;
#[cfg(any(feature = "sim", feature = "viewer"))]
use std::path::PathBuf;

use anyhow::{Context, Result};

/// Writes `bytes` beside `path` and puts them in its place in one step.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(folder)
        .with_context(|| format!("{}: cannot write into this folder", folder.display()))?;
    file.write_all(bytes).with_context(|| format!("{}: cannot be written", path.display()))?;
    make_readable(file.path())?;
    file.persist(path).with_context(|| format!("{}: cannot be put in place", path.display()))?;
    Ok(())
}

/// Temporary files are private; results are for everybody whom the folder lets in.
fn make_readable(path: &Path) -> Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o644))
            .with_context(|| format!("{}: cannot be made readable", path.display()))?;
    }
    #[cfg(not(unix))]
    let _ = path;
    Ok(())
}

/// `path` with `.partial` added: where a stream grows until it is whole.
#[cfg(any(feature = "sim", feature = "viewer"))]
pub(super) fn partial(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".partial");
    PathBuf::from(name)
}

/// Puts a finished stream in its place.
#[cfg(any(feature = "sim", feature = "viewer"))]
pub(super) fn complete(path: &Path) -> Result<()> {
    std::fs::rename(partial(path), path).with_context(|| format!("{}: cannot be put in place", path.display()))
}

/// Makes the output folder.
pub(super) fn make_folder(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))
}

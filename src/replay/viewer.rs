//! Start of an installed Rerun viewer.

use armcal_core::codes::{Code, Coded};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// The viewer's program, looked up on PATH.
const PROGRAM: &str = "rerun";

/// Error of opening a viewer.
#[derive(Debug, thiserror::Error)]
pub enum ViewerError {
    #[error("{}: there is no such file", path.display())]
    NoFile { path: PathBuf },
    #[error(
        "no `{PROGRAM}` on PATH to show {} with; get it by `pip install rerun-sdk==0.36.3` or \
         `cargo binstall rerun-cli@0.36.3`, or keep the file with --save FILE.rrd and open it at \
         https://rerun.io/viewer",
        path.display()
    )]
    NotInstalled { path: PathBuf },
    #[error("`{PROGRAM}` could not be started: {source}")]
    Start { source: std::io::Error },
}

/// Starts the viewer with `rrd` and returns while it runs; the caller may wait for it or leave it.
///
/// # Errors
/// [`ViewerError`], which says how to get a viewer.
pub fn open_viewer(rrd: &Path) -> Result<Child, ViewerError> {
    open_with(PROGRAM, rrd)
}

fn open_with(program: &str, rrd: &Path) -> Result<Child, ViewerError> {
    if !rrd.is_file() {
        return Err(ViewerError::NoFile { path: rrd.to_owned() });
    }
    // Binds to the loopback: by default the viewer listens to the whole network.
    let started =
        Command::new(program).arg(rrd).args(["--bind", "127.0.0.1"]).stdin(Stdio::null()).stdout(Stdio::null()).spawn();
    started.map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => ViewerError::NotInstalled { path: rrd.to_owned() },
        _ => ViewerError::Start { source },
    })
}

impl Coded for ViewerError {
    fn code(&self) -> Code {
        match self {
            Self::NoFile { .. } => Code::FileUnreadable,
            Self::NotInstalled { .. } => Code::ViewerMissing,
            Self::Start { .. } => Code::ViewerMissing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_viewer_and_missing_file_are_told_apart() {
        let dir = tempfile::tempdir().unwrap();
        let rrd = dir.path().join("run.rrd");
        assert!(matches!(open_viewer(&rrd), Err(ViewerError::NoFile { .. })));
        std::fs::write(&rrd, b"RRF2").unwrap();
        let error = open_with("no-such-viewer-anywhere", &rrd).unwrap_err();
        insta::assert_snapshot!("no_viewer", error.to_string().replace(&dir.path().display().to_string(), "FOLDER"));
    }
}

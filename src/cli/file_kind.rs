//! Kinds of files by their first bytes or their key `kind`. Errors name the command for a file.

use armcal_core::codes::Code;
use std::io::Read;
use std::path::Path;

use anyhow::Result;

use crate::cli::exit::UsageError;
use armcal_core::document::stated_kind;
use armcal_core::files::{self, FileKind as Size};
use armcal_core::kind::Kind;
use armcal_core::log::for_each_raw;
use armcal_core::robot::parse_toml;

/// Kind of a file or folder that armcal reads or writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FileKind {
    Recording,
    Bag,
    Rerun,
    RobotFolder,
    Urdf,
    /// TOML that states its kind.
    Toml(Kind),
}

/// Number of bytes at a file's start that identify a recording.
const START_BYTES: usize = 16;

impl FileKind {
    /// Kind of the file at `path`; `None` for a missing, unreadable or unknown file.
    pub fn of(path: &Path) -> Option<Self> {
        if path.is_dir() {
            let has = |name: &str| path.join(name).is_file();
            return match (has("robot.toml"), has("metadata.yaml")) {
                (true, _) => Some(Self::RobotFolder),
                (false, true) => Some(Self::Bag),
                (false, false) => None,
            };
        }
        let mut start = Vec::new();
        files::open(path).ok()?.take(START_BYTES as u64).read_to_end(&mut start).ok()?;
        let begins = [
            (&b"\x89MCAP"[..], Self::Recording),
            (b"SQLite format 3", Self::Bag),
            (b"RRF", Self::Rerun),
            (b"RRIO", Self::Rerun),
        ];
        if let Some((_, kind)) = begins.into_iter().find(|(magic, _)| start.starts_with(magic)) {
            return Some(kind);
        }
        let text = files::read_text(path, Size::Text).ok()?;
        if start.trim_ascii_start().starts_with(b"<") {
            return text.contains("<robot").then_some(Self::Urdf);
        }
        let table: toml::Table = parse_toml(path, &text).ok()?;
        stated_kind(path, &table, None).ok().map(Self::Toml)
    }

    /// Name with its article.
    pub fn name(self) -> &'static str {
        match self {
            Self::Recording => "a recording (.mcap)",
            Self::Bag => "a ROS bag",
            Self::Rerun => "a file for the Rerun viewer (.rrd)",
            Self::RobotFolder => "a robot folder",
            Self::Urdf => "a URDF",
            Self::Toml(kind) => kind.in_words(),
        }
    }

    /// Commands that take the file, in words.
    fn takers(self) -> &'static str {
        match self {
            Self::Recording => "`armcal calibrate`, `inspect`, `tagmap`, `watch` and `replay` take it",
            Self::Bag => "`armcal inspect`, and `armcal calibrate` with --input, take it",
            Self::Rerun => "open it with `rerun FILE`; other commands take the recording that it was made from",
            Self::RobotFolder => "give it as --robot",
            Self::Urdf => "`armcal new-robot` makes a robot folder of it",
            Self::Toml(kind) => kind.takers(),
        }
    }
}

/// Refuses a file of a known kind that is not in `wanted`; an unknown kind is left to its reader.
pub(super) fn expect_kind(path: &Path, wanted: &[FileKind]) -> Result<()> {
    match FileKind::of(path).filter(|kind| !wanted.contains(kind)) {
        Some(kind) => {
            let (file, wanted) = (path.display(), wanted.first().map_or("", |kind| kind.name()));
            Err(UsageError::new(Code::FileKind, format!("{file}: is {}, not {wanted}; {}", kind.name(), kind.takers()))
                .into())
        }
        None => Ok(()),
    }
}

/// Refuses a file that is known to be no routine.
///
/// # Errors
/// Error with the file's actual kind, and the command that takes it.
pub fn expect_routine(path: &Path) -> Result<()> {
    expect_kind(path, &[FileKind::Toml(Kind::Routine)])
}

/// Refuses a file that is known to be no recording, of armcal or of other programs.
pub(super) fn expect_recording(path: &Path) -> Result<()> {
    expect_kind(path, &[FileKind::Recording, FileKind::Bag])
}

/// Refuses the truth of a simulation, and names the recording of the same run. It reads the whole file, so that it is
/// for files without readings.
pub(super) fn expect_no_truth(path: &Path) -> Result<()> {
    let mut is_truth = false;
    for_each_raw(path, |raw| is_truth |= raw.topic().starts_with("/truth/"))?;
    if !is_truth {
        return Ok(());
    }
    let name = path.file_name().and_then(|name| name.to_str()?.strip_prefix("truth"));
    let recording = path.with_file_name(name.map_or_else(|| "run.mcap".to_owned(), |rest| format!("run{rest}")));
    let (file, recording) = (path.display(), recording.display());
    let problem = format!("{file}: is the truth of a simulation, which holds no readings of an arm; give {recording}");
    Err(UsageError::new(Code::FileKind, problem).into())
}

/// Refuses a file that an option names if it is known to be of another kind.
pub(super) fn expect_option(path: Option<&Path>, wanted: Kind) -> Result<()> {
    path.map_or(Ok(()), |path| expect_kind(path, &[FileKind::Toml(wanted)]))
}

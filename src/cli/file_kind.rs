//! What a file is, by its content, and which command takes it: for those who name the wrong one.

use armcal_core::codes::Code;
use std::io::Read;
use std::path::Path;

use anyhow::Result;

use crate::cli::exit::UsageError;
use armcal_core::files::{self, FileKind as Size};
use armcal_core::robot::parse_toml;

/// What armcal reads and writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FileKind {
    Recording,
    Bag,
    Rerun,
    RobotFolder,
    RobotFile,
    Urdf,
    Routine,
    Vehicle,
    Calibration,
    InputMap,
    TagMap,
    Task,
    Plan,
    Connection,
    /// A routine without a vehicle, as people write it at first.
    RoutineWithoutVehicle,
}

/// So much of a file's start tells a recording.
const START_BYTES: usize = 16;

impl FileKind {
    /// `None` for what is not there, cannot be read or is nothing of these.
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
        Self::of_table(&parse_toml(path, &text).ok()?)
    }

    /// By the keys of a TOML file.
    pub fn of_table(table: &toml::Table) -> Option<Self> {
        let has = |key: &str| table.contains_key(key);
        let by_keys = [
            (has("inputs_hash"), Self::Plan),
            (has("robot") && has("vehicle"), Self::Routine),
            (has("urdf") && has("joint_sensor"), Self::RobotFile),
            (has("part"), Self::Vehicle),
            (has("joint_sensors") && has("tags"), Self::InputMap),
            (has("frame") && has("tag"), Self::TagMap),
            (has("tolerance_m"), Self::Task),
            (has("messages_hash"), Self::Calibration),
            (has("robot") && has("task"), Self::RoutineWithoutVehicle),
            (has("joint_sensors") && has("commands"), Self::Connection),
        ];
        by_keys.into_iter().find(|(is, _)| *is).map(|(_, kind)| kind)
    }

    /// With its article.
    pub fn name(self) -> &'static str {
        match self {
            Self::Recording => "a recording (.mcap)",
            Self::Bag => "a ROS bag",
            Self::Rerun => "a file for the Rerun viewer (.rrd)",
            Self::RobotFolder => "a robot folder",
            Self::RobotFile => "a robot.toml",
            Self::Urdf => "a URDF",
            Self::Routine | Self::RoutineWithoutVehicle => "a routine",
            Self::Vehicle => "a vehicle",
            Self::Calibration => "a calibration",
            Self::InputMap => "an input map",
            Self::TagMap => "a tag map",
            Self::Task => "a task",
            Self::Plan => "a plan",
            Self::Connection => "a connection map",
        }
    }

    /// Where it belongs.
    fn takers(self) -> &'static str {
        match self {
            Self::Recording => "`armcal calibrate`, `inspect`, `tagmap`, `watch` and `replay` take it",
            Self::Bag => "`armcal inspect`, and `armcal calibrate` with --input, take it",
            Self::Rerun => "open it with `rerun FILE`; other commands take the recording that it was made from",
            Self::RobotFolder => "give it as --robot",
            Self::RobotFile => "give its folder as --robot",
            Self::Urdf => "`armcal new-robot` makes a robot folder of it",
            Self::Routine | Self::RoutineWithoutVehicle => "`armcal run`, `plan`, `campaign` and `regress` take it",
            Self::Vehicle => "name it in a routine, or give it as --set vehicle=FILE",
            Self::Calibration => "`armcal export` takes it, and --prior",
            Self::InputMap => "give it as --input to `armcal calibrate`",
            Self::TagMap => "give it as --tag-map to `armcal calibrate`, or as --tags to `armcal tagmap`",
            Self::Task => "give it as --task to `armcal calibrate` or `watch`",
            Self::Plan => "`armcal check` reads it",
            Self::Connection => "give it as --arm: `armcal drive ROUTINE --arm FILE`",
        }
    }
}

/// Refuses a file that is known to be none of `wanted`; one that is not known is left to its reader.
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

/// The same for a routine.
///
/// # Errors
/// What the file is instead, and which command takes it.
pub fn expect_routine(path: &Path) -> Result<()> {
    expect_kind(path, &[FileKind::Routine, FileKind::RoutineWithoutVehicle])
}

/// The same for recordings, of armcal or of others.
pub(super) fn expect_recording(path: &Path) -> Result<()> {
    expect_kind(path, &[FileKind::Recording, FileKind::Bag])
}

/// The same for a file that an option names, if it is given.
pub(super) fn expect_option(path: Option<&Path>, wanted: FileKind) -> Result<()> {
    path.map_or(Ok(()), |path| expect_kind(path, &[wanted]))
}

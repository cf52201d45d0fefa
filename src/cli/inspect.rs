//! `armcal inspect`: what is in a recording, whether it is whole, what could be calibrated from it.

use armcal_core::codes::Code;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;

use crate::cli::calibration_inputs::load_robot;
use crate::cli::closing::{say_wrapped, terminal_width};
use crate::cli::exit::{Exit, UsageError};
use crate::cli::file_kind::expect_recording;
use crate::cli::named;
use crate::cli::stdout::{note, say};
use crate::output;
use crate::report::inspection::{State, inspect as look, to_text};
use crate::report::pose_table::{LookedAt, TableInspection, inspect_table, neighbours, propose_table_map};
use crate::report::proposed_map::propose_input_map;
use armcal_core::input::read_table_contents;
use armcal_core::log::{LogError, read_attachments};
use armcal_core::robot::{self, Robot};

/// Exits with 0 for a whole recording, 3 for one that is cut or damaged, 2 for what is no recording.
#[derive(Debug, Args)]
pub(super) struct InspectArgs {
    /// Recording (.mcap, .db3) of armcal or of any other program, or a table of poses (.csv, .yaml, .json)
    recording: PathBuf,
    /// The other table, where joints and tags are in two; default: the one next to the first that fits
    other: Option<PathBuf>,
    /// Robot folder, to print which parameters the recording determines; default: the files attached to the recording
    #[arg(long, value_name = "DIR", value_parser = named::robot())]
    robot: Option<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
    /// Write a proposed input map for `calibrate --input`; --robot matches its joints. Nothing is overwritten
    #[arg(long, value_name = "FILE")]
    write_input: Option<PathBuf>,
}

pub(super) fn inspect(args: &InspectArgs) -> Result<Exit> {
    let table = looked_at(&args.recording)?;
    if table.is_none() {
        expect_recording(&args.recording)?;
        expect_no_other(args)?;
    }
    let robot = match &args.robot {
        Some(folder) => Some(load_robot(folder, &[])?),
        None if table.is_some() => None,
        None => attached_robot(&args.recording)?,
    };
    if let Some(file) = args.write_input.as_deref().filter(|file| file.symlink_metadata().is_ok()) {
        return Err(UsageError::new(
            Code::FileExists,
            format!("{}: is there; name another --write-input", file.display()),
        )
        .into());
    }
    if let Some(table) = table {
        return inspect_columns(args, &table, robot.as_ref());
    }
    let inspection = look(&args.recording, robot.as_ref())?;
    if args.json {
        say(&serde_json::to_string_pretty(&inspection).context("the inspection has no JSON form")?)?;
    } else {
        say_wrapped(&to_text(&inspection, terminal_width()))?;
    }
    if let Some(file) = &args.write_input {
        let text = propose_input_map(&args.recording, robot.as_ref())?;
        output::write_together(&[(file.as_path(), text.as_bytes())])?;
        note(format_args!("written: {}; look at what it says was chosen", file.display()));
    }
    Ok(match inspection.completeness.state {
        State::Whole => Exit::Ok,
        State::Cut | State::Damaged => Exit::DataLost,
    })
}

/// A table, recognised by the extension of its name; `None` for another file.
fn looked_at(path: &Path) -> Result<Option<LookedAt>> {
    let contents = read_table_contents(path).transpose()?;
    Ok(contents.map(|contents| LookedAt { path: path.to_owned(), contents }))
}

fn expect_no_other(args: &InspectArgs) -> Result<()> {
    let Some(other) = &args.other else { return Ok(()) };
    let (file, other) = (args.recording.display(), other.display());
    let problem = format!("{file}: is no table, so that {other} cannot be joined with it; inspect them one by one");
    Err(UsageError::new(Code::UsageInvalid, problem).into())
}

/// Inspects a table of poses, or two tables of which one has the joints and the other the tags.
fn inspect_columns(args: &InspectArgs, table: &LookedAt, robot: Option<&Robot>) -> Result<Exit> {
    let given = match &args.other {
        Some(path) => Some(looked_at(path)?.with_context(|| format!("{}: is no table", path.display()))?),
        None => None,
    };
    let inspected: Vec<TableInspection> =
        std::iter::once(table).chain(&given).map(|of| inspect_table(&of.path, &of.contents, robot)).collect();
    if args.json {
        let json = match &inspected[..] {
            [one] => serde_json::to_string_pretty(one),
            both => serde_json::to_string_pretty(both),
        };
        say(&json.context("the inspection has no JSON form")?)?;
    } else {
        let texts: Vec<String> = inspected.iter().map(TableInspection::to_text).collect();
        say_wrapped(&texts.join("\n\n"))?;
    }
    let other = match given {
        Some(given) => Some(given),
        None => the_neighbour(table, robot, args)?,
    };
    if let Some(file) = &args.write_input {
        let map = propose_table_map((table, other.as_ref()), robot, file)?;
        output::write_together(&[(file.as_path(), map.text.as_bytes())])?;
        let recording = other.map_or(String::new(), |_| format!("; give `calibrate` {}", map.recording.display()));
        note(format_args!("written: {}; look at what it says was chosen{recording}", file.display()));
    }
    Ok(Exit::Ok)
}

/// The only table next to `table` with the columns that it lacks.
fn the_neighbour(table: &LookedAt, robot: Option<&Robot>, args: &InspectArgs) -> Result<Option<LookedAt>> {
    let mut found = neighbours(table, robot);
    let names: Vec<String> = found.iter().map(|other| other.path.display().to_string()).collect();
    match found.len() {
        0 => Ok(None),
        1 => {
            note(format_args!("{} next to it has what it lacks; an input map can join both", names[0]));
            Ok(found.pop())
        }
        _ if args.write_input.is_none() => {
            note(format_args!("next to it, {} each have what it lacks: name one after it", names.join(", ")));
            Ok(None)
        }
        _ => {
            let file = args.recording.display();
            let problem = format!("{file}: {} each have what it lacks: name one after it", names.join(", "));
            Err(UsageError::new(Code::UsageInvalid, problem).into())
        }
    }
}

/// The robot from the recording's attachments; `None` where it is missing or unusable, because it is optional.
fn attached_robot(recording: &Path) -> Result<Option<Robot>, LogError> {
    let attachments = read_attachments(recording)?;
    if !attachments.iter().any(|(name, _)| name == "robot.toml") {
        return Ok(None);
    }
    let Ok(folder) = tempfile::tempdir() else { return Ok(None) };
    for (name, bytes) in attachments {
        // Only plain names: an attachment must not choose its path on disk.
        let is_plain = Path::new(&name).file_name().is_some_and(|plain| plain.to_str() == Some(&name));
        if is_plain && std::fs::write(folder.path().join(&name), bytes).is_err() {
            return Ok(None);
        }
    }
    Ok(robot::load_attached(folder.path()).ok())
}

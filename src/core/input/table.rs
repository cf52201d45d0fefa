//! Tables of poses at rest: CSV and YAML files by the columns of an input map.
//!
//! `one_table` reads rows that have joints and tags, `two_tables` joins the rows of two files. Both take numbers and
//! tags from `row_reader`, the rows from `csv_text` and `yaml`. `contents` examines a table before a map states its
//! columns.

use std::collections::BTreeMap;
use std::io::{Error, ErrorKind, Read};
use std::path::Path;

use super::error::InputError;
use super::joint_unit::check_unit;
use super::map::{InputMap, SeenColumns, TableFormat, TableLayout};
use super::recording::ExternalRecording;
use super::tags::{ExternalDetection, RawMeasurement};
use crate::files::{FileKind, into_text, open, read_bytes};
use crate::log::{FILE_START_BYTES, describe_file};
use crate::robot::Robot;

mod columns;
mod columns_seen;
mod contents;
mod csv_text;
mod one_table;
mod pose;
mod row_reader;
mod rows;
mod two_tables;
mod yaml;

pub use columns_seen::TableColumn;
pub use contents::{TableContents, read_table_contents};
use csv_text::csv_rows;
pub use one_table::MIN_APART_S;
pub use rows::{MAX_ROWS, plain_key, tag_number, whole_key};
use rows::{Rows, Wanted};
use yaml::yaml_rows;

/// Reads a table, or two that the input map joins; each row is one pose at rest.
pub(super) fn read_table(
    path: &Path,
    map: &InputMap,
    layout: &TableLayout,
    robot: &Robot,
) -> Result<ExternalRecording, InputError> {
    let file = path.display().to_string();
    let mut recording = match &layout.tags {
        None => one_table::read(path, map, layout, robot)?,
        Some(tags) => two_tables::read(path, map, (layout, tags), robot)?,
    };
    if matches!(layout.seen, SeenColumns::TagCorner { .. }) {
        join_corners(&mut recording);
    }
    if recording.frames.is_empty() {
        let why: Vec<String> = recording.left_out.iter().map(|(why, n)| format!("{n} {why}")).collect();
        let problem = format!("no row of it could be used: it has {}", why.join(", "));
        return Err(InputError::Table { file, problem });
    }
    recording.frames.iter_mut().for_each(|frame| frame.tags.sort_by_key(ExternalDetection::key));
    recording.unit_doubt = check_unit(&file, map, robot, &recording.readings)?;
    Ok(recording)
}

/// First bytes of the texts in UTF-16 that Windows writes.
const UTF16: [u8; 2] = [0xff, 0xfe];

/// Path, format and position of a table's rows.
#[derive(Clone, Copy)]
struct TableFile<'a> {
    path: &'a Path,
    format: Option<TableFormat>,
    /// Keys that lead to the rows in YAML.
    rows_at: &'a [String],
}

/// Reads the columns `wanted` of a table.
fn read_rows(table: TableFile<'_>, wanted: Wanted<'_>) -> Result<Rows, InputError> {
    let file = table.path.display().to_string();
    let format = match table.format.or_else(|| format_by_name(table.path)) {
        Some(format) => format,
        None => return Err(of_unknown_format(table.path)),
    };
    let text = read_table_text(table.path, format)?;
    let found = match format {
        TableFormat::Csv => csv_rows(&file, &text, wanted)?,
        TableFormat::Yaml => yaml_rows(&file, &text, table.rows_at, wanted)?,
    };
    if found.rows.is_empty() {
        return Err(InputError::Table { file, problem: "it has no rows".to_owned() });
    }
    Ok(found)
}

fn read_table_text(path: &Path, format: TableFormat) -> Result<String, InputError> {
    // YAML takes many times its bytes in memory.
    let kind = if format == TableFormat::Csv { FileKind::Table } else { FileKind::Text };
    let problem = |source| InputError::Unreadable { file: path.display().to_string(), source };
    let bytes = read_bytes(path, kind).map_err(problem)?;
    let start = &bytes[..bytes.len().min(FILE_START_BYTES)];
    if start.contains(&0) && !start.starts_with(&UTF16) {
        return Err(problem(Error::new(ErrorKind::InvalidData, describe_file(start))));
    }
    into_text(bytes).map_err(problem)
}

/// Error for a file whose name does not end like a table's.
fn of_unknown_format(path: &Path) -> InputError {
    let file = path.display().to_string();
    let mut start = Vec::new();
    let read = open(path).and_then(|opened| opened.take(FILE_START_BYTES as u64).read_to_end(&mut start));
    if let Err(source) = read {
        return InputError::Unreadable { file, source };
    }
    let problem = if start.starts_with(b"\x89MCAP") || start.starts_with(b"SQLite format 3") {
        "it is a recording, and the input map has a [table]; give a map with topics, which `armcal inspect RECORDING \
         --write-input MAP.toml` proposes"
            .to_owned()
    } else if start.contains(&0) {
        describe_file(&start)
    } else {
        "its name ends in none of .csv, .tsv, .txt, .dat, .yaml, .yml, .json and .jsonl; set `table.format` of the \
         input map to \"csv\" or \"yaml\""
            .to_owned()
    };
    InputError::Table { file, problem }
}

fn format_by_name(path: &Path) -> Option<TableFormat> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "csv" | "tsv" | "txt" | "dat" | "tab" | "asc" => Some(TableFormat::Csv),
        "yaml" | "yml" | "json" | "jsonl" | "ndjson" => Some(TableFormat::Yaml),
        _ => None,
    }
}

/// Merges the rows' corners into tags; a frame holds them first as corners of a board each.
fn join_corners(recording: &mut ExternalRecording) {
    let mut incomplete = 0;
    for frame in &mut recording.frames {
        let mut tags: BTreeMap<Option<u32>, [Option<[f64; 2]>; 4]> = BTreeMap::new();
        for ExternalDetection { id, seen } in std::mem::take(&mut frame.tags) {
            if let RawMeasurement::BoardCorner { number, pixel } = seen {
                tags.entry(id).or_default()[number as usize] = Some(pixel);
            }
        }
        for (id, corners) in tags {
            match corners {
                [Some(a), Some(b), Some(c), Some(d)] => {
                    frame.tags.push(ExternalDetection { id, seen: RawMeasurement::Corners([a, b, c, d]) });
                }
                _ => incomplete += 1,
            }
        }
    }
    recording.frames.retain(|frame| !frame.tags.is_empty());
    if incomplete > 0 {
        recording.left_out.insert("tags with fewer than four corners at a pose".to_owned(), incomplete);
    }
}

/// Rows that say nothing new.
const COPIES: &str = "rows that are exact copies of one before";
/// Reason for which a row is left out.
const NOT_A_NUMBER: &str = "rows without a finite number in each column";

#[cfg(test)]
mod tests;

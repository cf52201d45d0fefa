//! Rows of numbers from the text of a CSV or YAML file.

use std::collections::BTreeSet;
use std::path::Path;

use super::yaml::yaml_rows;
use crate::files::{FileKind, read_text};
use crate::input::error::{BadPlace, InputError};
use crate::input::map::{TableFormat, TableLayout};

/// Poses at rest: eleven days of one every ten seconds.
pub(super) const MAX_ROWS: usize = 100_000;

/// The wanted values of one row.
pub(super) struct Row {
    /// From 1, in the order of the file.
    pub number: u64,
    /// In the order of the wanted columns; `None` where the row has no such value.
    pub values: Vec<Option<f64>>,
}

/// All rows of a table.
pub(super) struct Rows {
    pub rows: Vec<Row>,
    /// Names of the columns.
    pub columns: BTreeSet<String>,
}

/// Reads the columns `wanted` of a table.
pub(super) fn read_rows(path: &Path, layout: &TableLayout, wanted: &[String]) -> Result<Rows, InputError> {
    let file = path.display().to_string();
    let format = match layout.format {
        Some(format) => format,
        None => format_by_name(path).ok_or_else(|| InputError::Table {
            file: file.clone(),
            problem: "its name ends in neither .csv, .tsv, .txt nor .yaml, .yml, .json; set `table.format` of the \
                      input map to \"csv\" or \"yaml\""
                .to_owned(),
        })?,
    };
    // YAML takes many times its bytes in memory.
    let kind = if format == TableFormat::Csv { FileKind::Table } else { FileKind::Text };
    let text = read_text(path, kind).map_err(|source| InputError::Unreadable { file: file.clone(), source })?;
    let found = match format {
        TableFormat::Csv => csv_rows(&file, &text, wanted)?,
        TableFormat::Yaml => yaml_rows(&file, &text, layout, wanted)?,
    };
    if found.rows.is_empty() {
        return Err(InputError::Table { file, problem: "it has no rows".to_owned() });
    }
    Ok(found)
}

fn format_by_name(path: &Path) -> Option<TableFormat> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "csv" | "tsv" | "txt" => Some(TableFormat::Csv),
        "yaml" | "yml" | "json" => Some(TableFormat::Yaml),
        _ => None,
    }
}

/// The error for a table of more than [`MAX_ROWS`].
pub(super) fn check_count(file: &str, n: usize) -> Result<(), InputError> {
    if n <= MAX_ROWS {
        return Ok(());
    }
    let problem = format!("it has more than {MAX_ROWS} rows; cut it into pieces, and give them all");
    Err(InputError::Table { file: file.to_owned(), problem })
}

/// The number that a cell holds; `None` for an empty one.
pub(super) fn number(file: &str, row: u64, (column, cell): (&str, &str)) -> Result<Option<f64>, InputError> {
    let cell = cell.trim();
    if cell.is_empty() {
        return Ok(None);
    }
    cell.parse().map(Some).map_err(|_| InputError::Row {
        file: file.to_owned(),
        place: BadPlace::Row(row),
        problem: format!("`{column}` is {cell:?}, not a number"),
    })
}

fn csv_rows(file: &str, text: &str, wanted: &[String]) -> Result<Rows, InputError> {
    let text = text.trim_start_matches('\u{feff}');
    let header = text.lines().find(|line| !line.is_empty() && !line.starts_with('#')).unwrap_or_default();
    let delimiter = [b'\t', b';'].into_iter().find(|mark| header.as_bytes().contains(mark)).unwrap_or(b',');
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let bad = |error: csv::Error| InputError::Table { file: file.to_owned(), problem: format!("is no CSV: {error}") };
    let header = reader.headers().map_err(bad)?.clone();
    let mut at = Vec::new();
    for name in wanted {
        let mut places = header.iter().enumerate().filter(|(_, column)| column == name).map(|(k, _)| k);
        at.push(places.next());
        if places.next().is_some() {
            let problem = format!("it has the column `{name}` twice");
            return Err(InputError::Table { file: file.to_owned(), problem });
        }
    }
    let mut rows = Vec::new();
    for (record, row) in reader.records().zip(1..) {
        let record = record.map_err(bad)?;
        let value = |(at, name): (&Option<usize>, &String)| {
            let cell = at.and_then(|k| record.get(k)).unwrap_or_default();
            number(file, row, (name, cell))
        };
        let values = at.iter().zip(wanted).map(value).collect::<Result<_, _>>()?;
        rows.push(Row { number: row, values });
        check_count(file, rows.len())?;
    }
    Ok(Rows { rows, columns: header.iter().map(str::to_owned).collect() })
}

//! Rows from CSV.

use super::columns_seen::ColumnsSeen;
use super::rows::{MAX_COLUMNS, Row, Rows, check_count, number};
use crate::input::error::InputError;

/// A reader of a text whose lines have few columns: it keeps the places of all cells of a row.
fn csv_reader<'a>(file: &str, text: &'a str) -> Result<csv::Reader<&'a [u8]>, InputError> {
    let text = text.trim_start_matches('\u{feff}');
    let header = text.lines().find(|line| !line.is_empty() && !line.starts_with('#')).unwrap_or_default();
    let delimiter = [b'\t', b';'].into_iter().find(|mark| header.as_bytes().contains(mark)).unwrap_or(b',');
    let has_many = |line: &[u8]| line.iter().filter(|byte| **byte == delimiter).count() >= MAX_COLUMNS;
    if let Some(at) = text.as_bytes().split(|byte| matches!(byte, b'\n' | b'\r')).position(has_many) {
        let problem = format!("line {} has more than {MAX_COLUMNS} columns; leave out those that no map names", at + 1);
        return Err(InputError::Table { file: file.to_owned(), problem });
    }
    let mut builder = csv::ReaderBuilder::new();
    Ok(builder.delimiter(delimiter).comment(Some(b'#')).trim(csv::Trim::All).from_reader(text.as_bytes()))
}

/// Looks at all cells, row by row.
pub(super) fn csv_columns(file: &str, text: &str) -> Result<ColumnsSeen, InputError> {
    let mut reader = csv_reader(file, text)?;
    let bad = |error: csv::Error| InputError::Table { file: file.to_owned(), problem: format!("is no CSV: {error}") };
    let mut seen = ColumnsSeen::of_names(reader.headers().map_err(bad)?);
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(bad)? {
        seen.add_row(record.iter());
        check_count(file, seen.n_rows)?;
    }
    Ok(seen)
}

/// Reads the columns `wanted`; the first line that is no comment names them all.
pub(super) fn csv_rows(file: &str, text: &str, wanted: &[String]) -> Result<Rows, InputError> {
    let mut reader = csv_reader(file, text)?;
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

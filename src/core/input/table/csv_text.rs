//! Rows from CSV.

use super::rows::{Cells, Row, Rows, check_count, number};
use crate::input::error::InputError;

fn csv_reader(text: &str) -> csv::Reader<&[u8]> {
    let text = text.trim_start_matches('\u{feff}');
    let header = text.lines().find(|line| !line.is_empty() && !line.starts_with('#')).unwrap_or_default();
    let delimiter = [b'\t', b';'].into_iter().find(|mark| header.as_bytes().contains(mark)).unwrap_or(b',');
    csv::ReaderBuilder::new().delimiter(delimiter).comment(Some(b'#')).trim(csv::Trim::All).from_reader(text.as_bytes())
}

/// Reads all cells.
pub(super) fn csv_cells(file: &str, text: &str) -> Result<Cells, InputError> {
    let mut reader = csv_reader(text);
    let bad = |error: csv::Error| InputError::Table { file: file.to_owned(), problem: format!("is no CSV: {error}") };
    let names = reader.headers().map_err(bad)?.iter().map(str::to_owned).collect();
    let mut cells = Cells { names, ..Cells::default() };
    for record in reader.records() {
        cells.rows.push(record.map_err(bad)?.iter().map(str::to_owned).collect());
        check_count(file, cells.rows.len())?;
    }
    Ok(cells)
}

/// Reads the columns `wanted`; the first line that is no comment names them all.
pub(super) fn csv_rows(file: &str, text: &str, wanted: &[String]) -> Result<Rows, InputError> {
    let mut reader = csv_reader(text);
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

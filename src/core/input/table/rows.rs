//! Rows of numbers, as CSV and YAML files have them.

use std::collections::BTreeSet;

use crate::input::error::{BadPlace, InputError};

/// Poses at rest: eleven days of one every ten seconds.
pub(super) const MAX_ROWS: usize = 100_000;
/// Columns of a table; those of poses and joints are some tens.
pub(super) const MAX_COLUMNS: usize = 1000;

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

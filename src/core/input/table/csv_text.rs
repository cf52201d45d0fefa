//! Rows from CSV, as programs write it.

use std::borrow::Cow;

use super::columns_seen::ColumnsSeen;
use super::rows::{MAX_COLUMNS, Rows, Wanted, check_count, is_missing, is_value};
use crate::input::error::InputError;

/// Marks of comment lines.
const COMMENTS: [&str; 3] = ["#", "%", "//"];
/// Number of first lines that show the table's format.
const N_LOOKED_AT: usize = 30;
/// Delimiter that replaces spaces between cells.
const TAB: char = '\t';

/// A CSV's line of names and its rows.
struct CsvTable {
    /// Rows without comments and repeated lines of names.
    rows: String,
    delimiter: char,
    header: Vec<String>,
}

fn bad<T>(file: &str, problem: String) -> Result<T, InputError> {
    Err(InputError::Table { file: file.to_owned(), problem })
}

/// Returns the text after the mark of a comment.
fn comment_of(line: &str) -> Option<&str> {
    COMMENTS.iter().find_map(|mark| line.trim_start().strip_prefix(mark))
}

impl CsvTable {
    /// Finds the line of names: the first line with as many cells as the rows; a comment, if the rows begin at once.
    fn new(file: &str, text: &str) -> Result<Self, InputError> {
        let text = text.trim_start_matches('\u{feff}');
        let text = if text.contains('\n') { Cow::Borrowed(text) } else { Cow::Owned(text.replace('\r', "\n")) };
        let is_used = |line: &&str| !line.trim().is_empty() && !line.starts_with("sep=");
        let mut lines = text.lines().filter(is_used).filter(|line| comment_of(line).is_none());
        let first: Vec<&str> = lines.clone().take(N_LOOKED_AT).collect();
        let delimiter = delimiter_of(&first);
        let is_of_many = |line: &str| match is_spaced(line, delimiter) {
            true => line.split_whitespace().nth(MAX_COLUMNS).is_some(),
            false => line.matches(delimiter).nth(MAX_COLUMNS - 1).is_some(),
        };
        if let Some(at) = text.lines().position(is_of_many) {
            let problem =
                format!("line {} has more than {MAX_COLUMNS} columns; leave out those that no map names", at + 1);
            return bad(file, problem);
        }
        let most = first.iter().map(|line| count(line, delimiter)).max().unwrap_or_default();
        let n_before = first.iter().position(|line| 2 * count(line, delimiter) > most).unwrap_or_default();
        let Some(mut names) = lines.nth(n_before) else { return bad(file, "it has no lines".to_owned()) };
        let mut rows = String::with_capacity(text.len());
        if cells(names, delimiter).iter().all(|cell| is_value(&plain(cell, delimiter))) {
            let before = text.lines().filter(is_used).take_while(|line| *line != names);
            let comment = before.last().and_then(comment_of).filter(|comment| count(comment, delimiter) == most);
            let Some(comment) = comment else {
                let problem = "its first line has only numbers or dates, so that no column has a name; write a line \
                               with the columns' names above it";
                return bad(file, problem.to_owned());
            };
            rows.push_str(&separated(names, delimiter));
            rows.push('\n');
            names = comment;
        }
        for line in lines.filter(|line| *line != names) {
            rows.push_str(&separated(line, delimiter));
            rows.push('\n');
        }
        let header = cells(names, delimiter);
        Ok(Self { rows, delimiter, header })
    }

    /// Hands the cells of each row to `take`, with its number from 1. A first row without any number has units.
    fn for_each_row(
        &self,
        file: &str,
        mut take: impl FnMut(u64, &[Cow<'_, str>]) -> Result<(), InputError>,
    ) -> Result<(), InputError> {
        let mut reader = reader(&self.rows, self.delimiter);
        let n_named = self.header.iter().rposition(|name| !name.is_empty()).map_or(0, |last| last + 1);
        let mut record = csv::StringRecord::new();
        let mut number = 0;
        while reader.read_record(&mut record).map_err(|error| no_csv(file, &error))? {
            let cells: Vec<Cow<'_, str>> = record.iter().map(|cell| plain(cell, self.delimiter)).collect();
            if number == 0 && !cells.iter().any(|cell| is_value(cell)) && self.is_of_units(&cells) {
                continue;
            }
            number += 1;
            check_count(file, number as usize)?;
            let n = self.header.len();
            if cells.len() < n_named || cells.iter().skip(n).any(|cell| !cell.is_empty()) {
                let n_cells = cells.len();
                return bad(file, format!("row {number} has {n_cells} cells, and the line of the columns' names {n}"));
            }
            take(number, &cells[..cells.len().min(n)])?;
        }
        Ok(())
    }

    /// Returns true for one cell per named column, of which at least one holds a word.
    fn is_of_units(&self, cells: &[Cow<'_, str>]) -> bool {
        self.header.len() > 1 && cells.len() == self.header.len() && cells.iter().any(|cell| !is_missing(cell))
    }
}

fn no_csv(file: &str, error: &csv::Error) -> InputError {
    InputError::Table { file: file.to_owned(), problem: format!("is no CSV: {error}") }
}

fn reader(text: &str, delimiter: char) -> csv::Reader<&[u8]> {
    let mut builder = csv::ReaderBuilder::new();
    builder.delimiter(delimiter as u8).trim(csv::Trim::All).has_headers(false).flexible(true);
    builder.from_reader(text.as_bytes())
}

/// Returns the delimiter that most of the lines have; a tab if spaces separate.
fn delimiter_of(lines: &[&str]) -> char {
    let n_with = |mark: &char| lines.iter().filter(|line| line.contains(*mark)).count();
    let [semicolon, comma] = [';', ','].map(|mark| n_with(&mark));
    let tab = n_with(&TAB);
    let n_words = |line: &&&str| line.split_whitespace().count();
    let are_words = lines.iter().take(2).map(|line| n_words(&line)).collect::<Vec<_>>();
    if tab > 0 && tab >= semicolon.max(comma) {
        TAB
    } else if semicolon > 0 && semicolon >= comma {
        ';'
    } else if comma == 0 && matches!(are_words[..], [a, b] if a == b && a > 1) {
        TAB
    } else {
        ','
    }
}

/// Returns the line with a tab for each run of spaces, if spaces separate its cells.
fn separated(line: &str, delimiter: char) -> Cow<'_, str> {
    if is_spaced(line, delimiter) {
        return line.split_whitespace().collect::<Vec<_>>().join("\t").into();
    }
    line.into()
}

fn is_spaced(line: &str, delimiter: char) -> bool {
    delimiter == TAB && !line.contains(TAB)
}

fn count(line: &str, delimiter: char) -> usize {
    separated(line, delimiter).matches(delimiter).count() + 1
}

/// The cells of one line.
fn cells(line: &str, delimiter: char) -> Vec<String> {
    let line = separated(line, delimiter);
    let record = reader(&line, delimiter).into_records().next().and_then(Result::ok).unwrap_or_default();
    record.iter().map(str::to_owned).collect()
}

/// Returns the cell with a point for the decimal comma, unless the comma is the delimiter.
fn plain(cell: &str, delimiter: char) -> Cow<'_, str> {
    let cell = cell.trim();
    let is_decimal = delimiter != ',' && !cell.contains('.') && cell.matches(',').count() == 1;
    let number = is_decimal.then(|| cell.replace(',', ".")).filter(|number| number.parse::<f64>().is_ok());
    number.map_or(Cow::Borrowed(cell), Cow::Owned)
}

/// Looks at all cells, row by row.
pub(super) fn csv_columns(file: &str, text: &str) -> Result<ColumnsSeen, InputError> {
    let table = CsvTable::new(file, text)?;
    let mut seen = ColumnsSeen::of_names(table.header.iter().map(String::as_str));
    table.for_each_row(file, |_, cells| {
        seen.add_row(cells.iter().map(AsRef::as_ref));
        Ok(())
    })?;
    Ok(seen)
}

/// Reads the columns `wanted`.
pub(super) fn csv_rows(file: &str, text: &str, wanted: Wanted<'_>) -> Result<Rows, InputError> {
    let table = CsvTable::new(file, text)?;
    let place = |name: &String| table.header.iter().position(|column| column == name);
    if let Some(name) = wanted
        .names
        .iter()
        .chain(wanted.key)
        .find(|name| table.header.iter().filter(|column| column == name).count() > 1)
    {
        return bad(file, format!("it has the column `{name}` twice"));
    }
    let places: std::collections::BTreeMap<&String, usize> =
        wanted.names.iter().chain(wanted.key).filter_map(|name| Some((name, place(name)?))).collect();
    let mut rows = Vec::new();
    table.for_each_row(file, |number, cells| {
        let cell = |name: &String| places.get(name).and_then(|at| cells.get(*at)).map(AsRef::as_ref);
        rows.push(wanted.row((file, number), cell)?);
        Ok(())
    })?;
    Ok(Rows { rows, columns: table.header.into_iter().collect() })
}

//! Rows of numbers, as CSV and YAML files have them.

use std::collections::BTreeSet;

use crate::input::error::{BadPlace, InputError};
use crate::input::map::TimeUnit;
use crate::time::{Stamp, stamp_of_date};

/// Maximum number of poses at rest: eleven days of one every ten seconds.
pub const MAX_ROWS: usize = 100_000;
/// Maximum number of columns of a table; those of poses and joints are a few dozen.
pub(super) const MAX_COLUMNS: usize = 1000;

/// Columns that are read.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    /// Columns of numbers.
    pub names: &'a [String],
    /// Index of the column of times, which may be dates, and their unit.
    pub time: Option<(usize, TimeUnit)>,
    /// Index of the column of the tags' ids, which may follow a name.
    pub id: Option<usize>,
    /// A column of texts.
    pub key: Option<&'a String>,
}

/// The wanted values of one row.
pub(super) struct Row {
    /// Number of the row from 1, in the order of the file.
    pub number: u64,
    /// Values in the order of the wanted columns; `None` if the row has no such value. A date is seconds since 1970.
    pub values: Vec<Option<f64>>,
    /// Time to the nanosecond, if it is a date.
    pub date: Option<Stamp>,
    /// The text in the key's column, as it is compared; empty without one.
    pub key: String,
}

/// All rows of a table.
pub(super) struct Rows {
    pub rows: Vec<Row>,
    /// Names of the columns.
    pub columns: BTreeSet<String>,
}

impl Rows {
    /// Number of the other table's rows whose key a row of this one has, as `text` makes it.
    pub fn n_joined(&self, other: &Self, text: impl Fn(&str) -> String) -> usize {
        let keys: BTreeSet<String> = self.rows.iter().map(|row| text(&row.key)).filter(|key| !key.is_empty()).collect();
        other.rows.iter().filter(|row| keys.contains(&text(&row.key))).count()
    }

    /// Takes folders and endings from the keys.
    pub fn make_keys_plain(&mut self) {
        self.rows.iter_mut().for_each(|row| row.key = plain_key(&row.key));
    }
}

impl Wanted<'_> {
    /// Reads a row; `cell` returns the cell of a column.
    pub fn row<'c>(
        &self,
        (file, number): (&str, u64),
        cell: impl Fn(&String) -> Option<&'c str>,
    ) -> Result<Row, InputError> {
        let mut date = None;
        let value = |(k, name): (usize, &String)| {
            let text = cell(name).unwrap_or_default().trim();
            let found = if is_missing(text) {
                Some(None)
            } else if self.time == Some((k, TimeUnit::Iso8601)) {
                date = stamp_of_date(text);
                date.map(|date| Some(date.since_s(Stamp::default())))
            } else {
                let of_tag = || (self.id == Some(k)).then(|| tag_number(text).map(f64::from))?;
                text.parse().ok().or_else(of_tag).map(Some)
            };
            found.ok_or_else(|| {
                let problem = format!("`{name}` is {text:?}, {}", self.no_value(k, text));
                InputError::Row { file: file.to_owned(), place: BadPlace::Row(number), problem }
            })
        };
        let values = self.names.iter().enumerate().map(value).collect::<Result<_, _>>()?;
        let key = self.key.and_then(cell).map(whole_key).unwrap_or_default();
        Ok(Row { number, values, date, key })
    }

    /// Text of an error: the required content of the cell of column `k`, and the remedy.
    fn no_value(&self, k: usize, cell: &str) -> String {
        let correct = "correct it, or empty the cell and set not_finite = \"leave_out\" in the input map";
        let unit = self.time.filter(|(at, _)| *at == k).map(|(_, unit)| unit);
        match unit {
            Some(TimeUnit::Iso8601) if cell.parse::<f64>().is_ok() => {
                "not a date; set the unit of this column of times in the input map to \"s\", \"ms\", \"us\" or \"ns\""
                    .to_owned()
            }
            Some(TimeUnit::Iso8601) => {
                format!("not a date and time from 1970 to 2262 such as 2026-03-01T12:00:00.250Z (ISO 8601); {correct}")
            }
            Some(_) if stamp_of_date(cell).is_some() => {
                "not a number; set unit = \"iso8601\" for this column of times in the input map".to_owned()
            }
            _ if cell.starts_with(['[', '(', '{']) => "not a number; give each number of a list its column".to_owned(),
            _ => format!("not a number; {correct}"),
        }
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

/// Returns true for an empty cell, or one of the words that programs write for no value.
pub(super) fn is_missing(cell: &str) -> bool {
    ["", "-", "na", "n/a", "null", "none"].iter().any(|word| cell.eq_ignore_ascii_case(word))
}

/// Returns true for a number or a date.
pub(super) fn is_value(cell: &str) -> bool {
    cell.parse::<f64>().is_ok() || stamp_of_date(cell).is_some()
}

/// Returns the tag's id of a cell such as `tag36h11:3`, `tag_3` or `id 3`: the digits after a name.
#[must_use]
pub fn tag_number(cell: &str) -> Option<u32> {
    let name = cell.trim_end_matches(|c: char| c.is_ascii_digit());
    // The digits of `tag36h11` belong to a family.
    let is_apart = name.ends_with([':', '_', '-', ' ', '/', '#', '.']) || !name.contains(|c: char| c.is_ascii_digit());
    cell[name.len()..].parse().ok().filter(|_| is_apart && name.starts_with(|c: char| c.is_alphabetic() || c == '/'))
}

/// Endings of images' names.
const IMAGES: [&str; 9] = [".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp"];

/// Returns the text by which rows of two tables are compared first; a number as such.
#[must_use]
pub fn whole_key(cell: &str) -> String {
    let cell = cell.trim();
    let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
    number.map_or_else(|| cell.to_owned(), |number| number.to_string())
}

/// Returns the text by which rows are compared if no whole texts agree: an image without its folder and extension.
#[must_use]
pub fn plain_key(cell: &str) -> String {
    let cell = &whole_key(cell)[..];
    if cell.parse::<f64>().is_ok() {
        return cell.to_owned();
    }
    let name = cell.rsplit(['/', '\\']).next().unwrap_or(cell);
    let lower = name.to_ascii_lowercase();
    let ending = IMAGES.iter().find(|ending| lower.ends_with(*ending)).map_or(0, |ending| ending.len());
    name[..name.len() - ending].to_owned()
}

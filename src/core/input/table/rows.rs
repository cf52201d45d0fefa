//! Rows of numbers, as CSV and YAML files have them.

use std::collections::BTreeSet;

use crate::input::error::{BadPlace, InputError};

/// Poses at rest: eleven days of one every ten seconds.
pub const MAX_ROWS: usize = 100_000;
/// Columns of a table; those of poses and joints are some tens.
pub(super) const MAX_COLUMNS: usize = 1000;

/// Columns that are read.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    /// Columns of numbers.
    pub names: &'a [String],
    /// Which of them has the tags' numbers, which may stand behind a name.
    pub id: Option<usize>,
    /// A column of texts.
    pub key: Option<&'a String>,
}

/// The wanted values of one row.
pub(super) struct Row {
    /// From 1, in the order of the file.
    pub number: u64,
    /// In the order of the wanted columns; `None` where the row has no such value.
    pub values: Vec<Option<f64>>,
    /// The text in the key's column; empty without one.
    pub key: String,
}

/// All rows of a table.
pub(super) struct Rows {
    pub rows: Vec<Row>,
    /// Names of the columns.
    pub columns: BTreeSet<String>,
}

impl Wanted<'_> {
    /// The row with the cells that `cell` has for a column.
    pub fn row<'c>(
        &self,
        (file, number): (&str, u64),
        cell: impl Fn(&String) -> Option<&'c str>,
    ) -> Result<Row, InputError> {
        let value = |(k, name): (usize, &String)| {
            let text = cell(name).unwrap_or_default().trim();
            let found = if is_missing(text) { Some(None) } else { text.parse().ok().map(Some) };
            let found =
                found.or_else(|| (self.id == Some(k)).then(|| tag_number(text).map(|id| Some(f64::from(id))))?);
            found.ok_or_else(|| {
                let remedy = match text.starts_with(['[', '(', '{']) {
                    true => "give each number of a list its column",
                    false => "correct it, or empty the cell and set not_finite = \"leave_out\" in the input map",
                };
                let problem = format!("`{name}` is {text:?}, not a number; {remedy}");
                InputError::Row { file: file.to_owned(), place: BadPlace::Row(number), problem }
            })
        };
        let values = self.names.iter().enumerate().map(value).collect::<Result<_, _>>()?;
        let key = self.key.and_then(cell).map(plain_key).unwrap_or_default();
        Ok(Row { number, values, key })
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

/// An empty cell, or one of the words that programs write for none.
pub(super) fn is_missing(cell: &str) -> bool {
    ["", "-", "na", "n/a", "null", "none"].iter().any(|word| cell.eq_ignore_ascii_case(word))
}

/// The tag's number of a cell such as `tag36h11:3`, `tag_3` or `id 3`: the digits behind a name.
#[must_use]
pub fn tag_number(cell: &str) -> Option<u32> {
    let name = cell.trim_end_matches(|c: char| c.is_ascii_digit());
    // The digits of `tag36h11` are those of a family.
    let is_apart = name.ends_with([':', '_', '-', ' ', '/', '#', '.']) || !name.contains(|c: char| c.is_ascii_digit());
    cell[name.len()..].parse().ok().filter(|_| is_apart && name.starts_with(|c: char| c.is_alphabetic() || c == '/'))
}

/// Endings of images' names.
const IMAGES: [&str; 9] = [".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp"];

/// The text by which rows of two tables are compared: a number as such, an image without its folder and ending.
#[must_use]
pub fn plain_key(cell: &str) -> String {
    let cell = cell.trim();
    if let Some(number) = cell.parse::<f64>().ok().filter(|number| number.is_finite()) {
        return number.to_string();
    }
    let name = cell.rsplit(['/', '\\']).next().unwrap_or(cell);
    let lower = name.to_ascii_lowercase();
    let ending = IMAGES.iter().find(|ending| lower.ends_with(*ending)).map_or(0, |ending| ending.len());
    name[..name.len() - ending].to_owned()
}

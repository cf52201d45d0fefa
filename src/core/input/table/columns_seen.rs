//! Contents of each column, added row by row; the cells of the first rows are kept.

use super::rows::is_missing;
use crate::time::{Stamp, stamp_of_date};

/// A column and a summary of its cells.
#[derive(Clone, Debug, PartialEq)]
pub struct TableColumn {
    /// Name as the input map writes it.
    pub name: String,
    /// Cells with a finite number.
    pub n_numbers: usize,
    /// Cells with a date and time of ISO 8601, in a column whose first value is a date; zero in columns of numbers.
    pub n_dates: usize,
    /// Cells that are empty or hold a word for no value.
    pub n_empty: usize,
    /// Cells with anything else.
    pub n_others: usize,
    /// First cell with anything else.
    pub first_other: Option<String>,
    /// Lowest and highest number; `None` without one. A date counts as its seconds since 1970.
    pub range: Option<[f64; 2]>,
    /// True if all numbers are integers.
    pub is_whole: bool,
    /// Numbers that differ from the previous one.
    pub n_steps: usize,
    /// True if no number is smaller than the previous one.
    pub is_rising: bool,
}

/// Columns as far as their rows were examined.
pub(super) struct ColumnsSeen {
    pub columns: Vec<TableColumn>,
    /// Last number of each column.
    last: Vec<f64>,
    pub n_rows: usize,
    /// The cells of the first rows.
    pub first_rows: Vec<Vec<String>>,
}

/// Number of rows whose cells are kept.
const N_KEPT: usize = 200;
/// Number of characters of a cell that are kept.
const MAX_CELL: usize = 80;

impl ColumnsSeen {
    pub fn of_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Self {
        let empty = |name: &str| TableColumn {
            name: name.to_owned(),
            n_numbers: 0,
            n_dates: 0,
            n_empty: 0,
            n_others: 0,
            first_other: None,
            range: None,
            n_steps: 0,
            is_whole: true,
            is_rising: true,
        };
        let columns: Vec<TableColumn> = names.into_iter().map(empty).collect();
        Self { last: vec![f64::NEG_INFINITY; columns.len()], columns, n_rows: 0, first_rows: Vec::new() }
    }

    /// Adds the cells of a row, in the order of the columns.
    pub fn add_row<'a>(&mut self, cells: impl IntoIterator<Item = &'a str>) {
        self.n_rows += 1;
        let mut kept = (self.n_rows <= N_KEPT).then(Vec::new);
        for ((column, last), cell) in self.columns.iter_mut().zip(&mut self.last).zip(cells) {
            column.add(cell.trim(), last);
            if let Some(kept) = &mut kept {
                kept.push(cell.trim().chars().take(MAX_CELL).collect());
            }
        }
        self.first_rows.extend(kept);
    }
}

impl TableColumn {
    fn add(&mut self, cell: &str, last: &mut f64) {
        let number = cell.parse::<f64>().ok().filter(|value| value.is_finite() && self.n_dates == 0);
        let date = if self.n_numbers == 0 && number.is_none() { stamp_of_date(cell) } else { None };
        match number.or(date.map(|date| date.since_s(Stamp::default()))) {
            Some(value) => {
                self.n_numbers += usize::from(number.is_some());
                self.n_dates += usize::from(date.is_some());
                let [low, high] = self.range.unwrap_or([value; 2]);
                self.range = Some([low.min(value), high.max(value)]);
                self.is_whole &= value.fract() == 0.0;
                self.n_steps += usize::from(value != *last);
                self.is_rising &= value >= *last;
                *last = value;
            }
            None if is_missing(cell) => self.n_empty += 1,
            None => {
                self.n_others += 1;
                self.first_other.get_or_insert_with(|| cell.chars().take(40).collect());
            }
        }
    }

    /// Number of cells with a value of the column's kind: numbers or dates.
    #[must_use]
    pub fn n_values(&self) -> usize {
        self.n_numbers + self.n_dates
    }
}

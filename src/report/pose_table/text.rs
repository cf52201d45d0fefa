//! A table as plain lines, and as data.

use std::path::Path;

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use serde::Serialize;

use super::roles::{Roles, is_of_tags};
use armcal_core::input::{TableColumn, TableContents, TableFormat};
use armcal_core::robot::Robot;
use armcal_core::text::printable;
use armcal_core::time::utc;

/// One column in the output of `inspect --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColumnInspection {
    name: String,
    numbers: usize,
    /// Number of dates; their range is in seconds since 1970.
    #[serde(skip_serializing_if = "is_zero")]
    dates: usize,
    empty: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    range: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "str::is_empty")]
    may_be: &'static str,
    /// The first cell that is neither number nor date.
    #[serde(skip_serializing_if = "Option::is_none")]
    other: Option<String>,
}

/// Columns of a table, and the data that an input map would still need.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TableInspection {
    version: u32,
    table: String,
    format: &'static str,
    rows_at: String,
    rows: usize,
    columns: Vec<ColumnInspection>,
    joints: Vec<String>,
    missing: Vec<String>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
fn is_zero(n: &usize) -> bool {
    *n == 0
}

/// Largest number of columns that are printed.
const MOST_COLUMNS: usize = 60;

/// Inspects a table.
#[must_use]
pub fn inspect_table(path: &Path, table: &TableContents, robot: Option<&Robot>) -> TableInspection {
    let roles = Roles::of(table, robot);
    let column = |column: &TableColumn| ColumnInspection {
        name: column.name.clone(),
        numbers: column.n_numbers,
        dates: column.n_dates,
        empty: column.n_empty,
        range: column.range,
        may_be: roles.of_column(&column.name),
        other: column.first_other.clone(),
    };
    TableInspection {
        version: 1,
        table: path.display().to_string(),
        format: if table.format == TableFormat::Csv { "CSV" } else { "YAML or JSON" },
        rows_at: table.rows_at.join("."),
        rows: table.n_rows,
        columns: table.columns.iter().map(column).collect(),
        joints: roles.joints.iter().map(|(joint, _)| joint.clone()).collect(),
        missing: missing(table, &roles),
    }
}

/// Reasons that `calibrate` cannot read the table.
fn missing(table: &TableContents, roles: &Roles) -> Vec<String> {
    let mut missing: Vec<String> = [missing_joints(roles), missing_seen(roles)].into_iter().flatten().collect();
    for column in gaps(table, roles) {
        let n = column.n_empty + column.n_others;
        let other = column.first_other.as_ref().map_or(String::new(), |other| format!("; the first is {other:?}"));
        missing.push(format!("numbers in {n} of {} rows of the column `{}`{other}", table.n_rows, column.name));
    }
    missing
}

/// A value of a column in the form of its cells: a number, or a date where the column holds dates (`n_dates` above
/// zero).
pub(super) fn cell_of(n_dates: usize, value: f64) -> String {
    if n_dates > 0 { utc((1e3 * value).round() as u64 * 1_000_000) } else { value.to_string() }
}

/// Columns of joints that a map would still need.
pub(super) fn missing_joints(roles: &Roles) -> Option<String> {
    match (roles.missing_joints.is_empty(), roles.joints.is_empty()) {
        (false, _) => Some(format!("columns of the robot's joints {:?}", roles.missing_joints)),
        (true, true) => Some("columns of joint readings (--robot DIR matches their names)".to_owned()),
        (true, false) => None,
    }
}

/// Columns of the camera's measurements that a map would still need.
pub(super) fn missing_seen(roles: &Roles) -> Option<String> {
    if roles.are_tags_side_by_side {
        return Some("one row for each tag with a column of its number: the tags stand side by side".to_owned());
    }
    let missing = match (&roles.position, &roles.pixel, &roles.corners) {
        (None, None, None) => {
            "columns of what the camera saw: x, y, z of a tag or board, a corner's id and u, v, or a tag's id and u, v \
             of its corners"
        }
        (None, _, Some(_)) if roles.id.is_none() => "a column of the tag's number",
        (None, Some(_), _) if roles.id.is_none() => "a column of the corner's number",
        _ => return None,
    };
    Some(missing.to_owned())
}

/// Columns with a role in which some rows lack a number.
pub(super) fn gaps<'a>(table: &'a TableContents, roles: &Roles) -> Vec<&'a TableColumn> {
    let has_gaps = |column: &&TableColumn| {
        column.n_empty + column.n_others > 0 && !roles.of_column(&column.name).is_empty() && !is_of_tags(column)
    };
    table.columns.iter().filter(has_gaps).collect()
}

impl TableInspection {
    /// Plain lines for a terminal.
    #[must_use]
    pub fn to_text(&self) -> String {
        let at = if self.rows_at.is_empty() { String::new() } else { format!(", rows at `{}`", self.rows_at) };
        let mut lines = vec![
            format!("table        {}", self.table),
            format!("format       {}{at}: {} rows, {} columns", self.format, self.rows, self.columns.len()),
            String::new(),
        ];
        lines.extend(self.column_table());
        lines.push(String::new());
        let joints = if self.joints.is_empty() { "none".to_owned() } else { self.joints.join(", ") };
        lines.push(format!("joints       {joints}"));
        lines.extend(self.times());
        lines.extend(self.missing.iter().map(|what| format!("missing      {what}")));
        if self.missing.is_empty() {
            lines.push("note         --write-input MAP.toml proposes an input map for it".to_owned());
        }
        lines.iter().map(|line| printable(line)).collect::<Vec<_>>().join("\n")
    }

    fn times(&self) -> Option<String> {
        let Some(column) = self.columns.iter().find(|column| column.may_be == "time") else {
            return Some("time         no column; rows count as 1 s apart".to_owned());
        };
        let [first, last] = column.range?;
        let [first, last] = [first, last].map(|value| cell_of(column.dates, value));
        Some(format!("time         column `{}`: {first} to {last}", column.name))
    }

    fn column_table(&self) -> Vec<String> {
        let mut table = Table::new();
        table.load_preset(NOTHING);
        table.set_header(["column", "numbers", "missing", "smallest", "largest", "may be"]);
        let bound = |column: &ColumnInspection, at: usize| match column.range {
            None => "-".to_owned(),
            Some(range) if column.dates > 0 => cell_of(column.dates, range[at]),
            Some(range) => format!("{:.6}", range[at]),
        };
        for column in self.columns.iter().take(MOST_COLUMNS) {
            table.add_row([
                column.name.clone(),
                column.numbers.to_string(),
                (self.rows - (column.numbers + column.dates).min(self.rows)).to_string(),
                bound(column, 0),
                bound(column, 1),
                column.may_be.to_owned(),
            ]);
        }
        for column in table.column_iter_mut().skip(1).take(4) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        let mut lines: Vec<String> = table.to_string().lines().map(|line| line.trim_end().to_owned()).collect();
        if self.columns.len() > MOST_COLUMNS {
            lines.push(format!("             {} further columns: --json has them", self.columns.len() - MOST_COLUMNS));
        }
        lines
    }
}

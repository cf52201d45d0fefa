//! The contents of any table: columns, ranges and gaps, before an input map says what they are.

use std::collections::BTreeMap;
use std::path::Path;

use super::columns_seen::{ColumnsSeen, TableColumn};
use super::csv_text::csv_columns;
use super::yaml::{YamlColumns, yaml_columns};
use super::{format_by_name, read_table_text};
use crate::input::error::InputError;
use crate::input::map::TableFormat;

/// Columns and rows of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableContents {
    /// Format of the file: CSV, or YAML including JSON.
    pub format: TableFormat,
    /// Keys that lead to the rows in YAML.
    pub rows_at: Vec<String>,
    /// Number of rows.
    pub n_rows: usize,
    /// Columns in the order of the file.
    pub columns: Vec<TableColumn>,
    /// Names that another list of the file gives to numbered columns.
    pub other_names: BTreeMap<String, String>,
    /// The cells of the first rows, in the order of the columns.
    pub first_rows: Vec<Vec<String>>,
}

impl TableContents {
    /// The cells of the first rows in this column.
    pub fn first_cells<'a>(&'a self, name: &str) -> impl Iterator<Item = &'a str> + use<'a> {
        let at = self.columns.iter().position(|column| column.name == name);
        self.first_rows.iter().filter_map(move |row| row.get(at?).map(String::as_str))
    }
}

/// Examines a table, whose format is that of its name's ending; `None` if the ending is not a table's.
///
/// # Errors
/// [`InputError`] if the file is no table: without rows, columns or numbers.
pub fn read_table_contents(path: &Path) -> Option<Result<TableContents, InputError>> {
    let format = format_by_name(path)?;
    Some(contents(path, format))
}

fn contents(path: &Path, format: TableFormat) -> Result<TableContents, InputError> {
    let file = path.display().to_string();
    let text = read_table_text(path, format)?;
    let (seen, rows_at, other_names) = match format {
        TableFormat::Csv => (csv_columns(&file, &text)?, Vec::new(), BTreeMap::new()),
        TableFormat::Yaml => {
            let YamlColumns { seen, rows_at, other_names } = yaml_columns(&file, &text)?;
            (seen, rows_at, other_names)
        }
    };
    let ColumnsSeen { columns, n_rows, first_rows, .. } = seen;
    if n_rows == 0 || columns.iter().all(|column| column.n_numbers == 0) {
        let problem = format!(
            "it is no table of poses: {} rows, none with a number in its columns {:?}; armcal reads tables (CSV, YAML, \
             JSON) with one row or entry per pose, and recordings (.mcap, .db3)",
            n_rows,
            columns.iter().take(12).map(|column| &column.name).collect::<Vec<_>>()
        );
        return Err(InputError::Table { file, problem });
    }
    Ok(TableContents { format, rows_at, n_rows, columns, other_names, first_rows })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, text: &str) -> Result<TableContents, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let found = read_table_contents(&path).expect("a table's ending");
        found.map_err(|error| error.to_string().replace(&folder.path().display().to_string(), "FOLDER"))
    }

    #[test]
    fn columns_are_counted_with_their_ranges_and_gaps() {
        let found = read("a.csv", "# bench\nt;q1;note\n0;1.5;a\n1;-2;\n2;;b\n3;nan;\n").unwrap();
        assert_eq!((found.n_rows, found.columns.len()), (4, 3));
        let q1 = &found.columns[1];
        assert_eq!((q1.n_numbers, q1.n_empty, q1.n_others, q1.range), (2, 1, 1, Some([-2.0, 1.5])));
        assert!(found.columns[0].is_rising && found.columns[0].is_whole && !q1.is_rising);
        assert_eq!(found.columns[2].first_other.as_deref(), Some("a"));
    }

    #[test]
    fn dates_are_counted_where_a_column_begins_with_one() {
        let text = "at,q,n\n2026-03-01T12:00:00Z,1,a\n2026-03-01T12:00:02.5Z,2026-03-01T12:00:00Z,b\n7,2,c\n,3,d\n";
        let columns = read("a.csv", text).unwrap().columns;
        let counts = |k: usize| (columns[k].n_numbers, columns[k].n_dates, columns[k].n_empty, columns[k].n_others);
        assert_eq!([0, 1, 2].map(counts), [(0, 2, 1, 1), (3, 0, 0, 1), (0, 0, 0, 4)]);
        assert_eq!(columns[0].range, Some([1_772_366_400.0, 1_772_366_402.5]));
        assert!(columns[0].is_rising && columns[0].n_steps == 2);
        assert_eq!(columns[0].first_other.as_deref(), Some("7"));
    }

    #[test]
    fn rows_of_yaml_and_json_are_found_by_themselves() {
        let nested =
            "rate: 2\nsamples:\n- robot: {x: 1.0, y: 2}\n  hand: [1, 2]\n- robot: {x: 3, y: 1}\n  hand: [4, 5]\n";
        let found = read("a.yaml", nested).unwrap();
        assert_eq!((found.rows_at, found.n_rows), (vec!["samples".to_owned()], 2));
        let names: Vec<&str> = found.columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["robot.x", "robot.y", "hand.0", "hand.1"]);
        let named = read("b.yml", "joint_names: [a, b]\njoint_values:\n  - [1, 2]\n  - [3, 4]\n  - [5, 6]\n").unwrap();
        assert_eq!((named.rows_at, named.n_rows), (vec!["joint_values".to_owned()], 3));
        assert_eq!(named.other_names["a"], "0");
        let list = read("c.json", "[{\"j1\": 0.5}, {\"j1\": 0.25}]").unwrap();
        assert_eq!((list.rows_at.len(), list.n_rows, list.columns[0].range), (0, 2, Some([0.25, 0.5])));
        let by_name = read("d.yaml", "poses:\n  first: {j1: 1}\n  second: {j1: 2}\n").unwrap();
        assert_eq!((by_name.rows_at, by_name.n_rows), (vec!["poses".to_owned()], 2));
    }

    #[test]
    fn what_is_no_table_is_refused_with_what_is_read() {
        let cases = [
            ("a.yaml", "image_width: 640\ncamera_name: wrist\n"),
            ("b.csv", "just a text\nwithout numbers\n"),
            ("c.yaml", "a: [\n"),
            ("d.csv", "a,b\n1\n2,3,4\n"),
            ("e.txt", ""),
            ("f.csv", &format!("a,b\n1,2\n{}\n", ",".repeat(1000))),
            ("g.csv", &format!("\"a\n\"{}", ",".repeat(1000))),
        ];
        let told: Vec<String> = cases.map(|(name, text)| read(name, text).expect_err("refused")).to_vec();
        insta::assert_snapshot!("no_tables", told.join("\n"));
    }
}

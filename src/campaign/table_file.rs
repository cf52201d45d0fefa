//! Rows as CSV.

use std::path::Path;

use crate::campaign::CampaignError;
use crate::campaign::columns::Columns;
use crate::campaign::metric::Metric;
use crate::campaign::row::{Row, RunStatus};
use armcal_core::files::{self, FileKind};
use armcal_core::units::Unit;

/// Columns before the figures.
const FIXED: [&str; 8] = ["setting", "settings", "seed", "status", "exit_code", "stage", "failure", "command"];

/// Largest length of a line, bytes: the CSV reader keeps the positions of all its cells.
const MAX_LINE_BYTES: usize = 1 << 16;

/// Rows, and the names of their figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    pub names: Vec<String>,
    pub rows: Vec<Row>,
}

impl Table {
    /// Index of a metric's column; `None` where the table lacks it.
    #[must_use]
    pub fn place(&self, metric: Metric) -> Option<usize> {
        self.names.iter().position(|name| name == metric.name())
    }
}

/// Header line of the table.
fn header_line(names: &[String]) -> String {
    line(FIXED.iter().map(|name| (*name).to_owned()).chain(names.iter().cloned()))
}

/// One row with its line break.
pub(super) fn row_line(row: &Row, names: &[String]) -> String {
    let fixed = [
        row.setting.to_string(),
        row.settings.clone(),
        row.seed.to_string(),
        row.status.name().to_owned(),
        row.exit_code.to_string(),
        row.stage.clone(),
        row.failure.clone(),
        row.command.clone(),
    ];
    // The shortest decimal text of a number, which Rust prints, reads back as the same number.
    let figures = row.figures.iter().zip(names).map(|(value, name)| match (value, Columns::unit(name)) {
        (None, _) => String::new(),
        (Some(value), Unit::Count) => format!("{}", *value as u64),
        (Some(value), _) => format!("{value}"),
    });
    line(fixed.into_iter().chain(figures))
}

fn line(fields: impl Iterator<Item = String>) -> String {
    let mut writer = csv::WriterBuilder::new().from_writer(Vec::new());
    // Writing into memory cannot fail, and the fields are valid text.
    let written = writer.write_record(fields).ok().and_then(|()| writer.into_inner().ok());
    written.and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default()
}

/// The whole table as CSV.
#[must_use]
pub fn table_text(table: &Table) -> String {
    let rows = table.rows.iter().map(|row| row_line(row, &table.names));
    std::iter::once(header_line(&table.names)).chain(rows).collect()
}

/// Reads a campaign's CSV.
///
/// # Errors
/// [`CampaignError::Read`], or [`CampaignError::Table`] naming the line.
pub fn read_table(path: &Path) -> Result<Table, CampaignError> {
    let bytes = files::read_bytes(path, FileKind::Table)
        .map_err(|source| CampaignError::Read { path: path.to_owned(), source })?;
    parse_table(&bytes).map_err(|problem| CampaignError::Table { path: path.to_owned(), problem })
}

/// Parses a table; `bytes` holds header and rows, and lines that begin with # are skipped.
pub(crate) fn parse_table(bytes: &[u8]) -> Result<Table, String> {
    if let Some(at) = bytes.split(|byte| *byte == b'\n').position(|line| line.len() > MAX_LINE_BYTES) {
        return Err(format!("line {} is longer than {MAX_LINE_BYTES} bytes", at + 1));
    }
    let mut reader = csv::ReaderBuilder::new().has_headers(true).comment(Some(b'#')).from_reader(bytes);
    let header = reader.headers().map_err(|error| format!("is no CSV: {error}"))?.clone();
    if header.len() < FIXED.len() || header.iter().zip(FIXED).any(|(found, expected)| found != expected) {
        return Err(format!("is no table of a campaign: its columns must begin with {}", FIXED.join(", ")));
    }
    let names = header.iter().skip(FIXED.len()).map(str::to_owned).collect();
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        let at = record.position().map_or(0, csv::Position::line);
        rows.push(parse_row(&record).map_err(|column| format!("line {at}: {column} is not readable"))?);
    }
    let table = Table { names, rows };
    let mut keys: Vec<_> = table.rows.iter().map(Row::key).collect();
    keys.sort_unstable();
    match keys.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("setting {}, seed {} is there twice", pair[0].0, pair[0].1)),
        None => Ok(table),
    }
}

/// Parses a row; the error is the name of the column with an invalid value.
fn parse_row(record: &csv::StringRecord) -> Result<Row, String> {
    let field = |k: usize| record.get(k).unwrap_or_default();
    let bad = |k: usize| FIXED[k].to_owned();
    let figure = |text: &str| match text {
        "" => Ok(None),
        text => text.parse().map(Some).map_err(|_| format!("`{text}`")),
    };
    Ok(Row {
        setting: field(0).parse().map_err(|_| bad(0))?,
        settings: field(1).to_owned(),
        seed: field(2).parse().map_err(|_| bad(2))?,
        status: RunStatus::of_name(field(3)).ok_or_else(|| bad(3))?,
        exit_code: field(4).parse().map_err(|_| bad(4))?,
        stage: field(5).to_owned(),
        failure: field(6).to_owned(),
        command: field(7).to_owned(),
        figures: record.iter().skip(FIXED.len()).map(figure).collect::<Result<_, _>>()?,
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn names() -> Vec<String> {
        ["simulated_s", "contacts", "tool_error_after_median_m"].map(str::to_owned).to_vec()
    }

    pub fn row(setting: u32, seed: u64) -> Row {
        Row {
            setting,
            settings: "world.camera.rate_hz=5.0;method=\"two, words\"".to_owned(),
            seed,
            status: RunStatus::Accepted,
            exit_code: 0,
            stage: String::new(),
            failure: String::new(),
            command: format!("armcal run r.toml --seed {seed}"),
            figures: vec![Some(0.1 + 0.2 * seed as f64), Some(3.0), Some(1e-17)],
        }
    }

    #[test]
    fn rows_read_back_bit_for_bit() {
        let failed = Row {
            status: RunStatus::Failed,
            exit_code: 1,
            stage: "motion".to_owned(),
            failure: "it said \"no\", then, nothing".to_owned(),
            figures: vec![None, None, Some(f64::INFINITY)],
            ..row(1, u64::MAX)
        };
        let table = Table { names: names(), rows: vec![row(0, 1), row(0, 2), failed] };
        let text = table_text(&table);
        assert_eq!(text.lines().count(), 4);
        assert_eq!(parse_table(text.as_bytes()), Ok(table));
    }

    #[test]
    fn what_is_no_table_is_refused_with_the_place() {
        let good = table_text(&Table { names: names(), rows: vec![row(0, 1), row(0, 2)] });
        let problem = |text: &str| parse_table(text.as_bytes()).expect_err("refused");
        let told = [
            problem("a,b\n1,2\n"),
            problem(&good.replace("accepted", "fine")),
            problem(&good.replace("0.5,3", "0.5,x")),
            problem(&format!("{good}{}", row_line(&row(0, 1), &names()))),
            problem(&format!("{good}1,2\n")),
            problem(&format!("{good}{}\n", ",".repeat(70_000))),
        ];
        insta::assert_snapshot!("tables", told.map(|problem| format!("{problem}\n")).concat());
    }
}

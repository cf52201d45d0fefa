//! The covariance of a calibration, and its file next to calibration.toml.
//!
//! calibration.toml is for people; a hundred rows of numbers are not. The covariance of `NAME.toml` is in
//! `NAME.covariance.toml`. Each file holds the other's hash, so that a covariance is never used with another
//! calibration's parameters.

use crate::file::constants::covariance_file::FULL_DIGITS_ROWS;
use armcal_core::codes::Code;
use std::path::{Path, PathBuf};

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::file::file_error::CalibrationFileError;
use armcal_core::document::{VERSION, parse_file};
use armcal_core::kind::Kind;
use armcal_core::robot::{FileIssue, RobotError, read_text};
use armcal_core::schema::{first_line, schema_of};
use armcal_core::text::printable;

/// Start of the key that holds the other file's hash; neither hash includes that line.
const CALIBRATION_HASH: &str = "calibration_hash";

const HEAD: &str = "\
# Covariance of the parameters that the calibration beside this file estimated; row i of lower_triangle has columns
# 0 .. i. Gains are relative (1 is the datasheet's, or the identified scale's), offsets in rad, terms in the units of
# their keys, the camera mount in m and rad.
";

/// Names and covariance of the estimated parameters. The names are those of
/// [`Parameter::name`](crate::model::Parameter::name); gains are relative, offsets in rad.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CovarianceTable {
    /// Names of the parameters, in the order of the rows.
    pub parameters: Vec<String>,
    /// Rows of the covariance, square and symmetric.
    pub rows: Vec<Vec<f64>>,
}

/// Covariance as its file holds it.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CovarianceFile {
    version: u32,
    #[serde(default = "Kind::covariance")]
    kind: Kind,
    /// Hash of the calibration next to this file.
    calibration_hash: String,
    /// Names of the parameters.
    parameters: Vec<String>,
    /// Rows of the lower triangle.
    lower_triangle: Vec<Vec<f64>>,
}

/// Returns the schema of a covariance.
#[must_use]
pub fn covariance_schema() -> serde_json::Value {
    schema_of::<CovarianceFile>(Kind::Covariance)
}

impl CovarianceTable {
    /// Returns the covariance from the lower triangle of `matrix`, rounded to the digits that the file keeps.
    pub(crate) fn new(parameters: Vec<String>, matrix: &DMatrix<f64>) -> Self {
        let is_large = matrix.nrows() > FULL_DIGITS_ROWS;
        let rounded = |value: f64| {
            let short = || format!("{value:.6e}").parse().unwrap_or(value);
            if is_large && value.is_finite() { short() } else { value }
        };
        let row = |i: usize| (0..=i).map(|k| rounded(matrix[(i, k)])).collect();
        Self::from_lower_triangle(parameters, (0..matrix.nrows()).map(row).collect())
    }

    fn from_lower_triangle(parameters: Vec<String>, lower: Vec<Vec<f64>>) -> Self {
        let n = lower.len();
        let row = |i: usize| (0..n).map(|k| lower[i.max(k)][i.min(k)]).collect();
        Self { parameters, rows: (0..n).map(row).collect() }
    }

    /// Returns the index of the row of the parameter with this name.
    pub(crate) fn row(&self, parameter: &str) -> Option<usize> {
        self.parameters.iter().position(|name| name == parameter)
    }

    /// Returns the text of the file with the hash of its counterpart.
    fn text(&self, calibration_hash: String) -> String {
        let lower_triangle = self.rows.iter().enumerate().map(|(i, row)| row[..=i].to_vec()).collect();
        let (version, kind, parameters) = (VERSION, Kind::Covariance, self.parameters.clone());
        let file = CovarianceFile { version, kind, calibration_hash, parameters, lower_triangle };
        let body = toml::to_string(&file).expect("names and numbers have a TOML form");
        format!("{}{HEAD}{body}", first_line(Kind::Covariance))
    }

    /// Returns the value of `covariance_hash` in calibration.toml.
    pub(crate) fn hash(&self) -> String {
        content_hash(&self.text(String::new()))
    }

    /// Returns the text of the covariance file of the calibration with this text.
    pub(crate) fn to_file(&self, calibration: &str) -> String {
        self.text(content_hash(calibration))
    }

    /// Reads the covariance of `calibration`, a file with this `text` and `covariance_hash`.
    ///
    /// # Errors
    /// [`CalibrationFileError`] if its file is missing, belongs to another calibration, or is no covariance file.
    pub(crate) fn read_beside(calibration: &Path, text: &str, hash: &str) -> Result<Self, CalibrationFileError> {
        let file = covariance_file(calibration);
        if !file.exists() {
            return Err(CalibrationFileError::NoCovariance { file, calibration: calibration.to_owned() });
        }
        let covariance = read_text(&file)?;
        let read: CovarianceFile = parse_file(Kind::Covariance, &file, &covariance)?;
        let (n, lower) = (read.parameters.len(), &read.lower_triangle);
        if lower.len() != n || lower.iter().enumerate().any(|(i, row)| row.len() != i + 1) {
            let problem = format!("needs {n} rows, one for each of `parameters`, of 1 .. {n} numbers");
            return Err(RobotError::from(FileIssue::new(Code::ValueCount, &file, "lower_triangle", problem)).into());
        }
        if content_hash(&covariance) != hash || read.calibration_hash != content_hash(text) {
            return Err(CalibrationFileError::ForeignCovariance { file, calibration: calibration.to_owned() });
        }
        Ok(Self::from_lower_triangle(read.parameters, read.lower_triangle))
    }
}

/// Returns the path of a calibration's covariance: `NAME.covariance.toml` in the folder of `NAME.toml`.
#[must_use]
pub fn covariance_file(calibration: &Path) -> PathBuf {
    calibration.with_extension("covariance.toml")
}

/// Returns the hash (blake3) of a file's lines, without comments, indents, empty lines and the key of the other file's
/// hash.
fn content_hash(text: &str) -> String {
    let mut hasher = blake3::Hasher::new();
    let lines = text.lines().map(str::trim);
    for line in lines.filter(|l| !l.is_empty() && !l.starts_with('#') && !l.starts_with(CALIBRATION_HASH)) {
        // The hash is that of the text as the program writes it.
        hasher.update(printable(line).as_bytes());
        hasher.update(b"\n");
    }
    hasher.finalize().to_hex().to_string()
}

#[cfg(test)]
mod tests;

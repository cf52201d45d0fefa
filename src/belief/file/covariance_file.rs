//! The covariance of a calibration, and its file beside calibration.toml.
//!
//! calibration.toml is for people; a hundred rows of numbers are not. `NAME.toml` has its covariance in
//! `NAME.covariance.toml`. Each file holds the other's hash, so that a covariance never meets another's parameters.

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

/// What the key of a file's own counterpart begins with; the line counts in neither hash.
const CALIBRATION_HASH: &str = "calibration_hash";

const HEAD: &str = "\
# Covariance of the parameters that the calibration beside this file estimated; row i of lower_triangle has columns
# 0 .. i. Gains are relative (1 is the datasheet's, or the identified scale's), offsets in rad, terms in the units of
# their keys, the camera mount in m and rad.
";

/// Estimated parameters by [`Parameter::name`](crate::model::Parameter::name): gains relative, offsets in rad, ... and
/// their covariance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CovarianceTable {
    /// Names in the order of the rows.
    pub parameters: Vec<String>,
    /// Square and symmetric.
    pub rows: Vec<Vec<f64>>,
}

/// The same as its file has it.
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
    /// From the lower triangle of `matrix`, rounded to what the file keeps.
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

    /// The row of the parameter of this name.
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

    /// What `covariance_hash` in calibration.toml is.
    pub(crate) fn hash(&self) -> String {
        content_hash(&self.text(String::new()))
    }

    /// The file that goes beside the calibration with this text.
    pub(crate) fn to_file(&self, calibration: &str) -> String {
        self.text(content_hash(calibration))
    }

    /// Reads the covariance of `calibration`, whose text and `covariance_hash` these are.
    ///
    /// # Errors
    /// [`CalibrationFileError`]: its file is missing, belongs to another calibration, or is none.
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

/// Where the covariance of the calibration in `calibration` is: `NAME.covariance.toml` beside `NAME.toml`.
#[must_use]
pub fn covariance_file(calibration: &Path) -> PathBuf {
    calibration.with_extension("covariance.toml")
}

/// Hash (blake3) of a file's lines, whatever comments, indents and empty lines it got, less the key of its counterpart.
fn content_hash(text: &str) -> String {
    let mut hasher = blake3::Hasher::new();
    let lines = text.lines().map(str::trim);
    for line in lines.filter(|l| !l.is_empty() && !l.starts_with('#') && !l.starts_with(CALIBRATION_HASH)) {
        // As the file is written.
        hasher.update(printable(line).as_bytes());
        hasher.update(b"\n");
    }
    hasher.finalize().to_hex().to_string()
}

#[cfg(test)]
mod tests;

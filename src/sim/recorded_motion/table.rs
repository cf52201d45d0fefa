//! CSV of a recorded motion: columns and values, each checked separately.

use armcal_core::codes::Code;
use std::ops::RangeInclusive;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use armcal_core::robot::FileIssue;

/// Sample of one line of the file.
pub(super) struct Sample {
    pub line: u64,
    pub time_s: f64,
    pub position_m: Vector3<f64>,
    pub rotation: UnitQuaternion<f64>,
}

/// Columns of a file.
pub(super) struct Header {
    names: &'static [&'static str],
}

const BY_ANGLES: [&str; 7] = ["time_s", "x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad"];
const BY_QUATERNION: [&str; 8] = ["time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"];
const N_POSITION_COLUMNS: usize = 4;
/// Largest number of bytes in a line: the CSV reader stores the positions of all its cells.
const MAX_LINE_BYTES: usize = 4096;
/// Smallest number of samples: a cubic through fewer determines no accelerations.
const MIN_ROWS: usize = 4;

const TIME_S: RangeInclusive<f64> = -1e12..=1e12;
const POSITION_M: RangeInclusive<f64> = -1e4..=1e4;
/// Range of angles, rad: yaw may be unwrapped over several turns.
const ANGLE_RAD: RangeInclusive<f64> = -1e3..=1e3;
const QUATERNION_PART: RangeInclusive<f64> = -1.01..=1.01;
/// Range of a quaternion's norm: four decimals leave 1e-4, and a larger error is no quaternion of an attitude.
const QUATERNION_NORM: RangeInclusive<f64> = 0.99..=1.01;

impl Header {
    fn of(file: &Path, found: &[&str]) -> Result<Self, FileIssue> {
        let kinds: [&'static [&'static str]; 2] = [&BY_ANGLES, &BY_QUATERNION];
        kinds.into_iter().find(|names| *names == found).map(|names| Self { names }).ok_or_else(|| {
            let problem = format!(
                "has the columns `{}`; allowed are `{}` or `{}`",
                found.join(","),
                BY_ANGLES.join(","),
                BY_QUATERNION.join(",")
            );
            FileIssue::new(Code::TableInvalid, file, "first line", problem)
        })
    }

    pub(super) fn position_columns(&self) -> String {
        format!("columns {}", self.names[1..N_POSITION_COLUMNS].join(", "))
    }

    pub(super) fn attitude_columns(&self) -> String {
        format!("columns {}", self.names[N_POSITION_COLUMNS..].join(", "))
    }

    fn range(&self, column: usize) -> RangeInclusive<f64> {
        match column {
            0 => TIME_S,
            1..N_POSITION_COLUMNS => POSITION_M,
            _ if self.names.len() == BY_ANGLES.len() => ANGLE_RAD,
            _ => QUATERNION_PART,
        }
    }
}

/// Returns columns and samples of `text`.
pub(super) fn parse(file: &Path, text: &str) -> Result<(Header, Vec<Sample>), FileIssue> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if let Some(at) = text.lines().position(|line| line.len() > MAX_LINE_BYTES) {
        let problem = format!("is longer than {MAX_LINE_BYTES} bytes; a line has a time and a pose alone");
        return Err(FileIssue::new(Code::TableInvalid, file, format!("line {}", at + 1), problem));
    }
    let mut reader =
        csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).flexible(true).from_reader(text.as_bytes());
    let unreadable =
        |error: csv::Error| FileIssue::new(Code::TableInvalid, file, "table", format!("is no CSV: {error}"));
    let header = Header::of(file, &reader.headers().map_err(unreadable)?.iter().collect::<Vec<_>>())?;
    let mut samples = Vec::new();
    for record in reader.records() {
        samples.push(sample(file, &header, &record.map_err(unreadable)?)?);
    }
    if samples.len() < MIN_ROWS {
        let problem = format!("has {} samples; a motion needs {MIN_ROWS} or more", samples.len());
        return Err(FileIssue::new(Code::TableInvalid, file, "table", problem));
    }
    Ok((header, samples))
}

fn sample(file: &Path, header: &Header, record: &csv::StringRecord) -> Result<Sample, FileIssue> {
    let line = record.position().map_or(0, csv::Position::line);
    let n = header.names.len();
    if record.len() != n {
        let problem = format!("has {} columns; the first line has {n}", record.len());
        return Err(FileIssue::new(Code::TableInvalid, file, format!("line {line}"), problem));
    }
    let mut figures = [0.0; BY_QUATERNION.len()];
    for (column, (figure, text)) in figures.iter_mut().zip(record).enumerate() {
        let key = format!("line {line}, column {}", header.names[column]);
        let range = header.range(column);
        *figure = text.parse().map_err(|_| {
            let problem = format!("`{text}` is no number; allowed is {} .. {}", range.start(), range.end());
            FileIssue::new(Code::TableInvalid, file, &key, problem)
        })?;
        FileIssue::check_range(file, &key, *figure, range)?;
    }
    let [time_s, x, y, z, attitude @ ..] = figures;
    let rotation = if n == BY_ANGLES.len() {
        UnitQuaternion::from_euler_angles(attitude[0], attitude[1], attitude[2])
    } else {
        let q = Quaternion::new(attitude[0], attitude[1], attitude[2], attitude[3]);
        let key = format!("line {line}, {}: norm", header.attitude_columns());
        FileIssue::check_range(file, &key, q.norm(), QUATERNION_NORM)?;
        UnitQuaternion::from_quaternion(q)
    };
    Ok(Sample { line, time_s, position_m: Vector3::new(x, y, z), rotation })
}

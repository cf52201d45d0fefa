//! Tables of poses at rest: CSV and YAML files by the columns of an input map.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nalgebra::Isometry3;

use super::error::{BadPlace, InputError};
use super::joint_unit::check_unit;
use super::joints::{Reading, n_needed};
use super::map::{CornerOrder, InputMap, NotFinite, SeenColumns, TableFormat, TableLayout, TagUse};
use super::recording::ExternalRecording;
use super::tags::{ExternalDetection, MIN_DISTANCE_M, RawMeasurement, TagFrame};
use crate::files::{FileKind, read_text};
use crate::joints::JointCounts;
use crate::robot::Robot;
use crate::time::Stamp;

mod columns;
mod contents;
mod csv_text;
mod pose;
mod rows;
mod yaml;

use columns::Columns;
pub use contents::{TableColumn, TableContents, read_table_contents};
use csv_text::csv_rows;
use pose::camera_from_tag;
use rows::{Row, Rows};
use yaml::yaml_rows;

/// Rows this close would pass for a stream of readings of a moving arm, s.
const MIN_APART_S: f64 = 0.3;
/// Between rows without a time, s.
const ROW_S: f64 = 1.0;
/// The largest time, ns: the year 2262.
const MAX_NANOS: f64 = 9.2e18;

/// Reads a table; each row is one pose at rest.
pub(super) fn read_table(
    path: &Path,
    map: &InputMap,
    layout: &TableLayout,
    robot: &Robot,
) -> Result<ExternalRecording, InputError> {
    let file = path.display().to_string();
    let columns = Columns::of(map, layout, robot);
    let found = read_rows(path, layout, &columns.names)?;
    columns.check_present(&file, &found, n_needed(robot))?;
    let absent_joints: Vec<usize> =
        (0..robot.n_joints()).filter(|&joint| !found.columns.contains(&columns.names[joint])).collect();
    let recording = ExternalRecording { path: path.to_owned(), absent_joints, ..ExternalRecording::default() };
    let keys = BTreeSet::new();
    let mut reader = TableReader { file: &file, map, layout, robot, columns: &columns, recording, keys };
    for row in &found.rows {
        reader.take(row)?;
    }
    let mut recording = reader.recording;
    if matches!(layout.seen, SeenColumns::TagCorner { .. }) {
        join_corners(&mut recording);
    }
    if recording.frames.is_empty() {
        let why: Vec<String> = recording.left_out.iter().map(|(why, n)| format!("{n} {why}")).collect();
        let problem = format!("no row of it could be used: it has {}", why.join(", "));
        return Err(InputError::Table { file, problem });
    }
    recording.frames.iter_mut().for_each(|frame| frame.tags.sort_by_key(ExternalDetection::key));
    recording.unit_doubt = check_unit(&file, map, robot, &recording.readings)?;
    Ok(recording)
}

/// Reads the columns `wanted` of a table.
fn read_rows(path: &Path, layout: &TableLayout, wanted: &[String]) -> Result<Rows, InputError> {
    let file = path.display().to_string();
    let format = match layout.format {
        Some(format) => format,
        None => format_by_name(path).ok_or_else(|| InputError::Table {
            file: file.clone(),
            problem: "its name ends in neither .csv, .tsv, .txt nor .yaml, .yml, .json; set `table.format` of the \
                      input map to \"csv\" or \"yaml\""
                .to_owned(),
        })?,
    };
    let text = read_table_text(path, format)?;
    let found = match format {
        TableFormat::Csv => csv_rows(&file, &text, wanted)?,
        TableFormat::Yaml => yaml_rows(&file, &text, layout, wanted)?,
    };
    if found.rows.is_empty() {
        return Err(InputError::Table { file, problem: "it has no rows".to_owned() });
    }
    Ok(found)
}

fn read_table_text(path: &Path, format: TableFormat) -> Result<String, InputError> {
    // YAML takes many times its bytes in memory.
    let kind = if format == TableFormat::Csv { FileKind::Table } else { FileKind::Text };
    read_text(path, kind).map_err(|source| InputError::Unreadable { file: path.display().to_string(), source })
}

fn format_by_name(path: &Path) -> Option<TableFormat> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "csv" | "tsv" | "txt" => Some(TableFormat::Csv),
        "yaml" | "yml" | "json" => Some(TableFormat::Yaml),
        _ => None,
    }
}

struct TableReader<'a> {
    file: &'a str,
    map: &'a InputMap,
    layout: &'a TableLayout,
    robot: &'a Robot,
    columns: &'a Columns,
    recording: ExternalRecording,
    /// Keys in the last frame.
    keys: BTreeSet<Key>,
}

/// [`ExternalDetection::key`].
type Key = (Option<u32>, Option<u32>);

/// Makes tags of the rows' corners, which a frame holds as those of a board each.
fn join_corners(recording: &mut ExternalRecording) {
    let mut incomplete = 0;
    for frame in &mut recording.frames {
        let mut tags: BTreeMap<Option<u32>, [Option<[f64; 2]>; 4]> = BTreeMap::new();
        for ExternalDetection { id, seen } in std::mem::take(&mut frame.tags) {
            if let RawMeasurement::BoardCorner { number, pixel } = seen {
                tags.entry(id).or_default()[number as usize] = Some(pixel);
            }
        }
        for (id, corners) in tags {
            match corners {
                [Some(a), Some(b), Some(c), Some(d)] => {
                    frame.tags.push(ExternalDetection { id, seen: RawMeasurement::Corners([a, b, c, d]) });
                }
                _ => incomplete += 1,
            }
        }
    }
    recording.frames.retain(|frame| !frame.tags.is_empty());
    if incomplete > 0 {
        recording.left_out.insert("tags with fewer than four corners at a pose".to_owned(), incomplete);
    }
}

impl TableReader<'_> {
    fn take(&mut self, row: &Row) -> Result<(), InputError> {
        let Some(values) = self.finite_values(row)? else {
            *self.recording.left_out.entry("rows with a number that is not finite".to_owned()).or_default() += 1;
            return Ok(());
        };
        let counts = self.counts(&values);
        let tag = self.detection(row, &values)?;
        let stamp = self.stamp(row, &values, (&counts, &tag))?;
        let digest = digest(stamp, &values);
        let key = tag.key();
        match self.recording.frames.last_mut().filter(|frame| frame.stamp == stamp) {
            Some(frame) => {
                frame.tags.push(tag);
                frame.digests.push(digest);
            }
            None => {
                self.keys.clear();
                self.recording.readings.push(Reading { stamp, counts, digest });
                self.recording.frames.push(TagFrame { stamp, tags: vec![tag], digests: vec![digest] });
            }
        }
        self.keys.insert(key);
        Ok(())
    }

    fn problem<T>(&self, row: &Row, problem: String) -> Result<T, InputError> {
        Err(InputError::Row { file: self.file.to_owned(), place: BadPlace::Row(row.number), problem })
    }

    /// The row's values, zero for absent joints; `None` where one is not finite and such rows are left out.
    fn finite_values(&self, row: &Row) -> Result<Option<Vec<f64>>, InputError> {
        let mut values = Vec::with_capacity(row.values.len());
        for (k, value) in row.values.iter().enumerate() {
            let column = &self.columns.names[k];
            match value {
                None if self.recording.absent_joints.contains(&k) => values.push(0.0),
                None => return self.problem(row, format!("has no value in the column `{column}`")),
                Some(value) if value.is_finite() => values.push(*value),
                Some(_) if self.map.not_finite == NotFinite::LeaveOut => return Ok(None),
                Some(value) => {
                    let (file, place) = (self.file.to_owned(), BadPlace::Row(row.number));
                    let (field, of) = ("the value", column.clone());
                    return Err(InputError::NotFinite { file, place, field, of, value: *value });
                }
            }
        }
        Ok(Some(values))
    }

    fn counts(&self, values: &[f64]) -> JointCounts {
        JointCounts::from_fn(self.robot.n_joints(), |joint| {
            if self.recording.absent_joints.contains(&joint) {
                return 0.0;
            }
            self.map.counts(&self.robot.sensors[joint], values[joint])
        })
    }

    fn id(&self, row: &Row, values: &[f64]) -> Result<Option<u32>, InputError> {
        let Some(at) = self.columns.id else { return Ok(None) };
        let value = values[at];
        if value.fract() != 0.0 || !(0.0..=f64::from(u32::MAX)).contains(&value) {
            return self.problem(row, format!("`{}` is {value}, not a tag's number", self.columns.names[at]));
        }
        Ok(Some(value as u32))
    }

    /// Place of the row's corner in armcal's order.
    fn corner(&self, row: &Row, values: &[f64], order: CornerOrder) -> Result<u32, InputError> {
        let Some(at) = self.columns.corner else { return Ok(0) };
        match [0.0, 1.0, 2.0, 3.0].iter().position(|number| *number == values[at]) {
            Some(number) => Ok(order.place(number) as u32),
            None => {
                let name = &self.columns.names[at];
                self.problem(
                    row,
                    format!(
                        "`{name}` is {}, not a corner's number, 0 to 3; subtract 1 where they begin with 1",
                        values[at]
                    ),
                )
            }
        }
    }

    fn detection(&self, row: &Row, values: &[f64]) -> Result<ExternalDetection, InputError> {
        let id = self.id(row, values)?;
        let place = self.columns.place.clone().map(|at| values[at]);
        let pixel = |k: usize| [values[self.columns.place.start + 2 * k], values[self.columns.place.start + 2 * k + 1]];
        let layout = match &self.layout.seen {
            SeenColumns::Pose(layout) => layout,
            SeenColumns::Pixel(_) => {
                let seen = RawMeasurement::BoardCorner { number: id.unwrap_or_default(), pixel: pixel(0) };
                return Ok(ExternalDetection { id: None, seen });
            }
            SeenColumns::TagCorner { order, .. } => {
                let seen = RawMeasurement::BoardCorner { number: self.corner(row, values, *order)?, pixel: pixel(0) };
                return Ok(ExternalDetection { id, seen });
            }
            // Both orders are their own inverse.
            SeenColumns::TagCorners { order, .. } => {
                let seen = RawMeasurement::Corners([0, 1, 2, 3].map(|k| pixel(order.place(k))));
                return Ok(ExternalDetection { id, seen });
            }
        };
        let rotation: Vec<f64> = self.columns.rotation.clone().map(|at| values[at]).collect();
        let camera_from_tag: Isometry3<f64> = match camera_from_tag(layout, place, &rotation) {
            Ok(pose) => pose,
            Err(problem) => return self.problem(row, problem),
        };
        if camera_from_tag.translation.vector.norm() < MIN_DISTANCE_M {
            return self.problem(row, "puts the tag into the camera itself".to_owned());
        }
        let seen = match self.map.tag_use {
            TagUse::Pose => RawMeasurement::Pose(camera_from_tag),
            _ => RawMeasurement::Position(camera_from_tag.translation.vector),
        };
        Ok(ExternalDetection { id, seen })
    }

    /// Rows of one time are of one pose. Without a time, so are rows of different tags with the same joint readings.
    fn stamp(&self, row: &Row, values: &[f64], pose: (&JointCounts, &ExternalDetection)) -> Result<Stamp, InputError> {
        let last = self.recording.readings.last().zip(self.recording.frames.last());
        let is_again = self.keys.contains(&pose.1.key());
        let Some((time, at)) = self.layout.time.as_ref().zip(self.columns.time) else {
            let same = last.filter(|(reading, _)| reading.counts == *pose.0 && !is_again);
            let next = Stamp::default().plus_s(ROW_S * row.number as f64);
            return Ok(same.map_or(next, |(reading, _)| reading.stamp));
        };
        let nanos = values[at] * time.unit_nanos;
        if !(0.0..=MAX_NANOS).contains(&nanos) {
            return self.problem(row, format!("the time {} is no time after 1970", values[at]));
        }
        let stamp = Stamp { nanos: nanos.round() as i64 };
        let Some((reading, _)) = last else { return Ok(stamp) };
        let after_s = stamp.since_s(reading.stamp);
        if stamp == reading.stamp {
            return match (is_again, reading.counts == *pose.0) {
                (true, _) => self.problem(row, "has the time and the tag (or corner) of a row before".to_owned()),
                (false, false) => self.problem(row, "has the time of the row before and other joints".to_owned()),
                (false, true) => Ok(stamp),
            };
        }
        if after_s < MIN_APART_S {
            return self.problem(
                row,
                format!(
                    "is {after_s} s after the row before; poses at rest are at least {MIN_APART_S} s apart, in the \
                     order of time. Leave `table.time` out where it says something else"
                ),
            );
        }
        Ok(stamp)
    }
}

/// Hash of the row's values and its time.
fn digest(stamp: Stamp, values: &[f64]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"armcal table row 1");
    hasher.update(&stamp.nanos.to_le_bytes());
    for value in values {
        hasher.update(&value.to_le_bytes());
    }
    *hasher.finalize().as_bytes()
}

#[cfg(test)]
mod tests;

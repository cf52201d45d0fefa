//! A table whose rows have the joints and what the camera saw.

use std::collections::BTreeSet;
use std::path::Path;

use super::columns::{Columns, Part};
use super::row_reader::{RowReader, digest};
use super::rows::Row;
use super::{NOT_A_NUMBER, TableFile, read_rows};
use crate::input::error::InputError;
use crate::input::joints::{Reading, n_needed};
use crate::input::map::{InputMap, TableLayout};
use crate::input::recording::ExternalRecording;
use crate::input::tags::{ExternalDetection, TagFrame};
use crate::joints::JointCounts;
use crate::robot::Robot;
use crate::time::Stamp;

/// Poses at rest are this far apart at least, s: nearer ones would pass for readings of a moving arm.
pub const MIN_APART_S: f64 = 0.3;
/// Between rows without a time, s.
pub(super) const ROW_S: f64 = 1.0;

pub(super) fn read(
    path: &Path,
    map: &InputMap,
    layout: &TableLayout,
    robot: &Robot,
) -> Result<ExternalRecording, InputError> {
    let file = path.display().to_string();
    let columns = Columns::of(map, layout, robot, Part::Both);
    let found = read_rows(TableFile { path, format: layout.format, rows_at: &layout.rows }, columns.wanted())?;
    columns.check_present(&file, &found, n_needed(robot))?;
    let absent_joints = columns.absent_joints(&found);
    let rows = RowReader { file: &file, map, layout, robot, columns: &columns, absent_joints: &absent_joints };
    let recording = ExternalRecording { path: path.to_owned(), ..ExternalRecording::default() };
    let mut reader = PoseReader { rows, recording, keys: BTreeSet::new() };
    found.rows.iter().try_for_each(|row| reader.take(row))?;
    let PoseReader { recording, .. } = reader;
    Ok(ExternalRecording { absent_joints, ..recording })
}

struct PoseReader<'a> {
    rows: RowReader<'a>,
    recording: ExternalRecording,
    /// [`ExternalDetection::key`] of those in the last frame.
    keys: BTreeSet<(Option<u32>, Option<u32>)>,
}

impl PoseReader<'_> {
    fn take(&mut self, row: &Row) -> Result<(), InputError> {
        let Some(values) = self.rows.finite_values(row)? else {
            *self.recording.left_out.entry(NOT_A_NUMBER.to_owned()).or_default() += 1;
            return Ok(());
        };
        let counts = self.rows.counts(&values);
        let tag = self.rows.detection(row, &values)?;
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

    /// Rows of one time are of one pose. Without a time, so are rows of different tags with the same joint readings.
    fn stamp(&self, row: &Row, values: &[f64], pose: (&JointCounts, &ExternalDetection)) -> Result<Stamp, InputError> {
        let last = self.recording.readings.last().zip(self.recording.frames.last());
        let is_again = self.keys.contains(&pose.1.key());
        let Some(stamp) = self.rows.time(row, values)? else {
            let same = last.filter(|(reading, _)| reading.counts == *pose.0 && !is_again);
            let next = Stamp::default().plus_s(ROW_S * row.number as f64);
            return Ok(same.map_or(next, |(reading, _)| reading.stamp));
        };
        let Some((reading, _)) = last else { return Ok(stamp) };
        let after_s = stamp.since_s(reading.stamp);
        if stamp == reading.stamp {
            return match (is_again, reading.counts == *pose.0) {
                (true, _) => self.rows.problem(row, "has the time and the tag (or corner) of a row before".to_owned()),
                (false, false) => self.rows.problem(row, "has the time of the row before and other joints".to_owned()),
                (false, true) => Ok(stamp),
            };
        }
        if after_s < MIN_APART_S {
            return self.rows.problem(
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

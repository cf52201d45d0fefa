//! Reader of a table whose rows have the joints and the camera's measurements.

use std::collections::BTreeSet;
use std::path::Path;

use super::columns::{Columns, Part};
use super::row_reader::{MAX_NANOS, RowReader, digest};
use super::rows::Row;
use super::{COPIES, NOT_A_NUMBER, TableFile, read_rows};
use crate::input::error::InputError;
use crate::input::joints::{Reading, n_needed};
use crate::input::map::{InputMap, TableLayout, TimeUnit};
use crate::input::recording::ExternalRecording;
use crate::input::tags::{ExternalDetection, TagFrame};
use crate::joints::JointCounts;
use crate::robot::Robot;
use crate::time::Stamp;

/// Minimum time between poses at rest, s: closer ones would pass for readings of a moving arm.
pub const MIN_APART_S: f64 = 0.3;
/// Time between rows without a time, s.
pub(super) const ROW_S: f64 = 1.0;

pub(super) fn read(
    path: &Path,
    map: &InputMap,
    layout: &TableLayout,
    robot: &Robot,
) -> Result<ExternalRecording, InputError> {
    let file = path.display().to_string();
    let columns = Columns::of(map, layout, robot, Part::Both);
    let mut found = read_rows(TableFile { path, format: layout.format, rows_at: &layout.rows }, columns.wanted())?;
    columns.check_present(&file, &found, n_needed(robot))?;
    let absent_joints = columns.absent_joints(&found);
    let rows = RowReader { file: &file, map, layout, robot, columns: &columns, absent_joints: &absent_joints };
    let rows_sorted = columns.sort_by_time(&mut found.rows);
    let recording = ExternalRecording { path: path.to_owned(), rows_sorted, ..ExternalRecording::default() };
    let likely_unit = likely_time_unit(rows, &found.rows);
    let mut reader = PoseReader { rows, likely_unit, recording, keys: BTreeSet::new() };
    found.rows.iter().try_for_each(|row| reader.take(row))?;
    let PoseReader { recording, .. } = reader;
    Ok(ExternalRecording { absent_joints, ..recording })
}

/// Returns a coarser unit of the times in which all rows of different times are poses at rest, if none are as stated.
fn likely_time_unit(reader: RowReader<'_>, rows: &[Row]) -> Option<TimeUnit> {
    let (at, stated) = reader.columns.time?;
    let stated_nanos = stated.nanos()?;
    let times: Vec<f64> = rows.iter().filter_map(|row| row.values[at]).collect();
    let mut apart = times.windows(2).map(|two| two[1] - two[0]).filter(|apart| *apart != 0.0).peekable();
    apart.peek()?;
    let (least, most) = apart.fold((f64::INFINITY, 0.0f64), |(least, most), one| (least.min(one), most.max(one)));
    let last = times.last()?;
    let is_likely = |unit: &TimeUnit| {
        let nanos = unit.nanos().unwrap_or(0.0);
        least * nanos >= MIN_APART_S * 1e9 && last * nanos <= MAX_NANOS
    };
    let is_too_fine = least > 0.0 && most * stated_nanos < MIN_APART_S * 1e9;
    [TimeUnit::Us, TimeUnit::Ms, TimeUnit::S].into_iter().find(is_likely).filter(|_| is_too_fine)
}

struct PoseReader<'a> {
    rows: RowReader<'a>,
    /// Likely unit of the times, if they are too close to each other as stated.
    likely_unit: Option<TimeUnit>,
    recording: ExternalRecording,
    /// [`ExternalDetection::key`] of the detections in the last frame.
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
        if self.is_copy(row, &values)? {
            *self.recording.skipped.entry(COPIES.to_owned()).or_default() += 1;
            return Ok(());
        }
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

    /// Returns true if a row with the same time and the same values came before.
    fn is_copy(&self, row: &Row, values: &[f64]) -> Result<bool, InputError> {
        let Some(stamp) = self.rows.time(row, values)? else { return Ok(false) };
        let last = self.recording.frames.last().filter(|frame| frame.stamp == stamp);
        Ok(last.is_some_and(|frame| frame.digests.contains(&digest(stamp, values))))
    }

    /// Returns the stamp of a row's pose. Rows of one time belong to one pose. Without a time, so do rows of different
    /// tags with the same joint readings.
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
            let unit = self.likely_unit.map_or(String::new(), |unit| {
                format!("set `table.time.unit` to \"{0}\" if the times are in {0}, or ", unit.key())
            });
            return self.rows.problem(
                row,
                format!(
                    "is {after_s} s after the row before; poses at rest are at least {MIN_APART_S} s apart, in the \
                     order of time: {unit}leave `table.time` out where it says something else"
                ),
            );
        }
        Ok(stamp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::parse_input_map;

    const MAP: &str = "version = 1\nkind = \"input\"\n[table]\ntime = { column = \"t\", unit = \"UNIT\" }\n\
        [joint_sensors]\nunit = \"rad\"\n[tags]\nchild_frame = \"board\"\nuse = \"position\"\n[tags.columns]\n\
        direction = \"camera_from_tag\"\nposition = [\"x\", \"y\", \"z\"]\n";

    /// Returns the likely unit of times that are stated to be in `unit`.
    fn likely(unit: &str, times: &[f64]) -> Option<TimeUnit> {
        let robot = crate::robot::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/titan4")).unwrap();
        let map = parse_input_map(Path::new("map.toml"), &MAP.replace("UNIT", unit)).unwrap();
        let crate::input::Source::Table(layout) = &map.source else { panic!("a table") };
        let columns = Columns::of(&map, layout, &robot, Part::Both);
        let rows = RowReader { file: "a.csv", map: &map, layout, robot: &robot, columns: &columns, absent_joints: &[] };
        let row = |(k, time): (usize, &f64)| {
            let values = vec![Some(*time); columns.names.len()];
            Row { number: k as u64 + 1, values, date: None, key: String::new() }
        };
        let found: Vec<Row> = times.iter().enumerate().map(row).collect();
        likely_time_unit(rows, &found)
    }

    #[test]
    fn a_coarser_unit_is_likely_where_it_makes_poses_at_rest_of_all_rows() {
        assert_eq!(likely("ms", &[0.0, 3.0, 3.0, 7.5, 130.0]), Some(TimeUnit::S));
        assert_eq!(likely("ms", &[1.79e9, 1.79e9 + 4.0, 1.79e9 + 9.0]), Some(TimeUnit::S));
        assert_eq!(likely("ns", &[0.0, 3e3, 8e3]), Some(TimeUnit::Ms));
        assert_eq!(likely("us", &[0.0, 3e3, 8e3]), Some(TimeUnit::Ms));
        // No other unit is likely if, as stated, some rows are poses at rest, none follow each other, or times are
        // disordered.
        assert_eq!(likely("ms", &[0.0, 3.0, 4000.0, 4003.0]), None);
        assert_eq!(likely("s", &[0.0, 0.01, 0.02]), None);
        assert_eq!(likely("ms", &[5.0, 5.0]), None);
        assert_eq!(likely("ms", &[5.0, 2.0, 9.0]), None);
        // In seconds these times would be beyond the largest time.
        assert_eq!(likely("ms", &[1.79e12, 1.79e12 + 10.0]), None);
    }
}

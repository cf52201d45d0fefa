//! Reader of joints in one table and camera measurements in another, joined by time or by a column of both.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::columns::{Columns, Part};
use super::one_table::ROW_S;
use super::row_reader::{RowReader, digest};
use super::rows::{Row, Rows, plain_key};
use super::{COPIES, NOT_A_NUMBER, TableFile, read_rows};
use crate::input::clocks::{StreamTimes, compare_clocks};
use crate::input::error::InputError;
use crate::input::joints::{Reading, n_needed};
use crate::input::map::{InputMap, TableJoin, TableLayout, TagTable};
use crate::input::recording::ExternalRecording;
use crate::input::tags::TagFrame;
use crate::robot::Robot;
use crate::time::Stamp;

/// Reads the joints' table at `path` and the tags' table.
pub(super) fn read(
    path: &Path,
    map: &InputMap,
    (layout, tags): (&TableLayout, &TagTable),
    robot: &Robot,
) -> Result<ExternalRecording, InputError> {
    let files = [path, &tags.file].map(|path| path.display().to_string());
    let columns = [Part::Joints, Part::Tags].map(|part| Columns::of(map, layout, robot, part));
    let tables = [
        TableFile { path, format: layout.format, rows_at: &layout.rows },
        TableFile { path: &tags.file, format: tags.format, rows_at: &tags.rows },
    ];
    let [of_joints, of_tags] = [0, 1].map(|k| read_rows(tables[k], columns[k].wanted()));
    let (mut of_joints, mut of_tags) = (of_joints?, of_tags?);
    let n_whole = of_joints.n_joined(&of_tags, str::to_owned);
    let are_plain = MOST * of_joints.n_joined(&of_tags, plain_key) as f64 >= n_whole as f64;
    if are_plain {
        [&mut of_joints, &mut of_tags].into_iter().for_each(Rows::make_keys_plain);
    }
    // Stable: rows of the tags that share a time keep their order.
    let n_late = columns[0].sort_by_time(&mut of_joints.rows);
    columns[0].check_present(&files[0], &of_joints, n_needed(robot))?;
    columns[1].check_present(&files[1], &of_tags, 0)?;
    let absent_joints = columns[0].absent_joints(&of_joints);
    let row_reader = |k: usize, absent_joints| {
        let (file, columns) = (files[k].as_str(), &columns[k]);
        RowReader { file, map, layout, robot, columns, absent_joints }
    };
    let path = path.to_owned();
    let recording = ExternalRecording { path, rows_sorted: n_late, ..ExternalRecording::default() };
    let mut joined = Joined { recording, are_plain, stamps: BTreeMap::new(), matched: BTreeSet::new() };
    joined.take_joints(row_reader(0, &absent_joints), &of_joints)?;
    joined.take_tags(row_reader(1, &[]), &of_tags, &tags.join)?;
    joined.finish([&files[0], &files[1]], map, &tags.join).map(|found| ExternalRecording { absent_joints, ..found })
}

/// Whole texts join where they join more than this share of what images' names without folders join. Assumed: some
/// rows have no other half, whose name without its folder may be that of another row.
const MOST: f64 = 0.5;

struct Joined {
    recording: ExternalRecording,
    /// True if the joining texts are without the images' folders and extensions.
    are_plain: bool,
    /// Row and stamp of the joints, by the joining text.
    stamps: BTreeMap<String, (u64, Stamp)>,
    /// Texts that both tables have.
    matched: BTreeSet<String>,
}

impl Joined {
    fn leave_out(&mut self, why: String, n: usize) {
        if n > 0 {
            *self.recording.left_out.entry(why).or_default() += n as u64;
        }
    }

    /// Adds the readings in the order of time.
    fn take_joints(&mut self, rows: RowReader<'_>, found: &Rows) -> Result<(), InputError> {
        for row in &found.rows {
            let Some(values) = rows.finite_values(row)? else {
                self.leave_out(NOT_A_NUMBER.to_owned(), 1);
                continue;
            };
            let by_number = Stamp::default().plus_s(ROW_S * row.number as f64);
            let stamp = rows.time(row, &values)?.unwrap_or(by_number);
            let digest = digest(stamp, &values);
            let last = self.recording.readings.last();
            if last.is_some_and(|last| last.digest == digest) && rows.columns.key.is_none() {
                *self.recording.skipped.entry(COPIES.to_owned()).or_default() += 1;
                continue;
            }
            if last.is_some_and(|last| last.stamp >= stamp) {
                let problem = "has the time of a row before; leave one of each time in the joints' table";
                return rows.problem(row, problem.to_owned());
            }
            if let Some(column) = &rows.columns.key {
                self.add_key(rows, row, (column, stamp))?;
            }
            let counts = rows.counts(&values);
            self.recording.readings.push(Reading { stamp, counts, digest });
        }
        Ok(())
    }

    fn add_key(&mut self, rows: RowReader<'_>, row: &Row, (column, stamp): (&String, Stamp)) -> Result<(), InputError> {
        if row.key.is_empty() {
            return rows.problem(row, format!("has no text in the column `{column}`, which joins the tables"));
        }
        match self.stamps.insert(row.key.clone(), (row.number, stamp)) {
            None => Ok(()),
            Some((before, _)) => {
                let remedy = match self.are_plain {
                    true => {
                        " without folder and ending, as no whole text is in both tables; write folders and endings \
                         alike in both, or leave one row of the joints for each"
                    }
                    false => "; leave one row of the joints for each",
                };
                rows.problem(row, format!("has the `{column}` of row {before}, {:?}{remedy}", row.key))
            }
        }
    }

    /// Adds the frames by their stamps, with each tag once.
    fn take_tags(&mut self, rows: RowReader<'_>, found: &Rows, join: &TableJoin) -> Result<(), InputError> {
        let mut frames: BTreeMap<Stamp, TagFrame> = BTreeMap::new();
        let mut keys = BTreeSet::new();
        let mut n_alone = 0;
        for row in &found.rows {
            let Some(values) = rows.finite_values(row)? else {
                self.leave_out(NOT_A_NUMBER.to_owned(), 1);
                continue;
            };
            let stamp = match join {
                TableJoin::Time { clock_offset_s, .. } => {
                    rows.time(row, &values)?.map(|stamp| stamp.plus_s(*clock_offset_s))
                }
                TableJoin::Key { .. } => self.stamps.get(&row.key).map(|(_, stamp)| *stamp),
            };
            let Some(stamp) = stamp else {
                n_alone += 1;
                continue;
            };
            self.matched.insert(row.key.clone());
            let tag = rows.detection(row, &values)?;
            if !keys.insert((stamp, tag.key())) {
                let problem = "has the pose and the tag (or corner) of a row before; leave one of them";
                return rows.problem(row, problem.to_owned());
            }
            let frame = || TagFrame { stamp, tags: Vec::new(), digests: Vec::new() };
            let frame = frames.entry(stamp).or_insert_with(frame);
            frame.tags.push(tag);
            frame.digests.push(digest(stamp, &values));
        }
        if let TableJoin::Key { tags, joints } = join {
            if frames.is_empty() && n_alone > 0 {
                return Err(self.no_match(rows.file, found, [tags, joints]));
            }
            self.leave_out(format!("rows of {} whose `{tags}` no row of the joints has", rows.file), n_alone);
            let n_unseen = self.stamps.keys().filter(|key| !self.matched.contains(*key)).count();
            self.leave_out(format!("rows of the joints whose `{joints}` no row of {} has", rows.file), n_unseen);
        }
        self.recording.frames = frames.into_values().collect();
        Ok(())
    }

    fn no_match(&self, file: &str, found: &Rows, [tags, joints]: [&String; 2]) -> InputError {
        let first = |key: Option<&String>| key.cloned().unwrap_or_default();
        let here = first(found.rows.first().map(|row| &row.key));
        let there = first(self.stamps.iter().min_by_key(|(_, (row, _))| *row).map(|(key, _)| key));
        let problem = format!(
            "none of its rows has a `{tags}` that is a `{joints}` of the joints' table: the first are {here:?} and \
             {there:?}. Name columns that agree as `key` and `joints_key` of tags.table in the input map, or the \
             tags' `time`"
        );
        InputError::Table { file: file.to_owned(), problem }
    }

    /// Compares the clocks of tables that are joined by time.
    fn finish(self, files: [&String; 2], map: &InputMap, join: &TableJoin) -> Result<ExternalRecording, InputError> {
        let mut recording = self.recording;
        let [joints, tags] = files;
        if recording.readings.is_empty() {
            let problem = "no row has a finite number in each column of the joints".to_owned();
            return Err(InputError::Table { file: joints.clone(), problem });
        }
        if matches!(join, TableJoin::Time { .. }) {
            let times = |topic: &String, stamps: Vec<Stamp>| StreamTimes {
                topic: topic.clone(),
                stamps,
                log_times: Vec::new(),
            };
            let of_joints = recording.readings.iter().map(|reading| reading.stamp).collect();
            let of_tags: Vec<Stamp> = recording.frames.iter().map(|frame| frame.stamp).collect();
            let doubt = compare_clocks(map.max_gap_s, times(joints, of_joints), times(tags, of_tags));
            recording.clock_doubt = doubt.map(|doubt| doubt.text);
        }
        Ok(recording)
    }
}

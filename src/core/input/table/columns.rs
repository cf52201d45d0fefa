//! The columns that an input map names, in one list.

use std::ops::Range;

use super::rows::{Row, Rows, Wanted};
use crate::input::error::InputError;
use crate::input::map::{InputMap, SeenColumns, TableJoin, TableLayout, TimeUnit};
use crate::robot::Robot;

/// Names of columns that an error lists.
const MAX_LISTED: usize = 30;

/// Indices of each quantity's columns in `names`; the joints of the robot come first.
pub(super) struct Columns {
    pub names: Vec<String>,
    /// Three columns of x, y, z, two of a pixel, or eight of four pixels.
    pub place: Range<usize>,
    /// Columns of the rotation, in the number of its form; none without a rotation.
    pub rotation: Range<usize>,
    pub time: Option<(usize, TimeUnit)>,
    pub id: Option<usize>,
    /// Column of the number of a tag's corner.
    pub corner: Option<usize>,
    /// Column of texts that joins two tables.
    pub key: Option<String>,
    pub part: Part,
}

/// The parts of a pose that a table has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    /// Joints and tags.
    Both,
    /// The joints' own table.
    Joints,
    /// The tags' own table.
    Tags,
}

impl Columns {
    pub fn of(map: &InputMap, layout: &TableLayout, robot: &Robot, part: Part) -> Self {
        let joints = robot.sensors.iter().filter(|_| part != Part::Tags);
        let mut names: Vec<String> = joints.map(|spec| map.recorded_name(&spec.joint).clone()).collect();
        let mut add = |columns: &[String]| {
            let start = names.len();
            names.extend_from_slice(columns);
            start..names.len()
        };
        let (of_place, of_rotation): (&[String], &[String]) = match &layout.seen {
            _ if part == Part::Joints => (&[], &[]),
            SeenColumns::Pose(pose) => (&pose.position, pose.rotation.as_ref().map_or(&[], |turn| &turn.columns)),
            SeenColumns::Pixel(pixel) | SeenColumns::TagCorner { pixel, .. } => (pixel, &[]),
            SeenColumns::TagCorners { columns, .. } => (columns, &[]),
        };
        let (place, rotation) = (add(of_place), add(of_rotation));
        let time = match (part, layout.tags.as_ref().map(|tags| &tags.join)) {
            (Part::Tags, Some(TableJoin::Time { time, .. })) => Some(time),
            (Part::Tags, _) => None,
            _ => layout.time.as_ref(),
        };
        let time = time.map(|time| (add(std::slice::from_ref(&time.column)).start, time.unit));
        let seen = (part != Part::Joints).then_some(layout);
        let id = seen.and_then(|layout| layout.id.as_ref()).map(|id| add(std::slice::from_ref(id)).start);
        let corner = match seen.map(|layout| &layout.seen) {
            Some(SeenColumns::TagCorner { corner, .. }) => Some(add(std::slice::from_ref(corner)).start),
            _ => None,
        };
        let key = match (part, layout.tags.as_ref().map(|tags| &tags.join)) {
            (Part::Joints, Some(TableJoin::Key { joints, .. })) => Some(joints.clone()),
            (Part::Tags, Some(TableJoin::Key { tags, .. })) => Some(tags.clone()),
            _ => None,
        };
        Self { names, place, rotation, time, id, corner, key, part }
    }

    pub fn wanted(&self) -> Wanted<'_> {
        Wanted { names: &self.names, time: self.time, id: self.id, key: self.key.as_ref() }
    }

    /// Sorts rows by their times, and returns the number of rows that were later than the next one. Rows without a time
    /// stay as they are.
    pub fn sort_by_time(&self, rows: &mut [Row]) -> u64 {
        let Some((at, _)) = self.time else { return 0 };
        if rows.iter().any(|row| row.values[at].is_none_or(f64::is_nan)) {
            return 0;
        }
        let time = |row: &Row| (row.date, row.values[at].unwrap_or_default());
        let order = |a: &Row, b: &Row| time(a).0.cmp(&time(b).0).then(time(a).1.total_cmp(&time(b).1));
        let n = rows.windows(2).filter(|two| order(&two[0], &two[1]).is_gt()).count();
        rows.sort_by(order);
        n as u64
    }

    /// Number of joints, whose columns come first.
    pub fn n_joints(&self) -> usize {
        self.place.start
    }

    /// Joints, by index, that the table has no column for.
    pub fn absent_joints(&self, found: &Rows) -> Vec<usize> {
        (0..self.n_joints()).filter(|&joint| !found.columns.contains(&self.names[joint])).collect()
    }

    /// Checks that the table has all columns but those of joints that may be absent.
    pub fn check_present(&self, file: &str, found: &Rows, n_needed: usize) -> Result<(), InputError> {
        let n_joints = self.n_joints();
        let is_missing =
            |(k, name): &(usize, &String)| !(n_needed..n_joints).contains(k) && !found.columns.contains(*name);
        let missing = self.names.iter().chain(&self.key).enumerate().filter(is_missing);
        let missing: Vec<&String> = missing.map(|(_, name)| name).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let joints = missing.iter().filter(|name| self.names[..n_joints].contains(**name)).count();
        let two = match self.part {
            Part::Both
                if joints >= n_needed.max(1)
                    || self.names[self.place.clone()].iter().all(|name| missing.contains(&name)) =>
            {
                ". Where joints and tags are in two tables, `armcal inspect ONE OTHER --write-input MAP.toml` proposes \
                 a map that joins them"
            }
            Part::Joints if joints >= n_needed.max(1) => {
                ". With `tags.table` in the input map, give the table of the joints as the recording"
            }
            _ => "",
        };
        let there: Vec<&String> = found.columns.iter().take(MAX_LISTED).collect();
        let problem = format!(
            "no column {missing:?}; it has {there:?}. Joints' columns go into `joint_sensors.names` of the input map, \
             the others into `tags.columns` and `table`{two}"
        );
        Err(InputError::Table { file: file.to_owned(), problem })
    }
}

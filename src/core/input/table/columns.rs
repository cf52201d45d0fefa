//! The columns that an input map names, in one list.

use std::ops::Range;

use super::rows::Rows;
use crate::input::error::InputError;
use crate::input::map::{InputMap, SeenColumns, TableLayout};
use crate::robot::Robot;

/// Names of columns that an error lists.
const MAX_LISTED: usize = 30;

/// Where in `names` the columns of each quantity are; the joints of the robot come first.
pub(super) struct Columns {
    pub names: Vec<String>,
    /// Three, of x, y, z, or two, of a pixel, or eight, of four.
    pub place: Range<usize>,
    /// As many as the form has; none without a rotation.
    pub rotation: Range<usize>,
    pub time: Option<usize>,
    pub id: Option<usize>,
    /// Number of a tag's corner.
    pub corner: Option<usize>,
}

impl Columns {
    pub fn of(map: &InputMap, layout: &TableLayout, robot: &Robot) -> Self {
        let mut names: Vec<String> = robot.sensors.iter().map(|spec| map.recorded_name(&spec.joint).clone()).collect();
        let mut add = |columns: &[String]| {
            let start = names.len();
            names.extend_from_slice(columns);
            start..names.len()
        };
        let (of_place, of_rotation): (&[String], &[String]) = match &layout.seen {
            SeenColumns::Pose(pose) => (&pose.position, pose.rotation.as_ref().map_or(&[], |turn| &turn.columns)),
            SeenColumns::Pixel(pixel) | SeenColumns::TagCorner { pixel, .. } => (pixel, &[]),
            SeenColumns::TagCorners { columns, .. } => (columns, &[]),
        };
        let (place, rotation) = (add(of_place), add(of_rotation));
        let time = layout.time.as_ref().map(|time| add(std::slice::from_ref(&time.column)).start);
        let id = layout.id.as_ref().map(|id| add(std::slice::from_ref(id)).start);
        let corner = match &layout.seen {
            SeenColumns::TagCorner { corner, .. } => Some(add(std::slice::from_ref(corner)).start),
            _ => None,
        };
        Self { names, place, rotation, time, id, corner }
    }

    /// Checks that the table has all columns but those of joints that may be absent.
    pub fn check_present(&self, file: &str, found: &Rows, n_needed: usize) -> Result<(), InputError> {
        let n_joints = self.place.start;
        let missing =
            |(k, name): &(usize, &String)| !(n_needed..n_joints).contains(k) && !found.columns.contains(*name);
        let missing: Vec<&String> = self.names.iter().enumerate().filter(missing).map(|(_, name)| name).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let there: Vec<&String> = found.columns.iter().take(MAX_LISTED).collect();
        let problem = format!(
            "no column {missing:?}; it has {there:?}. Joints' columns go into `joint_sensors.names` of the input map, \
             the others into `tags.columns` and `table`"
        );
        Err(InputError::Table { file: file.to_owned(), problem })
    }
}

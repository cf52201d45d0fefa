//! Reader of a row: its numbers as the table states them, and the camera's measurement that they hold.

use nalgebra::Isometry3;

use super::columns::Columns;
use super::pose::camera_from_tag;
use super::rows::Row;
use crate::input::error::{BadPlace, InputError};
use crate::input::map::{CornerOrder, InputMap, NotFinite, SeenColumns, TableLayout, TagUse};
use crate::input::tags::{ExternalDetection, MIN_DISTANCE_M, RawMeasurement};
use crate::joints::JointCounts;
use crate::robot::Robot;
use crate::time::Stamp;

/// The largest time, ns: the year 2262.
pub(super) const MAX_NANOS: f64 = 9.2e18;

/// A table with the meaning of its columns.
#[derive(Clone, Copy)]
pub(super) struct RowReader<'a> {
    pub file: &'a str,
    pub map: &'a InputMap,
    pub layout: &'a TableLayout,
    pub robot: &'a Robot,
    pub columns: &'a Columns,
    /// Joints without a column.
    pub absent_joints: &'a [usize],
}

impl RowReader<'_> {
    pub fn problem<T>(&self, row: &Row, problem: String) -> Result<T, InputError> {
        Err(InputError::Row { file: self.file.to_owned(), place: BadPlace::Row(row.number), problem })
    }

    /// Returns the row's values, zero for absent joints; `None` if one is missing or not finite and such rows are left
    /// out.
    pub fn finite_values(&self, row: &Row) -> Result<Option<Vec<f64>>, InputError> {
        let mut values = Vec::with_capacity(row.values.len());
        for (k, value) in row.values.iter().enumerate() {
            let column = &self.columns.names[k];
            match value {
                None if self.absent_joints.contains(&k) => values.push(0.0),
                None if self.map.not_finite == NotFinite::LeaveOut => return Ok(None),
                None => {
                    let remedy = "fill it in, or leave such rows out with not_finite = \"leave_out\" in the input map";
                    return self.problem(row, format!("has no value in the column `{column}`; {remedy}"));
                }
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

    pub fn counts(&self, values: &[f64]) -> JointCounts {
        JointCounts::from_fn(self.robot.n_joints(), |joint| {
            if self.absent_joints.contains(&joint) {
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

    /// Returns the position of the row's corner in armcal's order.
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

    pub fn detection(&self, row: &Row, values: &[f64]) -> Result<ExternalDetection, InputError> {
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

    /// Returns the row's time; `None` if the input map names no column of times.
    pub fn time(&self, row: &Row, values: &[f64]) -> Result<Option<Stamp>, InputError> {
        let Some((at, unit)) = self.columns.time else { return Ok(None) };
        let Some(unit_nanos) = unit.nanos() else { return Ok(row.date) };
        let nanos = values[at] * unit_nanos;
        if !(0.0..=MAX_NANOS).contains(&nanos) {
            return self.problem(row, format!("the time {} is no time after 1970", values[at]));
        }
        Ok(Some(Stamp { nanos: nanos.round() as i64 }))
    }
}

/// Hash of the row's values and its time.
pub(super) fn digest(stamp: Stamp, values: &[f64]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"armcal table row 1");
    hasher.update(&stamp.nanos.to_le_bytes());
    for value in values {
        hasher.update(&value.to_le_bytes());
    }
    *hasher.finalize().as_bytes()
}

//! Data that a viewer has of a run in progress, so that each row is sent once.

use std::collections::BTreeMap;

use crate::rerun::SerializedComponentBatch;
use nalgebra::Isometry3;

/// Largest delay of a drawn row, s: a mark is recorded when its span is over.
const LATE_S: f64 = 60.0;

/// Data that were sent to a viewer.
#[derive(Default)]
pub(super) struct Shown {
    rows: BTreeMap<String, BTreeMap<i64, Rows>>,
    fixed: BTreeMap<String, Vec<SerializedComponentBatch>>,
    poses: BTreeMap<String, Isometry3<f64>>,
    /// Rows before this time were sent, or are too old, ns.
    since_nanos: Option<i64>,
    newest_nanos: i64,
}

/// Counts of the rows of one entity and time.
#[derive(Clone, Copy, Default)]
struct Rows {
    sent: usize,
    /// Rows in the present drawing.
    drawn: usize,
}

impl Shown {
    /// Counts a row of the present drawing; returns true if it must be sent.
    pub fn note_row(&mut self, entity: &str, nanos: i64) -> bool {
        if self.since_nanos.is_some_and(|since| nanos < since) {
            return false;
        }
        self.newest_nanos = self.newest_nanos.max(nanos);
        if !self.rows.contains_key(entity) {
            self.rows.insert(entity.to_owned(), BTreeMap::new());
        }
        let Some(rows) = self.rows.get_mut(entity) else { return true };
        let rows = rows.entry(nanos).or_default();
        rows.drawn += 1;
        let is_new = rows.drawn > rows.sent;
        rows.sent = rows.sent.max(rows.drawn);
        is_new
    }

    /// Stores data without a time; returns true if they must be sent, because they are new or have changed.
    pub fn note_fixed(&mut self, entity: &str, batches: &[SerializedComponentBatch]) -> bool {
        let is_new = self.fixed.get(entity).is_none_or(|sent| !is_same(sent, batches));
        if is_new {
            self.fixed.insert(entity.to_owned(), batches.to_vec());
        }
        is_new
    }

    pub fn has(&self, entity: &str) -> bool {
        self.fixed.contains_key(entity)
    }

    pub fn pose(&self, entity: &str) -> Option<Isometry3<f64>> {
        self.poses.get(entity).copied()
    }

    pub fn note_pose(&mut self, entity: &str, pose: &Isometry3<f64>) {
        self.poses.insert(entity.to_owned(), *pose);
    }

    /// Ends the present drawing, and forgets rows that are too old to be drawn again.
    pub fn end_drawing(&mut self) {
        let since = self.newest_nanos - (1e9 * LATE_S) as i64;
        self.since_nanos = Some(since);
        for rows in self.rows.values_mut() {
            *rows = rows.split_off(&since);
            rows.values_mut().for_each(|rows| rows.drawn = 0);
        }
    }
}

fn is_same(sent: &[SerializedComponentBatch], batches: &[SerializedComponentBatch]) -> bool {
    let mut pairs = sent.iter().zip(batches);
    sent.len() == batches.len() && pairs.all(|(a, b)| a.descriptor == b.descriptor && *a.array == *b.array)
}

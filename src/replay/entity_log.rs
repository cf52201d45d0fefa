//! Rows of entities, and the chunks that an .rrd file holds.
//!
//! Rerun's recording stream numbers its rows and chunks by clock and random numbers, and batches them on a thread. Here
//! the identities of chunks and rows count up from a fixed one, so that the same input gives the same bytes.

use std::collections::BTreeMap;

use crate::rerun::log::{Chunk, ChunkId, RowId, TimeColumn};
use crate::rerun::time::{TimeCell, TimePoint, Timeline};
use crate::rerun::{AsComponents, Clear, EntityPath, SerializedComponentBatch, Transform3D};
use nalgebra::Isometry3;
use re_log_encoding::EncodeError;
use re_log_types::external::re_tuid::Tuid;
use re_sdk_types::external::arrow::array::{Array, ListArray};
use re_sdk_types::external::arrow::buffer::{NullBuffer, OffsetBuffer};
use re_sdk_types::external::arrow::datatypes::Field;

use crate::poses::{quaternion, transform, vector};
use crate::shown::Shown;

/// The one timeline of a recording: seconds since its first log time.
pub(super) const TIMELINE: &str = "sim_time";
/// Number of rows in a chunk; the viewer seeks by chunks.
const CHUNK_ROWS: usize = 1000;
/// Number of identities reserved for each chunk and its rows.
const CHUNK_STRIDE: u64 = 1 << 16;
/// Time in the identities of rows. The viewer regards rows of a later time as newer, so a user's changes of the layout
/// must have a later time than ours.
pub(super) const IDENTITY_NANOS: u64 = 1_000_000_000;

/// One row of an entity: time in nanoseconds, and data.
type Row = (i64, RowData);

/// Data of a row. Most rows are poses: they become columns only when a chunk is full.
enum RowData {
    Batches(Vec<SerializedComponentBatch>),
    Pose(Isometry3<f64>),
}

/// Rows of one entity; those of full chunks are packed, which takes a tenth of the memory.
#[derive(Default)]
struct Rows {
    packed: Vec<Chunk>,
    open: Vec<Row>,
}

/// Drawn data by entity; entities are written in the order of their names.
pub(super) struct EntityLog {
    timeline: &'static str,
    cell: fn(i64) -> TimeCell,
    fixed: BTreeMap<String, Vec<SerializedComponentBatch>>,
    rows: BTreeMap<String, Rows>,
    /// Ends of an entity's data, in separate chunks: the viewer panics if one chunk has images and their end.
    ends: BTreeMap<String, Rows>,
    failure: Option<EncodeError>,
    /// Data that the viewer already has, which are not logged again.
    shown: Option<Shown>,
}

impl EntityLog {
    /// Starts the log of a recording, over time.
    pub fn of_recording() -> Self {
        Self::on(TIMELINE, TimeCell::from_duration_nanos)
    }

    /// Starts the log of a recording in progress, without the rows in `shown`.
    pub fn of_news(shown: Shown) -> Self {
        Self { shown: Some(shown), ..Self::of_recording() }
    }

    /// Starts the log of a blueprint.
    pub fn of_blueprint() -> Self {
        Self::on("blueprint", TimeCell::from_sequence)
    }

    fn on(timeline: &'static str, cell: fn(i64) -> TimeCell) -> Self {
        let (fixed, rows, ends) = Default::default();
        Self { timeline, cell, fixed, rows, ends, failure: None, shown: None }
    }

    /// Logs data without a time.
    pub fn log_static(&mut self, entity: &str, what: &dyn AsComponents) {
        self.fixed.entry(entity.to_owned()).or_default().extend(what.as_serialized_batches());
    }

    /// Logs data from `time_s` on.
    pub fn draw(&mut self, entity: &str, time_s: f64, what: &dyn AsComponents) {
        self.push(entity, time_s, || RowData::Batches(what.as_serialized_batches()));
    }

    /// Logs the pose of the entity in its parent, from `time_s` on.
    pub fn draw_pose(&mut self, entity: &str, time_s: f64, pose: &Isometry3<f64>) {
        self.push(entity, time_s, || RowData::Pose(*pose));
    }

    fn push(&mut self, entity: &str, time_s: f64, data: impl FnOnce() -> RowData) {
        let nanos = (time_s * 1e9).round() as i64;
        if !self.is_new(entity, nanos) {
            return;
        }
        if !self.rows.contains_key(entity) {
            self.rows.insert(entity.to_owned(), Rows::default());
        }
        let Some(rows) = self.rows.get_mut(entity) else { return };
        rows.open.push((nanos, data()));
        if rows.open.len() == CHUNK_ROWS
            && let Err(error) = rows.pack(entity, self.timeline, self.cell)
        {
            self.failure.get_or_insert(error);
        }
    }

    /// Ends what the entity shows at `time_s`.
    pub fn clear(&mut self, entity: &str, time_s: f64) {
        let nanos = (time_s * 1e9).round() as i64;
        if self.is_new(&format!("{entity}, end"), nanos) {
            let end = (nanos, RowData::Batches(Clear::flat().as_serialized_batches()));
            self.ends.entry(entity.to_owned()).or_default().open.push(end);
        }
    }

    fn is_new(&mut self, row: &str, nanos: i64) -> bool {
        self.shown.as_mut().is_none_or(|shown| shown.note_row(row, nanos))
    }

    /// Returns true if this entity was shown before; it never changes and takes long to draw.
    pub fn is_shown(&self, entity: &str) -> bool {
        self.shown.as_ref().is_some_and(|shown| shown.has(entity))
    }

    /// Returns the last shown pose of a moving entity.
    pub fn shown_pose(&self, entity: &str) -> Option<Isometry3<f64>> {
        self.shown.as_ref()?.pose(entity)
    }

    /// Stores the shown pose of a moving entity.
    pub fn note_pose(&mut self, entity: &str, pose: &Isometry3<f64>) {
        if let Some(shown) = &mut self.shown {
            shown.note_pose(entity, pose);
        }
    }

    /// Returns the data shown up to the end of this drawing, and the new chunks.
    pub fn into_news(mut self) -> Result<(Shown, Vec<Chunk>), EncodeError> {
        let mut shown = self.shown.take().unwrap_or_default();
        self.fixed.retain(|entity, batches| shown.note_fixed(entity, batches));
        shown.end_drawing();
        Ok((shown, self.into_chunks()?))
    }

    /// Returns the chunks: entities without a time, then those with one, then the ends, each in the order of their
    /// names.
    pub fn into_chunks(self) -> Result<Vec<Chunk>, EncodeError> {
        if let Some(error) = self.failure {
            return Err(error);
        }
        let mut ids = (1u64..).map(|n| Tuid::from_nanos_and_inc(IDENTITY_NANOS, n * CHUNK_STRIDE));
        let mut next_id = || ids.next().unwrap_or(Tuid::MAX);
        let mut chunks = Vec::new();
        for (entity, batches) in self.fixed {
            let id = next_id();
            let chunk = Chunk::builder_with_id(ChunkId::from_tuid(id), EntityPath::parse_forgiving(&entity))
                .with_serialized_batches(RowId::from_tuid(id.next()), TimePoint::default(), batches);
            chunks.push(chunk.build()?);
        }
        for (entity, mut rows) in self.rows.into_iter().chain(self.ends) {
            rows.pack(&entity, self.timeline, self.cell)?;
            for chunk in rows.packed {
                let id = next_id();
                chunks.push(chunk.clone_as(ChunkId::from_tuid(id), RowId::from_tuid(id.next())));
            }
        }
        Ok(chunks)
    }
}

impl Rows {
    /// Packs the open rows into chunks, whose identities are given later.
    fn pack(&mut self, entity: &str, timeline: &'static str, cell: fn(i64) -> TimeCell) -> Result<(), EncodeError> {
        let entity = EntityPath::parse_forgiving(entity);
        let mut rows = std::mem::take(&mut self.open);
        while !rows.is_empty() {
            let later = rows.split_off(rows.len().min(CHUNK_ROWS));
            let is_pose = |row: &Row| matches!(row.1, RowData::Pose(_));
            let chunk = if rows.iter().all(is_pose) { poses_chunk } else { batches_chunk };
            self.packed.push(chunk(entity.clone(), timeline, cell, rows)?);
            rows = later;
        }
        Ok(())
    }
}

/// Returns the provisional identity of a chunk, and the identities of its rows.
fn identities() -> (ChunkId, impl Iterator<Item = RowId>) {
    let id = Tuid::from_nanos_and_inc(IDENTITY_NANOS, 0);
    (ChunkId::from_tuid(id), (1u64..).map(move |n| RowId::from_tuid(id.incremented_by(n))))
}

fn batches_chunk(
    entity: EntityPath,
    timeline: &'static str,
    cell: fn(i64) -> TimeCell,
    rows: Vec<Row>,
) -> Result<Chunk, EncodeError> {
    let (id, row_ids) = identities();
    let mut chunk = Chunk::builder_with_id(id, entity);
    for ((nanos, data), row_id) in rows.into_iter().zip(row_ids) {
        let batches = match data {
            RowData::Batches(batches) => batches,
            RowData::Pose(pose) => transform(&pose).as_serialized_batches(),
        };
        chunk = chunk.with_serialized_batches(row_id, [(timeline, cell(nanos))], batches);
    }
    Ok(chunk.build()?)
}

/// Returns a chunk that has only poses, written column by column: row by row it takes ten times as long.
fn poses_chunk(
    entity: EntityPath,
    timeline: &'static str,
    cell: fn(i64) -> TimeCell,
    rows: Vec<Row>,
) -> Result<Chunk, EncodeError> {
    let (id, row_ids) = identities();
    let row_ids: Vec<RowId> = row_ids.take(rows.len()).collect();
    let times: Vec<i64> = rows.iter().map(|(nanos, _)| cell(*nanos).value.get()).collect();
    let times = TimeColumn::new(None, Timeline::new(timeline, cell(0).typ()), times.into());
    let poses = || rows.iter().filter_map(|(_, data)| if let RowData::Pose(pose) = data { Some(pose) } else { None });
    let columns = Transform3D::new()
        .with_many_translation(poses().map(|pose| vector(&pose.translation.vector)))
        .with_many_quaternion(poses().map(|pose| quaternion(&pose.rotation)));
    let one_each = |batch: SerializedComponentBatch| {
        let field = Field::new_list_field(batch.array.data_type().clone(), true);
        let lengths = OffsetBuffer::from_lengths(std::iter::repeat_n(1, batch.array.len()));
        let all = NullBuffer::new_valid(batch.array.len());
        (batch.descriptor, ListArray::new(field.into(), lengths, batch.array, Some(all)))
    };
    let components = columns.as_serialized_batches().into_iter().map(one_each).collect();
    let timelines = std::iter::once((*times.timeline().name(), times)).collect();
    Ok(Chunk::from_native_row_ids(id, entity, None, &row_ids, timelines, components)?)
}

#[cfg(test)]
mod tests {
    use crate::rerun::log::LogMsg;
    use crate::rerun::{StoreId, StoreKind};
    use nalgebra::{UnitQuaternion, Vector3};
    use re_log_encoding::{Encoder, EncodingOptions};

    use super::*;

    fn bytes(chunk: &Chunk) -> Vec<u8> {
        let mut out = Vec::new();
        let version = crate::rerun::CrateVersion::LOCAL;
        let mut encoder = Encoder::new_eager(version, EncodingOptions::PROTOBUF_COMPRESSED, &mut out).unwrap();
        encoder.do_not_emit_footer();
        let store = StoreId::new(StoreKind::Recording, "test", "test");
        encoder.append(&LogMsg::ArrowMsg(store, chunk.to_arrow_msg().unwrap())).unwrap();
        encoder.finish().unwrap();
        drop(encoder);
        out
    }

    /// A chunk of poses has the same bytes, whether it is written by columns or by rows.
    #[test]
    fn a_chunk_of_poses_is_the_same_by_columns_as_by_rows() {
        let pose = |n: i64| {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.1 * n as f64, -0.3, 0.2));
            (n * 40_000_000, RowData::Pose(Isometry3::from_parts(Vector3::new(n as f64, 0.5, -1.0).into(), turn)))
        };
        let rows = || (0..700).map(pose).collect();
        let (entity, cell) = (EntityPath::from("arm/link"), TimeCell::from_duration_nanos);
        let by_columns = poses_chunk(entity.clone(), TIMELINE, cell, rows()).unwrap();
        let by_rows = batches_chunk(entity, TIMELINE, cell, rows()).unwrap();
        assert!(by_columns.num_rows() == 700 && bytes(&by_columns) == bytes(&by_rows));
    }
}

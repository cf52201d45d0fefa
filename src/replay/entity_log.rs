//! Rows of entities, and the chunks that an .rrd file holds.
//!
//! Rerun's recording stream numbers its rows and chunks by clock and chance and batches them on a thread. Here the
//! identities of chunks and rows count up from a fixed one, so that the same input gives the same bytes.

use std::collections::BTreeMap;

use rerun::external::re_log_encoding::EncodeError;
use rerun::external::re_log_types::external::re_tuid::Tuid;
use rerun::log::{Chunk, ChunkId, RowId};
use rerun::time::{TimeCell, TimePoint};
use rerun::{AsComponents, Clear, EntityPath, SerializedComponentBatch};

/// The one timeline of a recording: seconds since its first log time.
pub(super) const TIMELINE: &str = "sim_time";
/// Rows in a chunk; the viewer seeks by chunks.
const CHUNK_ROWS: usize = 1000;
/// Identities that each chunk and its rows may use up.
const CHUNK_STRIDE: u64 = 1 << 16;
/// The viewer holds rows of a later time for newer, so that what a user changes in the layout must come after ours.
pub(super) const IDENTITY_NANOS: u64 = 1_000_000_000;

/// One row of an entity: time in nanoseconds, and data.
type Row = (i64, Vec<SerializedComponentBatch>);

/// Drawn data by entity; entities are written in the order of their names.
#[derive(Default)]
pub(super) struct EntityLog {
    fixed: BTreeMap<String, Vec<SerializedComponentBatch>>,
    rows: BTreeMap<String, Vec<Row>>,
    /// Ends of what an entity shows, in chunks of their own: the viewer panics where one chunk of images has both.
    ends: BTreeMap<String, Vec<Row>>,
}

impl EntityLog {
    /// Logs data without a time.
    pub fn log_static(&mut self, entity: &str, what: &dyn AsComponents) {
        self.fixed.entry(entity.to_owned()).or_default().extend(what.as_serialized_batches());
    }

    /// Logs data from `time_s` on. Times of one entity must not go backwards.
    pub fn draw(&mut self, entity: &str, time_s: f64, what: &dyn AsComponents) {
        self.rows.entry(entity.to_owned()).or_default().push(row(time_s, what));
    }

    /// The entity shows nothing from `time_s` on. Times of one entity must not go backwards.
    pub fn clear(&mut self, entity: &str, time_s: f64) {
        self.ends.entry(entity.to_owned()).or_default().push(row(time_s, &Clear::flat()));
    }

    /// Chunks in the order of the entities' names: what has no time, what has one, and the ends.
    pub fn into_chunks(self, timeline: &'static str, cell: fn(i64) -> TimeCell) -> Result<Vec<Chunk>, EncodeError> {
        let mut ids = (1u64..).map(|n| Tuid::from_nanos_and_inc(IDENTITY_NANOS, n * CHUNK_STRIDE));
        let mut next_id = || ids.next().unwrap_or(Tuid::MAX);
        let mut chunks = Vec::new();
        for (entity, batches) in self.fixed {
            let id = next_id();
            let chunk = Chunk::builder_with_id(ChunkId::from_tuid(id), EntityPath::parse_forgiving(&entity))
                .with_serialized_batches(RowId::from_tuid(id.next()), TimePoint::default(), batches);
            chunks.push(chunk.build()?);
        }
        for (entity, rows) in self.rows.into_iter().chain(self.ends) {
            let entity = EntityPath::parse_forgiving(&entity);
            let mut rows = rows.into_iter().peekable();
            while rows.peek().is_some() {
                let id = next_id();
                let mut chunk = Chunk::builder_with_id(ChunkId::from_tuid(id), entity.clone());
                for (n, (nanos, batches)) in rows.by_ref().take(CHUNK_ROWS).enumerate() {
                    let row_id = RowId::from_tuid(id.incremented_by(1 + n as u64));
                    chunk = chunk.with_serialized_batches(row_id, [(timeline, cell(nanos))], batches);
                }
                chunks.push(chunk.build()?);
            }
        }
        Ok(chunks)
    }
}

fn row(time_s: f64, what: &dyn AsComponents) -> Row {
    ((time_s * 1e9).round() as i64, what.as_serialized_batches())
}

//! Collects what is drawn and writes it as an .rrd, byte for byte the same for the same input.
//!
//! Rerun's recording stream numbers its rows and chunks by clock and chance and batches them on a thread. Here the chunks
//! are put together by hand, with identities counted up from fixed ones, and encoded at the end.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use rerun::AsComponents;
use rerun::external::re_log_encoding::{EncodeError, Encoder, EncodingOptions};
use rerun::external::re_log_types::external::re_tuid::Tuid;
use rerun::external::re_log_types::{BlueprintActivationCommand, SetStoreInfo, StoreInfo, StoreSource};
use rerun::log::{Chunk, ChunkId, LogMsg, RowId};
use rerun::time::{TimeCell, TimePoint};
use rerun::{EntityPath, SerializedComponentBatch, StoreId, StoreKind};

use crate::error::ReplayError;
use crate::{ReplayInput, layout};
use armcal_core::log::MessageHasher;
use armcal_core::robot::Robot;

/// The one timeline of a recording: seconds since its first log time.
pub(super) const TIMELINE: &str = "sim_time";
const APPLICATION: &str = "armcal";
/// Rows in a chunk; the viewer seeks by chunks.
const CHUNK_ROWS: usize = 1000;
/// Identities that each chunk and its rows may use up.
const CHUNK_STRIDE: u64 = 1 << 16;
/// The viewer holds rows of a later time for newer, so that what a user changes in the layout must come after ours.
const IDENTITY_NANOS: u64 = 1_000_000_000;

/// One row of an entity: its time in nanoseconds and what it holds.
type Row = (i64, Vec<SerializedComponentBatch>);

/// What is drawn, by entity; entities are written in the order of their names.
#[derive(Default)]
pub(super) struct EntityLog {
    fixed: BTreeMap<String, Vec<SerializedComponentBatch>>,
    rows: BTreeMap<String, Vec<Row>>,
}

impl EntityLog {
    /// Draws something that holds at all times.
    pub fn log_static(&mut self, entity: &str, what: &dyn AsComponents) {
        self.fixed.entry(entity.to_owned()).or_default().extend(what.as_serialized_batches());
    }

    /// Draws something that holds from `time_s` on. Times of one entity must not go backwards.
    pub fn draw(&mut self, entity: &str, time_s: f64, what: &dyn AsComponents) {
        let nanos = (time_s * 1e9).round() as i64;
        self.rows.entry(entity.to_owned()).or_default().push((nanos, what.as_serialized_batches()));
    }

    fn into_chunks(self, timeline: &'static str, cell: fn(i64) -> TimeCell) -> Result<Vec<Chunk>, EncodeError> {
        let mut ids = (1u64..).map(|n| Tuid::from_nanos_and_inc(IDENTITY_NANOS, n * CHUNK_STRIDE));
        let mut next_id = || ids.next().unwrap_or(Tuid::MAX);
        let mut chunks = Vec::new();
        for (entity, batches) in self.fixed {
            let id = next_id();
            let chunk = Chunk::builder_with_id(ChunkId::from_tuid(id), EntityPath::parse_forgiving(&entity))
                .with_serialized_batches(RowId::from_tuid(id.next()), TimePoint::default(), batches);
            chunks.push(chunk.build()?);
        }
        for (entity, rows) in self.rows {
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

/// What tells one recording from another in the viewer: a hash of everything that shapes the file.
pub(super) struct Identity {
    recording_id: String,
}

impl Identity {
    /// Hashes the recording's messages, the truth file and the rest of what is shown.
    pub fn of(input: &ReplayInput) -> Result<Self, ReplayError> {
        let mut hasher = blake3::Hasher::new();
        let mut messages = MessageHasher::new(&input.recording.joint_names);
        for (log_time, message) in &input.recording.messages {
            // A message that no file could hold (it was made, not read) is left out of the hash, not of the picture.
            let _ = messages.add(*log_time, message);
        }
        hasher.update(messages.hex().as_bytes());
        if let Some(path) = input.truth {
            let read = File::open(path).and_then(|file| hasher.update_reader(file).map(|_| ()));
            read.map_err(|source| armcal_core::log::LogError::Read { path: path.to_owned(), source })?;
        }
        // Where the robot's drawings lie does not matter.
        let robot = Robot { folder: PathBuf::new(), ..input.robot.clone() };
        // What a robot or a vehicle may lack is not in the identity of one that does.
        let drawings = format!("{robot:?}{:?}{:?}", input.vehicle, input.scene);
        hasher.update(drawings.replace("gripper_tag: None, ", "").replace("lights: [], ", "").as_bytes());
        hasher.update(input.summary_markdown.unwrap_or_default().as_bytes());
        Ok(Self { recording_id: hasher.finalize().to_hex()[..32].to_owned() })
    }
}

/// Writes the layout, then what is drawn.
pub(super) fn write(
    out: &Path,
    identity: &Identity,
    layout: &[layout::Entry],
    drawn: EntityLog,
) -> Result<(), ReplayError> {
    let file = File::create(out).map_err(|source| ReplayError::Create { path: out.to_owned(), source })?;
    encode(BufWriter::new(file), identity, layout, drawn)
        .map_err(|source| ReplayError::Encode { path: out.to_owned(), source })
}

fn encode(
    file: impl Write,
    identity: &Identity,
    layout: &[layout::Entry],
    drawn: EntityLog,
) -> Result<(), EncodeError> {
    let recording = StoreId::new(StoreKind::Recording, APPLICATION, identity.recording_id.clone());
    let blueprint = StoreId::new(StoreKind::Blueprint, APPLICATION, format!("layout-{}", identity.recording_id));
    let version = rerun::build_info().version;
    let mut encoder = Encoder::new_eager(version, EncodingOptions::PROTOBUF_COMPRESSED, file)?;
    // A footer is an index that viewers do without, and the encoder orders it by chance.
    encoder.do_not_emit_footer();
    encoder.append(&store_info(&recording))?;
    encoder.append(&store_info(&blueprint))?;
    let mut layout_stream = EntityLog::default();
    for entry in layout {
        layout_stream.draw(&entry.path, 0.0, entry.what.as_ref());
    }
    for chunk in layout_stream.into_chunks("blueprint", TimeCell::from_sequence)? {
        encoder.append(&LogMsg::ArrowMsg(blueprint.clone(), chunk.to_arrow_msg()?))?;
    }
    let command = BlueprintActivationCommand { blueprint_id: blueprint, make_active: true, make_default: true };
    encoder.append(&LogMsg::BlueprintActivationCommand(command))?;
    for chunk in drawn.into_chunks(TIMELINE, TimeCell::from_duration_nanos)? {
        encoder.append(&LogMsg::ArrowMsg(recording.clone(), chunk.to_arrow_msg()?))?;
    }
    encoder.finish()?;
    encoder.flush_blocking()
}

fn store_info(store: &StoreId) -> LogMsg {
    let source = StoreSource::Other("armcal".to_owned());
    LogMsg::SetStoreInfo(SetStoreInfo {
        row_id: Tuid::from_nanos_and_inc(IDENTITY_NANOS, 0),
        info: StoreInfo::new(store.clone(), source),
    })
}

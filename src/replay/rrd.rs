//! The .rrd file: the blueprint, then all entities.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use crate::rerun::log::LogMsg;
use crate::rerun::{StoreId, StoreKind};
use re_log_encoding::{EncodeError, Encoder, EncodingOptions};
use re_log_types::external::re_tuid::Tuid;
use re_log_types::{BlueprintActivationCommand, SetStoreInfo, StoreInfo, StoreSource};

use crate::blueprint::Entry;
use crate::entity_log::{EntityLog, IDENTITY_NANOS};
use crate::error::ReplayError;
use crate::identity::Identity;

pub(super) const APPLICATION: &str = "armcal";

/// Writes the blueprint, then the entities.
pub(super) fn write(out: &Path, identity: &Identity, blueprint: &[Entry], drawn: EntityLog) -> Result<(), ReplayError> {
    let file = File::create(out).map_err(|source| ReplayError::Create { path: out.to_owned(), source })?;
    encode(BufWriter::new(file), identity, blueprint, drawn)
        .map_err(|source| ReplayError::Encode { path: out.to_owned(), source })
}

fn encode(file: impl Write, identity: &Identity, entries: &[Entry], drawn: EntityLog) -> Result<(), EncodeError> {
    let recording = StoreId::new(StoreKind::Recording, APPLICATION, identity.recording_id.clone());
    let version = crate::rerun::CrateVersion::LOCAL;
    let mut encoder = Encoder::new_eager(version, EncodingOptions::PROTOBUF_COMPRESSED, file)?;
    // The footer is an optional index, and the encoder orders it randomly.
    encoder.do_not_emit_footer();
    encoder.append(&store_info(&recording))?;
    for message in layout(&recording, &format!("layout-{}", identity.recording_id), entries)? {
        encoder.append(&message)?;
    }
    for chunk in drawn.into_chunks()? {
        encoder.append(&LogMsg::ArrowMsg(recording.clone(), chunk.to_arrow_msg()?))?;
    }
    encoder.finish()?;
    encoder.flush_blocking()
}

/// Returns the messages of a layout for the application of `recording`, and the command to use it.
pub(super) fn layout(recording: &StoreId, id: &str, entries: &[Entry]) -> Result<Vec<LogMsg>, EncodeError> {
    let blueprint = StoreId::new(StoreKind::Blueprint, recording.application_id().clone(), id);
    let mut log = EntityLog::of_blueprint();
    for entry in entries {
        log.draw(&entry.path, 0.0, entry.what.as_ref());
    }
    let mut messages = vec![store_info(&blueprint)];
    for chunk in log.into_chunks()? {
        messages.push(LogMsg::ArrowMsg(blueprint.clone(), chunk.to_arrow_msg()?));
    }
    let command = BlueprintActivationCommand { blueprint_id: blueprint, make_active: true, make_default: true };
    messages.push(LogMsg::BlueprintActivationCommand(command));
    Ok(messages)
}

pub(super) fn store_info(store: &StoreId) -> LogMsg {
    let source = StoreSource::Other("armcal".to_owned());
    LogMsg::SetStoreInfo(SetStoreInfo {
        row_id: Tuid::from_nanos_and_inc(IDENTITY_NANOS, 0),
        info: StoreInfo::new(store.clone(), source),
    })
}

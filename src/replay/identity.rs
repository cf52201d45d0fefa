//! Identity of a recording in the viewer.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::error::ReplayError;
use crate::scene::ReplayInput;
use armcal_core::files;
use armcal_core::log::MessageHasher;
use armcal_core::robot::{Robot, Vehicle};

/// Recording id in the viewer: a hash of all data that shape the file. Another version of the program may give another
/// id.
pub(super) struct Identity {
    pub recording_id: String,
}

impl Identity {
    /// Hashes the recording's messages, the truth file and the rest of the input.
    pub fn of(input: &ReplayInput) -> Result<Self, ReplayError> {
        let mut hasher = blake3::Hasher::new();
        let mut messages = MessageHasher::new(&input.recording.joint_names);
        for (log_time, message) in &input.recording.messages {
            // A message that no file can hold is not part of the hash.
            let _ = messages.add(*log_time, message);
        }
        hasher.update(messages.hex().as_bytes());
        if let Some(path) = input.truth {
            let read = files::open(path).and_then(|file| hasher.update_reader(file).map(|_| ()));
            read.map_err(|source| armcal_core::log::LogError::Read { path: path.to_owned(), source })?;
        }
        // The paths of files, and their spelling, are not part of the identity.
        let robot = Robot { folder: PathBuf::new(), links: BTreeMap::new(), ..input.robot.clone() };
        let vehicle = input.vehicle.map(|vehicle| Vehicle { file: PathBuf::new(), ..vehicle.clone() });
        hasher.update(format!("{robot:?}{vehicle:?}{:?}", input.scene).as_bytes());
        hasher.update(input.summary_markdown.unwrap_or_default().as_bytes());
        Ok(Self { recording_id: hasher.finalize().to_hex()[..32].to_owned() })
    }
}

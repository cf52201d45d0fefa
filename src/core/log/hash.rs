//! Hash of a set of messages, independent of file format, file name and compression.

use super::error::EncodeError;
use super::header::RecordingHeader;
use super::message_codec::{Stream, encode_message};
use crate::streams::Message;
use crate::time::Stamp;

/// Start of the hashed bytes; a new encoding gets a new version.
const DOMAIN: &[u8] = b"armcal messages 1";

/// BLAKE3 hash over the canonical encoding of messages: topic (the name in our recordings), log time and CDR bytes of
/// each. All have lengths and are little endian. Frame names and tag family are excluded.
pub struct MessageHasher {
    hasher: blake3::Hasher,
    header: RecordingHeader,
    bytes: Vec<u8>,
}

impl MessageHasher {
    /// Returns the hash of no messages; `joint_names`, base first, become part of the bytes of joint messages.
    #[must_use]
    pub fn new(joint_names: &[String]) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(DOMAIN);
        let header = RecordingHeader {
            joint_names: joint_names.to_vec(),
            base_frame: String::new(),
            camera_frame: String::new(),
            vehicle_frame: String::new(),
            tag_family: String::new(),
        };
        Self { hasher, header, bytes: Vec::new() }
    }

    /// Adds one message; the order counts.
    ///
    /// # Errors
    /// [`EncodeError`] for a message that no recording can hold; messages read from a recording never cause it.
    pub fn add(&mut self, log_time: Stamp, message: &Message) -> Result<(), EncodeError> {
        encode_message(message, &self.header, &mut self.bytes)?;
        let topic = Stream::of(message).topic();
        self.hasher.update(&(topic.len() as u64).to_le_bytes());
        self.hasher.update(topic.as_bytes());
        self.hasher.update(&log_time.nanos.to_le_bytes());
        self.hasher.update(&(self.bytes.len() as u64).to_le_bytes());
        self.hasher.update(&self.bytes);
        Ok(())
    }

    /// Returns the hash so far, 64 hexadecimal digits.
    #[must_use]
    pub fn hex(&self) -> String {
        self.hasher.finalize().to_hex().to_string()
    }
}

/// Hashes messages in the order given, see [`MessageHasher`]. Returns 64 hexadecimal digits.
///
/// # Errors
/// The errors of [`MessageHasher::add`].
pub fn hash_messages<'a>(
    messages: impl IntoIterator<Item = (Stamp, &'a Message)>,
    joint_names: &[String],
) -> Result<String, EncodeError> {
    let mut hasher = MessageHasher::new(joint_names);
    for (log_time, message) in messages {
        hasher.add(log_time, message)?;
    }
    Ok(hasher.hex())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{read_recording, samples};
    use crate::time::SIMULATION_EPOCH;

    fn hash(messages: &[(Stamp, Message)]) -> String {
        let names = samples::header().joint_names;
        hash_messages(messages.iter().map(|(log_time, message)| (*log_time, message)), &names).unwrap()
    }

    /// The hash must not change: otherwise calibrations of old recordings would differ.
    #[test]
    fn hash_of_known_messages_is_unchanged() {
        let mut messages: Vec<_> = samples::one_of_each().into_iter().map(|m| (SIMULATION_EPOCH, m)).collect();
        assert_eq!(hash(&messages), "284650a436f17712e8021e288ecbfcf39080665fc3de7173838e3f595093c25e");
        // Kinds added later do not change the hash of the others.
        messages.retain(|(_, message)| !matches!(message, Message::Touch(_)));
        assert_eq!(hash(&messages), "ead77c6dbcc91e1cb3529dc86dbf8835242371c4826425d354d239f002ced0de");
    }

    #[test]
    fn hash_survives_the_file_and_its_chunks() {
        let dir = tempfile::tempdir().unwrap();
        let messages = samples::stream(300);
        for per_chunk in [7, 1000] {
            let path = dir.path().join("run.mcap");
            samples::write(&path, &messages, per_chunk);
            assert_eq!(hash(&read_recording(&path).unwrap().messages), hash(&messages));
        }
    }

    #[test]
    fn hash_changes_with_any_message_time_or_order() {
        let messages = samples::stream(20);
        let mut others = [messages[1..].to_vec(), messages.clone(), messages.clone()];
        others[1][3].0.nanos += 1;
        others[2].swap(0, 1);
        assert!(others.iter().all(|other| hash(other) != hash(&messages)));
    }
}

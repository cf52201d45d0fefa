//! Copy of only the messages of a recording.

use std::fs;
use std::path::Path;

use mcap::McapResult;
use mcap::records::MessageHeader;

use super::error::LogError;
use super::raw::{RawMessage, RawSummary, for_each_raw};
use super::writer::{FileWriter, create_file};

/// Copies every readable message of `src` to a new file `dst`, with times, types and order, without attachments and
/// metadata. The result gives the completeness of `src`; `dst` is complete.
///
/// # Errors
/// The errors of [`for_each_raw`] for `src` and of `RecordingWriter::create` for `dst`, [`LogError::SameFile`].
pub fn strip(src: impl AsRef<Path>, dst: impl AsRef<Path>) -> Result<RawSummary, LogError> {
    let (src, dst) = (src.as_ref(), dst.as_ref());
    if fs::canonicalize(src).is_ok_and(|src| fs::canonicalize(dst).is_ok_and(|dst| src == dst)) {
        return Err(LogError::SameFile { path: src.to_owned() });
    }
    let mut copy = create_file(dst)?;
    let mut written = Ok(());
    let summary = for_each_raw(src, |message| {
        if written.is_ok() {
            written = write_raw(&mut copy, message);
        }
    });
    let written = written.and_then(|()| copy.finish().map(|_| ()));
    drop(copy);
    if summary.is_err() {
        // An unreadable source must not leave an empty recording; its error is the one to return.
        let _ = fs::remove_file(dst);
    }
    let summary = summary?;
    written.map_err(|source| LogError::Write { path: dst.to_owned(), source })?;
    Ok(summary)
}

fn write_raw(file: &mut FileWriter, message: &RawMessage<'_>) -> McapResult<()> {
    let channel = message.channel;
    let schema_id = match &channel.schema {
        Some(schema) => file.add_schema(&schema.name, &schema.encoding, &schema.data)?,
        None => 0,
    };
    let channel_id = file.add_channel(schema_id, &channel.topic, &channel.message_encoding, &channel.metadata)?;
    let header = MessageHeader {
        channel_id,
        sequence: message.sequence,
        log_time: message.log_time_nanos,
        publish_time: message.publish_time_nanos,
    };
    file.write_to_known_channel(&header, message.data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Completeness, RecordingWriter, read_recording, samples};
    use crate::streams::Sink;

    #[test]
    fn messages_stay_and_everything_else_goes() {
        let dir = tempfile::tempdir().unwrap();
        let (src, dst) = (dir.path().join("run.mcap"), dir.path().join("bare.mcap"));
        let messages = samples::stream(200);
        let mut writer = RecordingWriter::create(&src, samples::header()).unwrap();
        writer.attach("secret.txt", "text/plain", b"attached-secret").unwrap();
        for (log_time, message) in &messages {
            writer.record(*log_time, message).unwrap();
        }
        writer.metadata("run", [("key".into(), "metadata-secret".into())].into()).unwrap();
        writer.finish().unwrap();

        assert_eq!(strip(&src, &dst).unwrap().completeness, Completeness::Whole);
        let (before, after) = (read_recording(&src).unwrap(), read_recording(&dst).unwrap());
        assert!(before.messages == messages && after.messages == messages);
        assert_eq!((after.joint_names, after.completeness), (before.joint_names, Completeness::Whole));
        let holds = |path: &Path, text: &[u8]| fs::read(path).unwrap().windows(text.len()).any(|part| part == text);
        assert!(holds(&src, b"attached-secret") && !holds(&dst, b"attached-secret"));
        assert!(holds(&src, b"metadata-secret") && !holds(&dst, b"metadata-secret"));
    }

    #[test]
    fn stripping_twice_changes_nothing_more() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        samples::write(&path("run.mcap"), &samples::stream(200), 50);
        strip(path("run.mcap"), path("a.mcap")).unwrap();
        strip(path("a.mcap"), path("b.mcap")).unwrap();
        assert!(fs::read(path("a.mcap")).unwrap() == fs::read(path("b.mcap")).unwrap());
        assert!(matches!(strip(path("a.mcap"), path("a.mcap")), Err(LogError::SameFile { .. })));
        fs::write(path("text.txt"), "not a recording").unwrap();
        assert!(matches!(strip(path("text.txt"), path("c.mcap")), Err(LogError::NotMcap { .. })));
        assert!(!path("c.mcap").exists());
    }
}

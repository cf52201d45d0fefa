//! Growing files: piece by piece, up to any byte, damaged, cut, replaced.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{Cursor, Read, Result as IoResult, Seek, SeekFrom, Write};
use std::rc::Rc;

use super::*;
use crate::log::raw::scan::scan;
use crate::log::raw::tests::other_writers;
use crate::log::{Completeness, samples};

/// A file that a writer and a reader have open at once.
#[derive(Clone, Default)]
struct Shared {
    bytes: Rc<RefCell<Vec<u8>>>,
    at: u64,
}

impl Shared {
    fn set(&self, bytes: &[u8]) {
        *self.bytes.borrow_mut() = bytes.to_vec();
    }

    fn through<T>(&mut self, act: impl FnOnce(&mut Cursor<Vec<u8>>) -> T) -> T {
        let mut cursor = Cursor::new(std::mem::take(&mut *self.bytes.borrow_mut()));
        cursor.set_position(self.at);
        let done = act(&mut cursor);
        self.at = cursor.position();
        *self.bytes.borrow_mut() = cursor.into_inner();
        done
    }
}

impl Read for Shared {
    fn read(&mut self, into: &mut [u8]) -> IoResult<usize> {
        self.through(|cursor| cursor.read(into))
    }
}

impl Write for Shared {
    fn write(&mut self, from: &[u8]) -> IoResult<usize> {
        self.through(|cursor| cursor.write(from))
    }

    fn flush(&mut self) -> IoResult<()> {
        Ok(())
    }
}

impl Seek for Shared {
    fn seek(&mut self, to: SeekFrom) -> IoResult<u64> {
        self.through(|cursor| cursor.seek(to))
    }
}

/// A file whose bytes are always fewer than its stated length.
struct CutWithin(Cursor<Vec<u8>>);

impl Read for CutWithin {
    fn read(&mut self, into: &mut [u8]) -> IoResult<usize> {
        let half = self.0.get_ref().len() / 2;
        self.0.get_mut().truncate(half);
        self.0.read(into)
    }
}

impl Seek for CutWithin {
    fn seek(&mut self, to: SeekFrom) -> IoResult<u64> {
        self.0.seek(to)
    }
}

type Messages = Vec<Vec<u8>>;

fn poll(growing: &mut GrowingScan<Shared>, messages: &mut Messages) -> Result<Growth, ScanError> {
    loop {
        let growth = growing.poll(|message| messages.push(message.data.to_vec()))?;
        if growth != Growth::Behind {
            return Ok(growth);
        }
    }
}

fn finish(growing: GrowingScan<Shared>, messages: &mut Messages) -> RawSummary {
    growing.finish(|message| messages.push(message.data.to_vec())).unwrap()
}

fn read(bytes: &[u8]) -> (Messages, RawSummary) {
    let mut messages = Vec::new();
    let (summary, _) = scan(Cursor::new(bytes), |message| messages.push(message.data.to_vec())).unwrap();
    (messages, summary)
}

/// A recording of several chunks, with a header, an attachment and metadata before them.
fn recording(steps: usize) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.mcap");
    let mut writer = crate::log::RecordingWriter::create(&path, samples::header()).unwrap();
    writer.attach("arm.urdf", "application/xml", b"<robot/>").unwrap();
    writer.metadata("run", [("armcal".to_string(), "0.1".to_string())].into()).unwrap();
    for part in samples::stream(steps).chunks(20) {
        for (log_time, message) in part {
            crate::streams::Sink::record(&mut writer, *log_time, message).unwrap();
        }
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
    std::fs::read(path).unwrap()
}

/// Returns the ends of whole chunks, and the number of messages before each.
fn chunk_ends(bytes: &[u8]) -> Vec<(usize, usize)> {
    let (mut at, mut ends) = (MAGIC.len(), Vec::new());
    while at + PREFIX_BYTES <= bytes.len() - MAGIC.len() {
        let prefix = Prefix::parse(&bytes[at..]).unwrap();
        let next = at + PREFIX_BYTES + prefix.len as usize;
        if prefix.opcode == op::CHUNK {
            ends.push((next, read(&bytes[..next]).0.len()));
        }
        at = next;
    }
    ends
}

/// Cut at each byte: complete records are read at once, cut ones when they are complete, and none twice.
#[test]
fn a_file_cut_anywhere_is_read_as_far_as_it_is_whole_and_then_goes_on() {
    let bytes = recording(60);
    let (messages, whole) = read(&bytes);
    let ends = chunk_ends(&bytes);
    assert!(ends.len() >= 4 && whole.completeness == Completeness::Whole, "{ends:?}");
    for end in 0..bytes.len() {
        let file = Shared::default();
        file.set(&bytes[..end]);
        let mut growing = GrowingScan::new(file.clone()).unwrap();
        let mut heard = Vec::new();
        assert_eq!(poll(&mut growing, &mut heard).unwrap(), Growth::Waiting, "{end}");
        let expected = ends.iter().rev().find(|(at, _)| *at <= end).map_or(0, |(_, n)| *n);
        assert_eq!(heard.len(), expected, "{end}");
        assert_eq!(poll(&mut growing, &mut heard).unwrap(), Growth::Waiting, "{end}");
        file.set(&bytes);
        assert_eq!(poll(&mut growing, &mut heard).unwrap(), Growth::Finished, "{end}");
        assert_eq!(poll(&mut growing, &mut heard).unwrap(), Growth::Finished, "{end}");
        assert_eq!(finish(growing, &mut heard), whole, "{end}");
        assert!(heard == messages, "{end}");
    }
}

/// A cut file that no longer grows gives the same result as with any reader.
#[test]
fn the_end_of_a_cut_file_is_that_of_a_scan() {
    let bytes = recording(60);
    for end in MAGIC.len()..bytes.len() {
        let file = Shared::default();
        // The file is read in two pieces.
        file.set(&bytes[..end / 2]);
        let mut growing = GrowingScan::new(file.clone()).unwrap();
        let mut heard = Vec::new();
        poll(&mut growing, &mut heard).unwrap();
        file.set(&bytes[..end]);
        poll(&mut growing, &mut heard).unwrap();
        let (messages, summary) = read(&bytes[..end]);
        assert_eq!(finish(growing, &mut heard), summary, "{end}");
        assert!(heard == messages, "{end}");
    }
    for start in [&b""[..], &MAGIC[..5]] {
        let file = Shared::default();
        file.set(start);
        let mut growing = GrowingScan::new(file).unwrap();
        assert_eq!(growing.poll(|_| {}).unwrap(), Growth::Waiting);
        assert!(matches!(growing.finish(|_| {}), Err(ScanError::Empty | ScanError::NotMcap { .. })));
    }
}

#[test]
fn pieces_of_any_size_give_the_same_messages() {
    let bytes = recording(600);
    let (messages, whole) = read(&bytes);
    for piece in [1, 7, 97, 1021, 10_007] {
        let file = Shared::default();
        let mut growing = GrowingScan::new(file.clone()).unwrap();
        let mut heard = Vec::new();
        let mut growth = Growth::Waiting;
        for end in (piece..bytes.len() + piece).step_by(piece) {
            assert_eq!(growth, Growth::Waiting, "{piece}, {end}");
            file.bytes.borrow_mut().extend_from_slice(&bytes[end - piece..end.min(bytes.len())]);
            growth = poll(&mut growing, &mut heard).unwrap();
        }
        assert_eq!(growth, Growth::Finished, "{piece}");
        assert_eq!(finish(growing, &mut heard), whole, "{piece}");
        assert!(heard == messages, "{piece}");
    }
}

/// Files of other writers during writing: without chunks, and with chunk heads that are filled in later.
#[test]
fn files_of_other_writers_are_followed() {
    let plain = || mcap::WriteOptions::new().compression_threads(0).chunk_size(Some(4096));
    for (n, options) in std::iter::once(plain()).chain(other_writers(plain)).enumerate() {
        let file = Shared::default();
        let mut growing = GrowingScan::new(file.clone()).unwrap();
        let mut heard: Messages = Vec::new();
        let mut writer = options.create(file.clone()).unwrap();
        let channel = writer.add_channel(0, "/x", "json", &BTreeMap::new()).unwrap();
        let mut state = 1_u32;
        let mut n_before_end = 0;
        for sequence in 0..2000_u32 {
            let header = mcap::records::MessageHeader { channel_id: channel, sequence, log_time: 1, publish_time: 0 };
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            writer.write_to_known_channel(&header, &[state.to_le_bytes(), sequence.to_le_bytes()].concat()).unwrap();
            if sequence % 13 == 0 {
                assert_eq!(poll(&mut growing, &mut heard).unwrap(), Growth::Waiting, "variant {n}, {sequence}");
                n_before_end = heard.len();
            }
        }
        writer.finish().unwrap();
        drop(writer);
        assert!(n_before_end > 1000, "variant {n}: {n_before_end} followed");
        assert_eq!(poll(&mut growing, &mut heard).unwrap(), Growth::Finished, "variant {n}");
        let (messages, summary) = read(&file.bytes.borrow());
        assert_eq!(finish(growing, &mut heard).completeness, summary.completeness, "variant {n}");
        assert!(heard == messages && messages.len() == 2000, "variant {n}");
    }
}

/// A finished file is read like any other, regardless of the bit that is wrong.
#[test]
fn a_damaged_file_that_is_finished_is_read_as_by_a_scan() {
    let bytes = recording(120);
    for at in (MAGIC.len()..bytes.len()).step_by(5) {
        for bit in [0, 7] {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            let file = Shared::default();
            file.set(&damaged);
            let mut growing = GrowingScan::new(file).unwrap();
            let mut heard = Vec::new();
            poll(&mut growing, &mut heard).unwrap();
            let summary = finish(growing, &mut heard);
            let (messages, expected) = read(&damaged);
            assert_eq!(summary.completeness, expected.completeness, "{at} {bit}");
            assert!(heard == messages, "{at} {bit}");
        }
    }
}

/// Damage in a growing file loses only the damaged part, is reported, and does not stop the reader.
#[test]
fn damage_in_a_growing_file_is_passed_over() {
    let bytes = recording(1200);
    let (messages, _) = read(&bytes);
    let ends = chunk_ends(&bytes);
    let (third, fourth) = (ends[2].0, ends[3].0);
    // The indexes of the third chunk are before the fourth chunk.
    let head = (third..fourth).find(|&at| bytes[at] == op::CHUNK && ChunkHead::parse(&bytes[at..]).is_some()).unwrap();
    let (in_data, its_length, its_opcode) = (fourth - 20, head + 2, head);
    for at in [in_data, its_length, its_opcode] {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            let file = Shared::default();
            let mut growing = GrowingScan::new(file.clone()).unwrap();
            let mut heard: Messages = Vec::new();
            for end in (0..damaged.len()).step_by(701) {
                file.set(&damaged[..end]);
                assert_eq!(poll(&mut growing, &mut heard).unwrap(), Growth::Waiting);
            }
            assert!(heard.len() + 100 > messages.len(), "{at} {bit}: {} of {}", heard.len(), messages.len());
            file.set(&damaged);
            poll(&mut growing, &mut heard).unwrap();
            let summary = finish(growing, &mut heard);
            assert!(matches!(summary.completeness, Completeness::Damaged { .. }), "{at} {bit}: {summary:?}");
            assert!(heard.len() >= messages.len() - 40, "{at} {bit}: {} of {}", heard.len(), messages.len());
            let mut rest = messages.iter();
            assert!(heard.iter().all(|message| rest.any(|other| other == message)), "{at} {bit}: order");
        }
    }
}

#[test]
fn a_file_that_became_shorter_or_another_is_an_error() {
    let (bytes, other) = (recording(600), recording(601));
    let half = bytes.len() / 2;
    let followed = || {
        let file = Shared::default();
        file.set(&bytes[..half]);
        let mut growing = GrowingScan::new(file.clone()).unwrap();
        assert_eq!(poll(&mut growing, &mut Vec::new()).unwrap(), Growth::Waiting);
        (file, growing)
    };
    let (file, mut growing) = followed();
    file.set(&bytes[..half / 2]);
    assert!(matches!(growing.poll(|_| {}), Err(ScanError::Truncated { bytes, .. }) if bytes == half as u64 / 2));
    // The file was rewritten beyond the bytes that were read.
    let (file, mut growing) = followed();
    file.set(&[&other[..MAGIC.len()], &[1; 7], &other[MAGIC.len()..]].concat());
    assert!(matches!(growing.poll(|_| {}), Err(ScanError::Rewritten)));
    // The file was cut after its length was read and before its bytes were.
    let mut growing = GrowingScan::new(CutWithin(Cursor::new(bytes))).unwrap();
    let error = growing.poll(|_| {}).unwrap_err();
    assert!(matches!(error, ScanError::Truncated { read: 0, .. }), "{error:?}");
    // The file is not a recording.
    let file = Shared::default();
    file.set(b"hello, this is a text");
    assert!(matches!(GrowingScan::new(file).unwrap().poll(|_| {}), Err(ScanError::NotMcap { .. })));
}

/// A recording within an attachment: its chunks do not belong to this file.
#[test]
fn an_attachment_in_the_making_holds_no_chunks() {
    let inner = recording(100);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.mcap");
    let mut writer = crate::log::RecordingWriter::create(&path, samples::header()).unwrap();
    writer.attach("inner.mcap", "application/octet-stream", &inner).unwrap();
    for (log_time, message) in samples::stream(50) {
        crate::streams::Sink::record(&mut writer, log_time, &message).unwrap();
    }
    writer.finish().unwrap();
    let bytes = std::fs::read(path).unwrap();
    let (file, mut heard) = (Shared::default(), Vec::new());
    let mut growing = GrowingScan::new(file.clone()).unwrap();
    for end in (0..bytes.len()).step_by(211) {
        file.set(&bytes[..end]);
        assert_eq!(poll(&mut growing, &mut heard).unwrap(), Growth::Waiting, "{end}");
    }
    file.set(&bytes);
    assert_eq!(poll(&mut growing, &mut heard).unwrap(), Growth::Finished);
    let (messages, whole) = read(&bytes);
    assert_eq!(finish(growing, &mut heard), whole);
    assert!(heard == messages && whole.completeness == Completeness::Whole);
}

/// The unread rest of a recording that goes on is no loss.
#[test]
fn a_reader_that_stops_early_misses_nothing() {
    let bytes = recording(600);
    for end in [bytes.len() / 3, bytes.len()] {
        let file = Shared::default();
        file.set(&bytes[..end]);
        let mut growing = GrowingScan::new(file).unwrap();
        poll(&mut growing, &mut Vec::new()).unwrap();
        assert_eq!(growing.stop().completeness, Completeness::Whole);
    }
    // The reader stops before all of a finished file was read.
    let file = Shared::default();
    file.set(&recording(12_000));
    let mut growing = GrowingScan::new(file).unwrap();
    assert_eq!(growing.poll(|_| {}).unwrap(), Growth::Behind);
    assert_eq!(growing.stop().completeness, Completeness::Whole);
}

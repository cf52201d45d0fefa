//! Cuts, flipped bits and files of other types.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;
use std::path::Path;

use mcap::{Compression, WriteOptions};

use super::scan::{ScanError, scan};
use super::*;
use crate::log::{LogError, samples};

const PER_CHUNK: usize = 60;

/// Returns the bytes of a recording of several chunks, and the data of its messages in the order of the file.
fn recording() -> (Vec<u8>, Vec<Vec<u8>>) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.mcap");
    samples::write(&path, &samples::stream(300), PER_CHUNK);
    let bytes = std::fs::read(&path).unwrap();
    let (messages, summary) = read(&bytes).unwrap();
    assert_eq!(summary.completeness, Completeness::Whole);
    assert_eq!(messages.len(), 330);
    (bytes, messages)
}

fn read(bytes: &[u8]) -> Result<(Vec<Vec<u8>>, RawSummary), ScanError> {
    let mut messages = Vec::new();
    let (summary, _) = scan(Cursor::new(bytes), |message| messages.push(message.data.to_vec()))?;
    assert_eq!(summary.readable_messages, messages.len() as u64);
    Ok((messages, summary))
}

/// Returns true if `part` is `whole` with some elements omitted, in the same order.
fn is_subsequence(part: &[Vec<u8>], whole: &[Vec<u8>]) -> bool {
    let mut rest = whole.iter();
    part.iter().all(|message| rest.any(|other| other == message))
}

/// Returns start and length of the records outside of chunks.
fn records(bytes: &[u8]) -> Vec<(usize, usize)> {
    let mut at = 8;
    let mut records = Vec::new();
    while at + 9 <= bytes.len() - 8 {
        let len = 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        records.push((at, len));
        at += len;
    }
    records
}

/// Returns start and length of the chunks.
fn chunks(bytes: &[u8]) -> Vec<(usize, usize)> {
    records(bytes).into_iter().filter(|(at, _)| bytes[*at] == 6).collect()
}

#[test]
fn a_cut_anywhere_leaves_the_beginning() {
    let (bytes, messages) = recording();
    let chunks = chunks(&bytes);
    assert_eq!(chunks.len(), 6);
    let is_near_a_border =
        |end: usize| chunks.iter().any(|(at, len)| end.abs_diff(*at) < 60 || end.abs_diff(at + len) < 30);
    for end in (0..bytes.len()).filter(|&end| end % 17 == 0 || end + 200 > bytes.len() || is_near_a_border(end)) {
        let Ok((read, summary)) = read(&bytes[..end]) else {
            assert!(end < 8, "{end}");
            continue;
        };
        assert!(messages.starts_with(&read), "{end}");
        let whole_chunks = chunks.iter().filter(|(at, len)| at + len <= end).count();
        assert!(read.len() >= (whole_chunks * PER_CHUNK).min(messages.len()), "{end}: {}", read.len());
        assert!(matches!(summary.completeness, Completeness::Cut { .. }), "{end}: {:?}", summary.completeness);
    }
}

#[test]
fn messages_before_the_cut_within_a_chunk_are_saved() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.mcap");
    let stream = samples::stream(30_000);
    samples::write(&path, &stream, usize::MAX);
    let bytes = std::fs::read(&path).unwrap();
    let (at, len) = chunks(&bytes)[0];
    let (messages, _) = read(&bytes[..at + len * 9 / 10]).unwrap();
    assert!(messages.len() > 1000, "{}", messages.len());
}

/// Checks the messages read from `bytes` after a flip of one bit.
fn check_flip(bytes: &[u8], messages: &[Vec<u8>], at: usize, bit: u8) {
    let mut damaged = bytes.to_vec();
    damaged[at] ^= 1 << bit;
    let Ok((read, summary)) = read(&damaged) else {
        return assert!(at < 8, "{at}");
    };
    let place = format!("byte {at} bit {bit}: {:?}", summary.completeness);
    assert!(is_subsequence(&read, messages), "{place}");
    assert!(read.len() >= messages.len() - PER_CHUNK, "{place}");
    let lost = (messages.len() - read.len()) as u64;
    if let Completeness::Damaged { lost_messages, .. } = summary.completeness {
        assert!(lost_messages.is_none_or(|counted| counted == lost), "{place}");
    } else {
        assert_eq!(lost, 0, "{place}");
    }
}

#[test]
fn a_flipped_bit_anywhere_loses_what_it_hit_and_never_panics() {
    let (bytes, messages) = recording();
    for at in (0..bytes.len()).step_by(31) {
        for bit in [0, 3, 7] {
            check_flip(&bytes, &messages, at, bit);
        }
    }
}

#[test]
fn a_flipped_bit_in_the_head_of_any_record_loses_what_it_hit() {
    let (bytes, messages) = recording();
    for (at, len) in records(&bytes) {
        for at in at..at + len.min(9) {
            for bit in 0..8 {
                check_flip(&bytes, &messages, at, bit);
            }
        }
    }
}

#[test]
fn a_flipped_bit_in_the_head_of_a_record_is_noticed_in_an_unfinished_file() {
    let (bytes, messages) = recording();
    let (last_at, last_len) = *chunks(&bytes).last().unwrap();
    let unfinished = &bytes[..last_at + last_len];
    for (at, len) in records(&bytes).into_iter().filter(|(at, _)| *at < last_at && *at > chunks(&bytes)[0].0) {
        for at in at..at + len.min(53) {
            for bit in 0..8 {
                let mut damaged = unfinished.to_vec();
                damaged[at] ^= 1 << bit;
                let (read, summary) = read(&damaged).unwrap();
                let place = format!("byte {at} bit {bit}: {:?}", summary.completeness);
                assert!(is_subsequence(&read, &messages), "{place}");
                let is_damaged = matches!(summary.completeness, Completeness::Damaged { .. });
                assert!(read.len() == messages.len() || is_damaged, "{place}");
            }
        }
    }
}

#[test]
fn many_flipped_bits_never_panic() {
    let (bytes, messages) = recording();
    let mut state = 7_u64;
    let mut random = |n: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as usize) % n
    };
    for _ in 0..300 {
        let mut damaged = bytes.clone();
        for _ in 0..1 + random(20) {
            let at = 8 + random(bytes.len() - 8);
            damaged[at] ^= 1 << random(8);
        }
        damaged.truncate(8 + random(bytes.len() * 2).min(bytes.len() - 8));
        let (read, _) = read(&damaged).unwrap();
        assert!(read.len() <= messages.len());
    }
}

#[test]
fn a_lost_chunk_is_counted_and_the_rest_is_read() {
    let (mut bytes, messages) = recording();
    // The first chunk declares most channels; the summary at the end repeats them.
    let (at, len) = chunks(&bytes)[0];
    bytes[at + len / 2] ^= 0x10;
    let (read, summary) = read(&bytes).unwrap();
    assert!(read == messages[PER_CHUNK..]);
    let Completeness::Damaged { lost_chunks, lost_bytes, lost_messages, readable_messages, .. } = summary.completeness
    else {
        panic!("{summary:?}");
    };
    assert_eq!((lost_chunks, lost_bytes), (1, len as u64));
    assert_eq!((lost_messages, readable_messages), (Some(PER_CHUNK as u64), read.len() as u64));
}

#[test]
fn huge_lengths_are_not_believed() {
    let (bytes, messages) = recording();
    let (at, _) = chunks(&bytes)[2];
    // The record's length, the unpacked size, and the packed size, one after the other.
    for (field, lost) in [(1, PER_CHUNK), (25, PER_CHUNK), (45, PER_CHUNK)] {
        let mut damaged = bytes.clone();
        damaged[at + field..at + field + 8].copy_from_slice(&(u64::MAX / 3).to_le_bytes());
        let (read, summary) = read(&damaged).unwrap();
        assert_eq!(read.len(), messages.len() - lost, "{summary:?}");
        assert!(matches!(summary.completeness, Completeness::Damaged { .. }));
    }
}

#[test]
fn zeros_behind_a_crash_are_a_cut() {
    let (bytes, messages) = recording();
    let (at, len) = chunks(&bytes)[3];
    let mut crashed = bytes[..at + len].to_vec();
    crashed.resize(bytes.len(), 0);
    let (read, summary) = read(&crashed).unwrap();
    assert!(read == messages[..4 * PER_CHUNK]);
    assert!(matches!(summary.completeness, Completeness::Cut { .. }), "{summary:?}");
}

/// Options of other writers, which omit or change parts of `plain`.
pub(super) fn other_writers(plain: impl Fn() -> WriteOptions) -> [WriteOptions; 5] {
    [
        plain().compression(None),
        plain().compression(Some(Compression::Lz4)),
        plain().use_chunks(false),
        plain().calculate_chunk_crcs(false),
        plain().emit_summary_records(false).emit_summary_offsets(false),
    ]
}

#[test]
fn files_of_other_writers_are_read() {
    for (n, options) in other_writers(|| WriteOptions::new().compression_threads(0)).into_iter().enumerate() {
        let mut file = Cursor::new(Vec::new());
        let mut writer = options.create(&mut file).unwrap();
        let channel = writer.add_channel(0, "/x", "json", &BTreeMap::new()).unwrap();
        for sequence in 0..500 {
            let log_time = u64::from(sequence);
            let header = mcap::records::MessageHeader { channel_id: channel, sequence, log_time, publish_time: 0 };
            writer.write_to_known_channel(&header, &[sequence as u8; 200]).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        let bytes = file.into_inner();
        let (messages, summary) = read(&bytes).unwrap();
        assert_eq!((messages.len(), summary.completeness), (500, Completeness::Whole), "variant {n}");
        for end in (8..bytes.len()).step_by(97) {
            let (cut, _) = read(&bytes[..end]).unwrap();
            assert!(messages.starts_with(&cut), "variant {n}, {end}");
        }
    }
}

#[test]
fn a_file_whose_writer_was_killed_within_a_chunk_is_read() {
    // mcap's seeking writer leaves a chunk head of placeholders when killed.
    let mut writer = mcap::WriteOptions::new().compression_threads(0).create(Cursor::new(Vec::new())).unwrap();
    let channel = writer.add_channel(0, "/x", "json", &BTreeMap::new()).unwrap();
    let mut state = 1_u32;
    for sequence in 0..20_000 {
        let log_time = u64::from(sequence);
        let header = mcap::records::MessageHeader { channel_id: channel, sequence, log_time, publish_time: 0 };
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        writer.write_to_known_channel(&header, &state.to_le_bytes()).unwrap();
    }
    let bytes = writer.into_inner().into_inner();
    let (messages, summary) = read(&bytes).unwrap();
    assert!(messages.len() > 5000, "{}", messages.len());
    assert!(matches!(summary.completeness, Completeness::Cut { .. }));
}

#[test]
fn empty_and_foreign_files_are_errors_that_name_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("notes.txt");
    let read = |path: &Path| for_each_raw(path, |_| {}).unwrap_err();
    assert!(matches!(read(&path), LogError::Read { .. }));
    std::fs::write(&path, "").unwrap();
    assert!(matches!(read(&path), LogError::Empty { .. }));
    std::fs::write(&path, "hello, this is a text").unwrap();
    assert!(matches!(read(&path), LogError::NotMcap { path: file, .. } if file == path));
    assert!(matches!(read(dir.path()), LogError::Read { .. }));
}

/// Returns the bytes before the first chunk, each chunk with its index, and the bytes from the end of the data on.
fn taken_apart(bytes: &[u8]) -> (Vec<u8>, Vec<Vec<u8>>, Vec<u8>) {
    let chunks = chunks(bytes);
    let (data_end, _) = *records(bytes).iter().find(|(at, _)| bytes[*at] == 15).unwrap();
    let starts: Vec<usize> = chunks.iter().map(|(at, _)| *at).chain([data_end]).collect();
    let groups = starts.windows(2).map(|pair| bytes[pair[0]..pair[1]].to_vec()).collect();
    (bytes[..starts[0]].to_vec(), groups, bytes[data_end..].to_vec())
}

#[test]
fn chunks_in_another_order_are_sorted_and_do_not_pass_for_whole() {
    let (bytes, messages) = recording();
    let (head, mut groups, mut tail) = taken_apart(&bytes);
    groups.swap(1, 4);
    let swapped = |tail: &[u8]| [head.clone(), groups.concat(), tail.to_vec()].concat();
    let (read_back, summary) = read(&swapped(&tail)).unwrap();
    assert!(read_back == messages);
    // The chunks 2, 3 and 1 come after chunk 4.
    assert_eq!(summary.chunk_order, ChunkOrder { moved: 3, copies: 0 });
    let Completeness::Damaged { reason, lost_messages, .. } = summary.completeness else { panic!("{summary:?}") };
    assert_eq!(lost_messages, Some(0));
    insta::assert_snapshot!("chunks_in_another_order", reason);
    // Without a checksum, or with one of that order, a writer may have written the chunks in this order.
    tail[9..13].fill(0);
    let (read_back, summary) = read(&swapped(&tail)).unwrap();
    assert!(read_back == messages);
    assert_eq!((summary.completeness, summary.chunk_order.moved), (Completeness::Whole, 3));
}

#[test]
fn copies_of_chunks_are_left_out() {
    let (bytes, messages) = recording();
    let (head, groups, tail) = taken_apart(&bytes);
    for (copied, to) in [(2, 3), (2, 6), (0, 6)] {
        let mut groups = groups.clone();
        groups.insert(to, groups[copied].clone());
        let doubled = [head.clone(), groups.concat()].concat();
        let (read_back, summary) = read(&doubled).unwrap();
        assert!(read_back == messages, "{copied} {to}");
        assert_eq!(summary.chunk_order, ChunkOrder { moved: 0, copies: 1 }, "{copied} {to}");
        assert!(matches!(summary.completeness, Completeness::Cut { .. }));
        let (read_back, summary) = read(&[doubled, tail.clone()].concat()).unwrap();
        assert!(read_back == messages, "{copied} {to}");
        assert!(matches!(summary.completeness, Completeness::Damaged { .. }), "{summary:?}");
    }
}

/// Times in the heads of chunks have no checksum of their own: a wrong one must not move a chunk.
#[test]
fn a_wrong_time_in_the_head_of_a_chunk_moves_nothing() {
    let (mut bytes, messages) = recording();
    let (at, _) = chunks(&bytes)[1];
    bytes[at + 9..at + 17].copy_from_slice(&u64::MAX.to_le_bytes());
    let (read_back, summary) = read(&bytes).unwrap();
    assert!(read_back == messages);
    assert_eq!(summary.chunk_order, ChunkOrder::default());
    assert!(matches!(summary.completeness, Completeness::Damaged { .. }), "{summary:?}");
}

/// A file of one chunk by another writer: `write` puts messages on one channel.
fn packed(write: impl Fn(&mut mcap::Writer<Cursor<Vec<u8>>>)) -> Vec<u8> {
    let options = mcap::WriteOptions::new().compression_threads(0).chunk_size(None);
    let options = options.compression(Some(mcap::Compression::Lz4)).emit_message_indexes(false);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    write(&mut writer);
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn more_records_than_a_chunk_can_hold_are_not_read() {
    let header = |channel_id| mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 0 };
    let bytes = packed(|writer| {
        let channel = writer.add_channel(0, "/x", "json", &BTreeMap::new()).unwrap();
        (0..1_500_000).for_each(|_| writer.write_to_known_channel(&header(channel), &[]).unwrap());
    });
    assert!(bytes.len() < 1_000_000, "{}", bytes.len());
    let mut n = 0_u64;
    let (summary, _) = scan(Cursor::new(&bytes), |_| n += 1).unwrap();
    assert!((1_000_000..1_400_000).contains(&n), "{n}");
    let Completeness::Damaged { reason, lost_chunks, .. } = summary.completeness else { panic!("{summary:?}") };
    assert_eq!(lost_chunks, 1);
    insta::assert_snapshot!("many_records", reason);
}

/// Tests whole and cut files, and chunks in another order.
#[test]
fn chosen_parts_are_read_again_and_no_others() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.mcap");
    samples::write(&path, &samples::stream(40_000), 4000);
    let bytes = std::fs::read(&path).unwrap();
    let (head, mut groups, tail) = taken_apart(&bytes);
    groups.swap(2, 5);
    let swapped = [head, groups.concat(), tail].concat();
    for bytes in [&bytes[..], &bytes[..bytes.len() / 5 * 4], &swapped] {
        let mut all: Vec<(u64, Vec<u8>)> = Vec::new();
        let (_, again) = scan(Cursor::new(bytes), |message| all.push((message.part, message.data.to_vec()))).unwrap();
        let parts: BTreeSet<u64> = all.iter().map(|(part, _)| *part).collect();
        assert!(parts.len() > 4, "{parts:?}");
        let chosen: BTreeSet<u64> = parts.into_iter().skip(1).step_by(2).collect();
        let mut found = Vec::new();
        again.visit(chosen.clone(), |message| found.push((message.part, message.data.to_vec()))).unwrap();
        all.retain(|(part, _)| chosen.contains(part));
        assert!(!found.is_empty() && found == all);
    }
}

#[test]
fn zeros_in_a_chunk_are_no_records() {
    let (bytes, messages) = recording();
    let (at, len) = chunks(&bytes)[2];
    let zeros = vec![0_u8; 1 << 24];
    let mut chunk = vec![6];
    chunk.extend((40 + zeros.len() as u64).to_le_bytes());
    chunk.extend_from_slice(&bytes[at + 9..at + 25]);
    chunk.extend((zeros.len() as u64).to_le_bytes());
    chunk.extend([0; 8]);
    chunk.extend((zeros.len() as u64).to_le_bytes());
    chunk.extend(zeros);
    let damaged = [&bytes[..at], &chunk, &bytes[at + len..]].concat();
    let (read_back, summary) = read(&damaged).unwrap();
    assert_eq!(read_back.len(), messages.len() - PER_CHUNK);
    let Completeness::Damaged { reason, .. } = summary.completeness else { panic!("{summary:?}") };
    // The summary is no longer at the footer's position; the damage there is reported first.
    insta::assert_snapshot!("zeros_in_a_chunk", reason);
}

#[test]
fn declarations_are_kept_within_a_budget() {
    let long: BTreeMap<String, String> = [("key".to_owned(), "x".repeat(1 << 20))].into();
    let bytes = packed(|writer| {
        for n in 0..100 {
            let channel = writer.add_channel(0, &format!("/{n}"), "json", &long).unwrap();
            let header =
                mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 1, publish_time: 0 };
            writer.write_to_known_channel(&header, &[]).unwrap();
        }
    });
    let (read_back, summary) = read(&bytes).unwrap();
    assert!((50..64).contains(&read_back.len()), "{}", read_back.len());
    assert!(matches!(summary.completeness, Completeness::Damaged { .. }), "{summary:?}");
}

#[test]
fn the_budget_of_a_file_ends() {
    use super::limits::Budget;
    let mut budget = Budget::of_file(1000);
    assert!(budget.spend(8 << 30, (1 << 24) - 128).is_ok());
    assert!(budget.spend(32_000, 122).is_ok());
    assert!(budget.spend(0, 1).is_err());
    assert!(Budget::of_file(1000).spend((8 << 30) + 32_001, 0).is_err());
    assert!(Budget::of_file(u64::MAX).spend(u64::MAX, u64::MAX / 8).is_ok());
}

#[test]
fn metadata_are_kept_within_a_budget() {
    let (bytes, messages) = recording();
    let (head, groups, tail) = taken_apart(&bytes);
    let value = vec![b'x'; 1 << 19];
    let mut body = vec![1, 0, 0, 0, b'm'];
    body.extend((value.len() as u32 + 9).to_le_bytes());
    body.extend([1, 0, 0, 0, b'k']);
    body.extend((value.len() as u32).to_le_bytes());
    body.extend(value);
    let record = [&[12][..], &(body.len() as u64).to_le_bytes(), &body].concat();
    let long = [head, record.repeat(100), groups.concat(), tail].concat();
    let (read_back, summary) = read(&long).unwrap();
    assert!(read_back == messages);
    assert!((25..32).contains(&summary.contents.metadata.len()), "{}", summary.contents.metadata.len());
}

//! Bags that SQLite itself wrote.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use sqlite::Connection;

use super::*;
use crate::log::raw::completeness::{Completeness, RawSummary};
use crate::log::raw::file::{file_contents, for_each_raw, for_each_raw_twice};
use crate::log::raw::scan::ScanError;
use crate::log::{LogError, read_attachments};

const TOPICS: [(&str, &str); 3] = [
    ("/joint_states", "sensor_msgs/msg/JointState"),
    ("/tf", "tf2_msgs/msg/TFMessage"),
    ("/camera/image", "sensor_msgs/msg/Image"),
];
const START_NANOS: i64 = 1_700_000_000_000_000_000;

/// Versions of rosbag2's tables.
const VERSIONS: [u32; 3] = [2, 3, 4];

fn create(path: &Path, page_bytes: u32, version: u32) -> Connection {
    let bag = Connection::open(path).expect("a file");
    bag.execute(format!("PRAGMA page_size={page_bytes}")).expect("set");
    let more = if version >= 4 { ", type_description_hash TEXT NOT NULL" } else { "" };
    bag.execute(format!(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT \
         NOT NULL,offered_qos_profiles TEXT NOT NULL{more});\
         CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB \
         NOT NULL);\
         CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
    ))
    .expect("tables");
    if version >= 3 {
        bag.execute(format!(
            "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL);\
             CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL);\
             INSERT INTO schema VALUES({version}, 'jazzy');"
        ))
        .expect("tables");
    }
    if version >= 4 {
        bag.execute(
            "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,encoding TEXT NOT \
             NULL,encoded_message_definition TEXT NOT NULL,type_description_hash TEXT NOT NULL);\
             INSERT INTO message_definitions(topic_type,encoding,encoded_message_definition,type_description_hash) \
             VALUES('sensor_msgs/msg/JointState','ros2msg','string[] name','RIHS01_0');",
        )
        .expect("tables");
    }
    for (name, kind) in TOPICS {
        let hash = if version >= 4 { ", ''" } else { "" };
        bag.execute(format!("INSERT INTO topics VALUES(NULL, '{name}', '{kind}', 'cdr', ''{hash})")).expect("a topic");
    }
    bag
}

/// Returns the data of row `n`. Every tenth row is long: it continues after its page, on several pages, or fills it to
/// the last byte.
fn data(n: usize) -> Vec<u8> {
    let long = [4000, 4061, 4062, 4063, 9000, 477, 478, 70_000, 0, 300_000];
    let bytes = if n.is_multiple_of(10) { long[n / 10 % long.len()] } else { 20 + n % 90 };
    (0..bytes).map(|at| (at * 7 + n) as u8).collect()
}

fn insert(bag: &Connection, messages: std::ops::Range<usize>) {
    let mut insert = bag.prepare("INSERT INTO messages (timestamp, topic_id, data) VALUES (?1, ?2, ?3)").expect("sql");
    for n in messages {
        insert.reset().expect("sql");
        insert.bind((1, START_NANOS + n as i64 * 1_000_000)).expect("bound");
        insert.bind((2, (n % 3 + 1) as i64)).expect("bound");
        insert.bind((3, &data(n)[..])).expect("bound");
        insert.next().expect("a message");
    }
}

fn written(folder: &Path, page_bytes: u32, version: u32, n_messages: usize) -> PathBuf {
    let path = folder.join(format!("{page_bytes}-{version}-{n_messages}.db3"));
    let bag = create(&path, page_bytes, version);
    bag.execute("BEGIN").expect("begun");
    insert(&bag, 0..n_messages);
    bag.execute("COMMIT").expect("committed");
    path
}

type Read = (String, String, u64, Vec<u8>);

fn read(path: &Path) -> (Vec<Read>, RawSummary) {
    let mut messages = Vec::new();
    let summary = for_each_raw(path, |raw| {
        assert_eq!((raw.channel.message_encoding.as_str(), raw.publish_time_nanos), ("cdr", raw.log_time_nanos));
        messages.push((raw.topic().to_owned(), raw.schema_name().to_owned(), raw.log_time_nanos, raw.data.to_vec()));
    })
    .expect("it reads");
    assert_eq!(summary.readable_messages, messages.len() as u64);
    (messages, summary)
}

fn expected(messages: std::ops::Range<usize>) -> Vec<Read> {
    let one = |n: usize| {
        let (topic, kind) = TOPICS[n % 3];
        (topic.to_owned(), kind.to_owned(), START_NANOS as u64 + n as u64 * 1_000_000, data(n))
    };
    messages.map(one).collect()
}

#[test]
fn every_message_is_read_whatever_the_pages_and_the_version() {
    let folder = tempfile::tempdir().expect("a folder");
    for page_bytes in [512, 1024, 4096, 65536] {
        for version in VERSIONS {
            let path = written(folder.path(), page_bytes, version, 700);
            let (messages, summary) = read(&path);
            assert_eq!(summary.completeness, Completeness::Whole, "{}", path.display());
            assert!(messages == expected(0..700), "{}", path.display());
            let told = summary.contents.metadata.first().map(|(_, entries)| entries["schema_version"].clone());
            assert_eq!(told, (version >= 3).then(|| version.to_string()));
            assert_eq!(file_contents(&path).expect("it reads"), summary.contents);
            assert!(read_attachments(&path).expect("it reads").is_empty());
        }
    }
    // Three levels of pages.
    let path = written(folder.path(), 512, 4, 20_000);
    assert!(read(&path).0 == expected(0..20_000));
    assert_eq!(read(&written(folder.path(), 4096, 3, 0)).0, []);
}

#[test]
fn definitions_come_with_their_types() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut found = Vec::new();
    for_each_raw(written(folder.path(), 4096, 4, 2), |raw| {
        let schema = raw.channel.schema.as_ref().expect("a type");
        found.push((schema.encoding.clone(), String::from_utf8(schema.data.clone()).expect("a text")));
    })
    .expect("it reads");
    assert_eq!(found, [("ros2msg".to_owned(), "string[] name".to_owned()), Default::default()]);
}

#[test]
fn parts_of_a_bag_are_visited_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = written(folder.path(), 4096, 3, 500);
    let mut parts = Vec::new();
    let (_, again) = for_each_raw_twice(&path, |raw| parts.push(raw.part)).expect("it reads");
    let wanted = [parts[0], parts[250]].into();
    let mut times = Vec::new();
    again.visit(wanted, |raw| times.push(raw.log_time_nanos)).expect("it reads");
    let all = expected(0..500);
    let is_in = |n: &usize| parts[*n] == parts[0] || parts[*n] == parts[250];
    let of_parts: Vec<u64> = (0..500).filter(is_in).map(|n| all[n].2).collect();
    assert!(of_parts.len() < 100 && times == of_parts, "{} {}", times.len(), of_parts.len());
}

#[test]
fn what_a_killed_recorder_left_in_the_log_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("open.db3");
    let bag = create(&path, 4096, 3);
    bag.execute("PRAGMA journal_mode=WAL").expect("set");
    bag.execute("PRAGMA wal_autocheckpoint=0; BEGIN").expect("begun");
    insert(&bag, 0..100);
    bag.execute("COMMIT; PRAGMA wal_checkpoint(PASSIVE); BEGIN").expect("committed");
    insert(&bag, 100..300);
    bag.execute("COMMIT; PRAGMA cache_size=10; BEGIN").expect("committed");
    insert(&bag, 300..400);
    // State after a kill: the last transaction is partly in the log.
    let copy = folder.path().join("killed.db3");
    let beside = |path: &Path| PathBuf::from(format!("{}-wal", path.display()));
    for (from, to) in [(path.clone(), copy.clone()), (beside(&path), beside(&copy))] {
        std::fs::copy(from, to).expect("copied");
    }
    let (messages, summary) = read(&copy);
    assert!(messages == expected(0..300), "{}", messages.len());
    assert_eq!(summary.completeness, Completeness::Whole);
    // A cut log ends a transaction earlier; the log of another file is ignored.
    let log = std::fs::read(beside(&copy)).expect("it reads");
    std::fs::write(beside(&copy), &log[..log.len() / 2]).expect("written");
    assert!(read(&copy).0 == expected(0..100));
    std::fs::write(beside(&copy), vec![7; 9000]).expect("written");
    assert!(read(&copy).0 == expected(0..100));
}

#[test]
fn an_unfinished_transaction_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = written(folder.path(), 4096, 3, 20);
    std::fs::write(folder.path().join("4096-3-20.db3-journal"), [0xd9, 0xd5, 5, 0xf9, 0x20, 0xa1, 0x63, 0xd7, 0])
        .expect("written");
    assert!(matches!(read(&path).1.completeness, Completeness::Cut { readable_messages: 20, .. }));
}

/// Returns the result of a scan of these bytes.
fn scanned(bytes: &[u8]) -> Result<(Vec<Vec<u8>>, RawSummary), ScanError> {
    let files = BagFiles { bag: Cursor::new(bytes), log: None, is_in_transaction: false };
    let mut messages = Vec::new();
    let (summary, _) = scan_bag(files, |raw| messages.push(raw.data.to_vec()))?;
    Ok((messages, summary))
}

#[test]
fn a_cut_bag_gives_what_is_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes = std::fs::read(written(folder.path(), 1024, 4, 300)).expect("it reads");
    let whole: Vec<Vec<u8>> = expected(0..300).into_iter().map(|(.., data)| data).collect();
    let mut readable = Vec::new();
    for end in (0..bytes.len()).step_by(997) {
        let Ok((messages, summary)) = scanned(&bytes[..end]) else { continue };
        assert!(matches!(summary.completeness, Completeness::Cut { .. }), "{end}: {:?}", summary.completeness);
        let mut rest = whole.iter();
        assert!(messages.iter().all(|message| rest.any(|other| other == message)), "{end}");
        readable.push(messages.len());
    }
    // Most messages are readable if most of the file is present.
    assert!(readable.is_sorted() && readable[readable.len() * 9 / 10] > 200, "{readable:?}");
}

#[test]
fn changed_bytes_cost_no_more_than_the_file_has() {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes = std::fs::read(written(folder.path(), 512, 4, 150)).expect("it reads");
    let (mut whole, mut told) = (0, 0);
    for at in (0..bytes.len()).step_by(397) {
        for byte in [0, 0xff, bytes[at] ^ 1] {
            let mut changed = bytes.clone();
            changed[at] = byte;
            let Ok((messages, summary)) = scanned(&changed) else { continue };
            assert!(messages.iter().map(Vec::len).sum::<usize>() < bytes.len(), "{at}");
            match summary.completeness {
                Completeness::Whole => whole += 1,
                _ => told += 1,
            }
        }
    }
    // Most bytes are those of messages, which have no checksum.
    assert!(whole > 500 && told > 20, "{whole} {told}");
}

#[test]
fn pages_that_name_each_other_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bytes = std::fs::read(written(folder.path(), 512, 2, 150)).expect("it reads");
    // Inner pages of tables: all their children become the first one's.
    let inner: Vec<usize> = (512..bytes.len()).step_by(512).filter(|at| bytes[*at] == 5).collect();
    assert!(!inner.is_empty());
    for at in inner {
        let n = usize::from(u16::from_be_bytes([bytes[at + 3], bytes[at + 4]]));
        let cell = |k: usize| usize::from(u16::from_be_bytes([bytes[at + 12 + 2 * k], bytes[at + 13 + 2 * k]]));
        let cells: Vec<usize> = (0..n).map(cell).collect();
        let first: [u8; 4] = bytes[at + cells[0]..at + cells[0] + 4].try_into().expect("four");
        cells.iter().for_each(|cell| bytes[at + cell..at + cell + 4].copy_from_slice(&first));
        // The right child is its own parent.
        bytes[at + 8..at + 12].copy_from_slice(&(at as u32 / 512 + 1).to_be_bytes());
    }
    let (messages, summary) = scanned(&bytes).expect("it reads");
    assert!(messages.len() < 20, "{}", messages.len());
    let Completeness::Damaged { reason, lost_chunks, .. } = summary.completeness else { panic!("damaged") };
    assert!(lost_chunks > 3, "{lost_chunks}");
    insta::assert_snapshot!("pages_used_twice", reason);
}

#[test]
fn databases_that_are_no_bags_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let problem = |name: &str, sql: &str| {
        let path = folder.path().join(name);
        Connection::open(&path).expect("a file").execute(sql).expect("made");
        let error = for_each_raw(&path, |_| {}).expect_err("refused");
        assert!(matches!(error, LogError::NotBag { .. }), "{error}");
        let told = error.to_string();
        told[told.find(name).expect("the file's name")..].to_owned()
    };
    let topics = "CREATE TABLE topics(id,name,type,serialization_format);";
    let endless = "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id FROM n) SELECT id, 1 \
        AS topic_id, 1 AS timestamp, x'00' AS data FROM n";
    let mut told = vec![
        problem("a.db3", "CREATE TABLE a(b)"),
        problem("b.db3", &format!("{topics}CREATE TABLE messages(id,time,data)")),
        problem("c.db3", &format!("{topics}{endless}")),
        problem("d.db3", "PRAGMA encoding='UTF-16'; CREATE TABLE a(b)"),
    ];
    for (at, byte) in [(16, 3), (19, 9), (20, 255)] {
        let mut bytes = std::fs::read(folder.path().join("a.db3")).expect("it reads");
        bytes[16..18].copy_from_slice(&512_u16.to_be_bytes());
        bytes[at] = byte;
        let Err(ScanError::NotBag { found }) = scanned(&bytes) else { panic!("byte {at} is {byte}") };
        told.push(found);
    }
    insta::assert_snapshot!("no_bags", told.join("\n"));
    assert!(matches!(scanned(&b"SQLite format 3\0"[..]), Err(ScanError::NotBag { .. })));
}

//! ROS 2 bags as rosbag2 writes them with SQLite.

use std::path::Path;

use armcal::log::for_each_raw;
use sqlite::Connection;

/// Versions of rosbag2's tables: before Humble, Humble, Iron and later.
pub const VERSIONS: [u32; 3] = [2, 3, 4];

/// Writes to `bag` those messages of an MCAP file for whose index `is_kept` is true.
pub fn write_bag(bag: &Path, version: u32, recording: &Path, is_kept: impl Fn(usize) -> bool) {
    let bag = Connection::open(bag).expect("a file");
    let hash = if version >= 4 { ", type_description_hash TEXT NOT NULL" } else { "" };
    let mut tables = format!(
        "BEGIN;CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format \
         TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL{hash});\
         CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB \
         NOT NULL);CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
    );
    if version >= 3 {
        tables += "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL);\
            CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL);";
        tables += &format!("INSERT INTO schema VALUES({version},'humble');");
    }
    if version >= 4 {
        tables += "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY,topic_type TEXT NOT NULL,encoding TEXT NOT \
            NULL,encoded_message_definition TEXT NOT NULL,type_description_hash TEXT NOT NULL);";
    }
    bag.execute(&tables).expect("tables");
    let mut topics: Vec<String> = Vec::new();
    let mut place = 0;
    for_each_raw(recording, |raw| {
        place += 1;
        if !is_kept(place - 1) {
            return;
        }
        if !topics.iter().any(|topic| topic == raw.topic()) {
            topics.push(raw.topic().to_owned());
            let schema = raw.channel.schema.as_ref().expect("a type");
            let more = if version >= 4 { ", ''" } else { "" };
            let values = [raw.topic(), &schema.name, &raw.channel.message_encoding].map(str::as_bytes);
            insert(&bag, &format!("INSERT INTO topics VALUES(NULL, ?, ?, ?, ''{more})"), None, &values);
            if version >= 4 {
                let sql = "INSERT INTO message_definitions VALUES(NULL, ?, 'ros2msg', ?, '')";
                insert(&bag, sql, None, &[schema.name.as_bytes(), &schema.data]);
            }
        }
        let topic = topics.iter().position(|topic| topic == raw.topic()).expect("it is there") as i64 + 1;
        let sql = "INSERT INTO messages VALUES(NULL, ?, ?, ?)";
        insert(&bag, sql, Some([topic, raw.log_time_nanos as i64]), &[raw.data]);
    })
    .expect("it reads");
    bag.execute("COMMIT").expect("written");
}

/// Inserts numbers and a blob; without numbers, texts.
fn insert(bag: &Connection, sql: &str, numbers: Option<[i64; 2]>, rest: &[&[u8]]) {
    let mut statement = bag.prepare(sql).expect("sql");
    let mut at = 1;
    for number in numbers.iter().flatten() {
        statement.bind((at, *number)).expect("bound");
        at += 1;
    }
    for bytes in rest {
        match numbers {
            Some(_) => statement.bind((at, *bytes)).expect("bound"),
            None => statement.bind((at, std::str::from_utf8(bytes).expect("a text"))).expect("bound"),
        }
        at += 1;
    }
    statement.next().expect("inserted");
}

//! The tables of rosbag2: topics, types, messages.
//!
//! | table | columns | since |
//! |---|---|---|
//! | `topics` | id, name, type, serialization_format, .. | ever |
//! | `messages` | id, topic_id, timestamp (ns), data | ever |
//! | `schema` | schema_version, ros_distro | Humble |
//! | `message_definitions` | topic_type, encoding, encoded_message_definition, .. | Iron |

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Read, Seek};
use std::rc::Rc;

use super::declaration::column_names;
use super::pages::Pages;
use super::row::{Value, columns};
use super::tree::{Losses, Row, Wanted, for_each_row};
use crate::log::raw::completeness::{Completeness, RawSummary};
use crate::log::raw::contents::{FileContents, MAX_HEAD_BYTES};
use crate::log::raw::limits::{MAX_DECLARED_BYTES, MAX_RECORD_BYTES};
use crate::log::raw::message::{Channel, RawMessage, Schema};
use crate::log::raw::order::ChunkOrder;
use crate::log::raw::scan::ScanError;

/// Root page of the table of all tables.
const TABLES_ROOT: u32 = 1;
/// Names of the tables that are read; a file may declare any number.
const TABLES: [&str; 4] = ["topics", "messages", "schema", "message_definitions"];
/// Memory of a topic or type in addition to its texts, bytes.
const DECLARATION_BYTES: usize = 1024;

/// A bag's file, and the files that a killed recorder leaves next to it.
pub struct BagFiles<R> {
    pub bag: R,
    /// Log of writes that are not in the file yet (`-wal`).
    pub log: Option<R>,
    /// True if the writes of an unfinished transaction may be in the file (`-journal`).
    pub is_in_transaction: bool,
}

/// A table of the file.
struct Table {
    root: u32,
    columns: Vec<String>,
}

impl Table {
    fn place(&self, column: &str) -> Option<usize> {
        self.columns.iter().position(|name| name == column)
    }
}

struct Bag<R> {
    pages: Pages<R>,
    messages: Table,
    channels: BTreeMap<i64, Channel>,
    contents: FileContents,
    losses: Losses,
    is_in_transaction: bool,
    readable: u64,
}

/// A bag whose messages were visited, for a second visit of some of its parts.
pub struct SecondBagPass<R> {
    bag: Bag<R>,
}

impl<R: Read + Seek> SecondBagPass<R> {
    /// Visits the messages of these parts in the same order.
    pub fn visit(mut self, parts: &BTreeSet<u64>, visit: impl FnMut(&RawMessage<'_>)) -> io::Result<()> {
        self.bag.visit(Some(parts), visit)
    }
}

/// Passes every readable message of a bag to `visit`.
pub fn scan_bag<R: Read + Seek>(
    files: BagFiles<R>,
    visit: impl FnMut(&RawMessage<'_>),
) -> Result<(RawSummary, SecondBagPass<R>), ScanError> {
    let mut bag = Bag::open(files)?;
    bag.visit(None, visit)?;
    let summary = RawSummary {
        completeness: bag.completeness(),
        readable_messages: bag.readable,
        chunk_order: ChunkOrder::default(),
        contents: std::mem::take(&mut bag.contents),
    };
    Ok((summary, SecondBagPass { bag }))
}

/// Returns the contents of a bag other than messages.
pub fn bag_contents<R: Read + Seek>(files: BagFiles<R>) -> Result<FileContents, ScanError> {
    Bag::open(files).map(|bag| bag.contents)
}

impl<R: Read + Seek> Bag<R> {
    fn open(files: BagFiles<R>) -> Result<Self, ScanError> {
        let mut pages = Pages::open(files.bag, files.log)?;
        let mut losses = Losses::default();
        let mut tables = tables(&mut pages, &mut losses)?;
        let mut needed = |name: &str, wanted: &[&str]| {
            let table = tables.remove(name).ok_or_else(|| format!("it has no table `{name}`"))?;
            let lacks = wanted.iter().find(|column| table.place(column).is_none());
            lacks.map_or(Ok(table), |column| Err(format!("its table `{name}` has no column `{column}`")))
        };
        let refused = |found: String| ScanError::NotBag { found };
        let messages = needed("messages", &["topic_id", "timestamp", "data"]).map_err(refused)?;
        let topics = needed("topics", &["id", "name", "type", "serialization_format"]).map_err(refused)?;
        let mut small = Small { pages: &mut pages, losses: &mut losses, left_bytes: MAX_DECLARED_BYTES };
        let mut metadata = BTreeMap::new();
        if let Some(table) = tables.get("schema") {
            small.each(table, ["schema_version", "ros_distro"], |row, [version, distro]| {
                let version = version.integer().unwrap_or(row);
                metadata.insert("schema_version".to_owned(), version.to_string());
                metadata.extend(distro.text().map(|distro| ("ros_distro".to_owned(), distro.to_owned())));
            })?;
        }
        let types = match tables.get("message_definitions") {
            Some(table) => small.types(table)?,
            None => BTreeMap::new(),
        };
        let channels = small.channels(&topics, &types)?;
        let metadata = if metadata.is_empty() { Vec::new() } else { vec![("rosbag2".to_owned(), metadata)] };
        let contents = FileContents {
            bytes: pages.file_bytes(),
            profile: "ros2".to_owned(),
            library: "rosbag2, SQLite".to_owned(),
            metadata,
            ..FileContents::default()
        };
        let is_in_transaction = files.is_in_transaction;
        Ok(Self { pages, messages, channels, contents, losses, is_in_transaction, readable: 0 })
    }

    fn visit(&mut self, leaves: Option<&BTreeSet<u64>>, mut visit: impl FnMut(&RawMessage<'_>)) -> io::Result<()> {
        let places = ["topic_id", "timestamp", "data"].map(|column| self.messages.place(column));
        let wanted = Wanted { root: self.messages.root, max_bytes: MAX_RECORD_BYTES, leaves };
        let (channels, readable) = (&self.channels, &mut self.readable);
        self.pages.forget();
        for_each_row(&mut self.pages, &wanted, &mut self.losses, |row, losses| match message(row, &places, channels) {
            Ok(message) => {
                *readable += 1;
                visit(&message);
            }
            Err(what) => losses.lose_row(row.leaf, what),
        })
    }

    fn completeness(&self) -> Completeness {
        let (losses, readable_messages) = (&self.losses, self.readable);
        if self.pages.is_cut() && losses.pages == losses.missing_pages {
            let missing = losses.reason.as_deref().unwrap_or("no page of its tables is missing");
            let reason = format!("the file has fewer than its {} pages; {missing}", self.pages.declared);
            return Completeness::Cut { reason, readable_messages };
        }
        match &losses.reason {
            Some(reason) => Completeness::Damaged {
                reason: reason.clone(),
                lost_chunks: losses.pages,
                lost_bytes: losses.pages.saturating_mul(self.pages.usable_bytes as u64),
                lost_messages: (losses.pages == 0).then_some(losses.rows),
                readable_messages,
            },
            None if self.is_in_transaction => Completeness::Cut {
                reason: "its recorder was stopped while it wrote, as the journal beside it shows; the last messages \
                         may be missing"
                    .to_owned(),
                readable_messages,
            },
            None => Completeness::Whole,
        }
    }
}

fn message<'a>(
    row: &Row<'a>,
    places: &[Option<usize>; 3],
    channels: &'a BTreeMap<i64, Channel>,
) -> Result<RawMessage<'a>, &'static str> {
    let [topic, timestamp, data] = columns(row.payload, places).ok_or("a row contradicts itself")?;
    let (Some(topic), Some(timestamp), Value::Blob(data)) = (topic.integer(), timestamp.integer(), data) else {
        return Err("a row is no message");
    };
    let channel = channels.get(&topic).ok_or("a message is of no topic")?;
    let log_time_nanos = u64::try_from(timestamp).map_err(|_| "a message is older than 1970")?;
    let (sequence, part) = (row.number as u32, u64::from(row.leaf));
    Ok(RawMessage { channel, log_time_nanos, publish_time_nanos: log_time_nanos, sequence, part, data })
}

/// Returns the tables that SQLite itself lists, without views and tables without pages.
fn tables<R: Read + Seek>(pages: &mut Pages<R>, losses: &mut Losses) -> io::Result<BTreeMap<String, Table>> {
    let list = ["type", "name", "tbl_name", "rootpage", "sql"].map(str::to_owned).to_vec();
    let list = Table { root: TABLES_ROOT, columns: list };
    let mut found = BTreeMap::new();
    let mut small = Small { pages, losses, left_bytes: MAX_DECLARED_BYTES };
    small.each(&list, ["type", "name", "rootpage", "sql"], |_, [kind, name, root, sql]| {
        let root = root.integer().and_then(|root| u32::try_from(root).ok()).filter(|root| *root > 0);
        let name = name.text().filter(|name| TABLES.contains(name));
        if let (Some("table"), Some(name), Some(root)) = (kind.text(), name, root) {
            found.extend(sql.text().and_then(column_names).map(|columns| (name.to_owned(), Table { root, columns })));
        }
    })?;
    Ok(found)
}

/// Reader of tables that are kept in memory.
struct Small<'a, R> {
    pages: &'a mut Pages<R>,
    losses: &'a mut Losses,
    /// Number of bytes that may still be kept.
    left_bytes: usize,
}

impl<R: Read + Seek> Small<'_, R> {
    /// Returns the number and these columns of each row.
    fn each<const N: usize>(
        &mut self,
        table: &Table,
        names: [&str; N],
        mut visit: impl FnMut(i64, [Value<'_>; N]),
    ) -> io::Result<()> {
        let places = names.map(|name| table.place(name));
        let wanted = Wanted { root: table.root, max_bytes: MAX_HEAD_BYTES, leaves: None };
        let left_bytes = &mut self.left_bytes;
        for_each_row(self.pages, &wanted, self.losses, |row, losses| {
            let room = left_bytes.checked_sub(DECLARATION_BYTES + row.payload.len());
            match (columns(row.payload, &places), room) {
                (Some(values), Some(room)) => {
                    *left_bytes = room;
                    visit(row.number, values);
                }
                (None, _) => losses.lose_row(row.leaf, "a row contradicts itself"),
                (_, None) => losses.lose_row(row.leaf, "there are too many topics and types"),
            }
        })
    }

    /// Returns the definitions by the name of the type.
    fn types(&mut self, table: &Table) -> io::Result<BTreeMap<String, Rc<Schema>>> {
        let mut types = BTreeMap::new();
        let names = ["topic_type", "encoding", "encoded_message_definition"];
        self.each(table, names, |_, [name, encoding, definition]| {
            let Some(name) = name.text() else { return };
            let encoding = encoding.text().unwrap_or_default().to_owned();
            let data = definition.text().unwrap_or_default().as_bytes().to_vec();
            types.insert(name.to_owned(), Rc::new(Schema { name: name.to_owned(), encoding, data }));
        })?;
        Ok(types)
    }

    /// Returns the topics by their numbers.
    fn channels(&mut self, table: &Table, types: &BTreeMap<String, Rc<Schema>>) -> io::Result<BTreeMap<i64, Channel>> {
        let mut channels = BTreeMap::new();
        let names = ["id", "name", "type", "serialization_format"];
        self.each(table, names, |row, [id, topic, kind, encoding]| {
            let (Some(topic), Some(kind)) = (topic.text(), kind.text()) else { return };
            let bare = || Schema { name: kind.to_owned(), encoding: String::new(), data: Vec::new() };
            let channel = Channel {
                topic: topic.to_owned(),
                message_encoding: encoding.text().unwrap_or_default().to_owned(),
                metadata: BTreeMap::new(),
                schema: Some(types.get(kind).cloned().unwrap_or_else(|| Rc::new(bare()))),
            };
            channels.insert(id.integer().unwrap_or(row), channel);
        })?;
        Ok(channels)
    }
}

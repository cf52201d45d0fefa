//! Rows from YAML, which includes JSON: a list or a map with one entry per row.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

use super::columns_seen::ColumnsSeen;
use super::rows::{MAX_COLUMNS, MAX_ROWS, Rows, Wanted, check_count};
use crate::input::error::InputError;

/// Maximum nesting of maps and lists.
const MAX_DEPTH: usize = 32;

/// Key in the path of a column for every index of a list; each index makes a row.
const STAR: &str = "*";

/// Names in paths for the indices of a list of maps.
#[derive(Clone, Copy, PartialEq)]
enum Lists {
    /// One star for all indices.
    Starred,
    Numbered,
}

/// A part of the file.
#[derive(Debug)]
enum Node {
    /// A scalar, which may be a number: it is parsed later.
    Scalar(String),
    List(Vec<Node>),
    /// A map in the order of the file.
    Map(Vec<(String, Node)>),
}

impl Node {
    /// Returns the part at `key`: a key of a map, or an index of a list, from 0.
    fn get(&self, key: &str) -> Option<&Self> {
        match self {
            Self::Scalar(_) => None,
            Self::List(list) => list.get(key.parse::<usize>().ok()?),
            Self::Map(map) => map.iter().find(|(name, _)| name == key).map(|(_, node)| node),
        }
    }

    fn at<'a>(&self, path: impl IntoIterator<Item = &'a str>) -> Option<&Self> {
        path.into_iter().try_fold(self, |node, key| node.get(key))
    }

    /// Returns the scalar at the path of a column, with index `place` for its star; empty if there is none.
    fn cell(&self, column: &str, place: usize) -> &str {
        let place = place.to_string();
        match self.at(column.split('.').map(|key| if key == STAR { place.as_str() } else { key })) {
            Some(Self::Scalar(cell)) => cell,
            _ => "",
        }
    }

    /// Returns the length of the list that has a star in the path of `column`.
    fn n_starred(&self, column: &str) -> usize {
        match self.at(column.split('.').take_while(|key| *key != STAR)) {
            Some(Self::List(list)) => list.len(),
            _ => 0,
        }
    }

    /// Returns the paths of all scalars, in the order of the file. A list of maps counts once, with a star for the
    /// index.
    fn leaves(&self, lists: Lists) -> Vec<String> {
        let join = |key: &str, below: String| if below.is_empty() { key.to_owned() } else { format!("{key}.{below}") };
        let of = |key: String, node: &Self, lists: Lists| {
            node.leaves(lists).into_iter().map(move |below| join(&key, below)).collect::<Vec<_>>()
        };
        match self {
            Self::Scalar(_) => vec![String::new()],
            Self::List(list) => match list.first() {
                Some(first @ Self::Map(_)) if lists == Lists::Starred => of(STAR.to_owned(), first, Lists::Numbered),
                _ => list.iter().enumerate().flat_map(|(k, node)| of(k.to_string(), node, lists)).collect(),
            },
            Self::Map(map) => map.iter().flat_map(|(key, node)| of(key.clone(), node, lists)).collect(),
        }
    }

    /// The paths of all scalars.
    fn columns(&self, before: &str, found: &mut BTreeSet<String>) {
        if found.len() >= MAX_COLUMNS {
            return;
        }
        let path = |key: &str| if before.is_empty() { key.to_owned() } else { format!("{before}.{key}") };
        match self {
            Self::Scalar(_) => drop(found.insert(before.to_owned())),
            Self::List(list) => {
                list.iter().enumerate().for_each(|(k, node)| node.columns(&path(&k.to_string()), found))
            }
            Self::Map(map) => map.iter().for_each(|(key, node)| node.columns(&path(key), found)),
        }
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, a text, a list or a map")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Node, E> {
        Ok(Node::Scalar(value.to_string()))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Node, E> {
        Ok(Node::Scalar(value.to_string()))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Node, E> {
        Ok(Node::Scalar(value.to_string()))
    }

    /// The shortest text that reads as the same number.
    fn visit_f64<E>(self, value: f64) -> Result<Node, E> {
        Ok(Node::Scalar(value.to_string()))
    }

    fn visit_str<E>(self, value: &str) -> Result<Node, E> {
        Ok(Node::Scalar(value.to_owned()))
    }

    fn visit_unit<E>(self) -> Result<Node, E> {
        Ok(Node::Scalar(String::new()))
    }

    fn visit_none<E>(self) -> Result<Node, E> {
        Ok(Node::Scalar(String::new()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut given: A) -> Result<Node, A::Error> {
        let mut list = Vec::new();
        while let Some(node) = given.next_element()? {
            list.push(node);
        }
        Ok(Node::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut given: A) -> Result<Node, A::Error> {
        let mut map = Vec::new();
        while let Some(entry) = given.next_entry()? {
            map.push(entry);
        }
        Ok(Node::Map(map))
    }
}

fn parse(file: &str, text: &str) -> Result<Node, InputError> {
    // The number of nodes that aliases create is limited separately.
    let budget = serde_saphyr::budget! { max_depth: MAX_DEPTH, alias_anchor_min_aliases: MAX_ROWS };
    let options = serde_saphyr::options! { budget: budget };
    serde_saphyr::from_str_with_options(&as_one_list(text), options).map_err(|error| {
        let error = error.to_string();
        let problem = match error.contains("budget breached") {
            true => format!("has more than armcal reads as YAML or JSON; write the table as CSV. {error}"),
            false => format!("is no YAML of this kind: {error}"),
        };
        InputError::Table { file: file.to_owned(), problem }
    })
}

/// JSON with an entry in each line as a list of them.
fn as_one_list(text: &str) -> Cow<'_, str> {
    let lines = || text.lines().map(str::trim).filter(|line| !line.is_empty());
    let is_entry = |line: &str| line.starts_with('{') && line.ends_with('}');
    if lines().count() > 1 && lines().all(is_entry) {
        return format!("[{}]", lines().collect::<Vec<_>>().join(",\n")).into();
    }
    text.into()
}

/// Returns the entries of a list or a map that are lists or maps themselves; none if any entry is a scalar.
fn entries(node: &Node) -> Vec<&Node> {
    let all: Vec<&Node> = match node {
        Node::List(list) => list.iter().collect(),
        Node::Map(map) => map.iter().map(|(_, node)| node).collect(),
        Node::Scalar(_) => Vec::new(),
    };
    if all.iter().any(|entry| matches!(entry, Node::Scalar(_))) { Vec::new() } else { all }
}

/// Number of numbers in an entry above which it is a column of a table, because joints and a pose have fewer.
const MANY: usize = 24;

/// Returns the columns of the entry that has most of them.
fn columns_of(rows: &[&Node]) -> Vec<String> {
    let most = rows.iter().map(|row| row.leaves(Lists::Starred)).reduce(|a, b| if b.len() > a.len() { b } else { a });
    most.unwrap_or_default().into_iter().take(MAX_COLUMNS).collect()
}

/// Returns the number of rows of an entry: one, or one for each index of the list that a column has a star for.
fn n_rows_of(entry: &Node, columns: &[String]) -> usize {
    let starred = columns.iter().find(|column| column.split('.').any(|key| key == STAR));
    starred.map_or(1, |column| entry.n_starred(column))
}

/// Columns of the rows that a file holds.
pub(super) struct YamlColumns {
    pub seen: ColumnsSeen,
    /// Keys that lead to the rows.
    pub rows_at: Vec<String>,
    /// Names that another list of the file gives to numbered columns, by column.
    pub other_names: BTreeMap<String, String>,
}

/// Examines all cells of the list or map with the most entries that are lists or maps, at the top or below one key.
pub(super) fn yaml_columns(file: &str, text: &str) -> Result<YamlColumns, InputError> {
    let all = parse(file, text)?;
    let below: Vec<(Vec<String>, &Node)> = match &all {
        Node::Map(map) => map.iter().map(|(key, node)| (vec![key.clone()], node)).collect(),
        Node::List(_) | Node::Scalar(_) => Vec::new(),
    };
    let candidates = std::iter::once((Vec::new(), &all)).chain(below);
    let found = candidates.map(|(path, node)| (path, entries(node))).max_by_key(|(path, rows)| {
        let is_uniform = rows.windows(2).all(|two| two[0].leaves(Lists::Starred) == two[1].leaves(Lists::Starred));
        // The whole file comes before its parts; a map of one list is that list.
        (is_uniform, rows.len() > 1, rows.len(), path.is_empty())
    });
    let Some((rows_at, rows)) = found.filter(|(_, rows)| !rows.is_empty()) else {
        let keys: Vec<String> = match &all {
            Node::Map(map) => map.iter().take(12).map(|(key, _)| key.clone()).collect(),
            Node::List(_) | Node::Scalar(_) => Vec::new(),
        };
        let problem = format!(
            "it is a YAML or JSON text without a list of rows (keys {keys:?}); armcal reads tables (CSV, YAML, JSON) \
             with one row or entry per pose, and recordings (.mcap, .db3)"
        );
        return Err(InputError::Table { file: file.to_owned(), problem });
    };
    check_count(file, rows.len())?;
    let names = columns_of(&rows);
    let mut seen = ColumnsSeen::of_names(names.iter().map(String::as_str));
    for row in &rows {
        (0..n_rows_of(row, &names)).for_each(|place| seen.add_row(names.iter().map(|name| row.cell(name, place))));
        check_count(file, seen.n_rows)?;
    }
    if let Node::Map(map) = all.at(rows_at.iter().map(String::as_str)).unwrap_or(&all)
        && names.iter().enumerate().all(|(k, name)| *name == k.to_string() && names.len() > MANY)
    {
        let keys: Vec<&String> = map.iter().take(12).map(|(key, _)| key).collect();
        let problem = format!(
            "its entries {keys:?} are columns and not rows; write one entry for each row (pandas: \
             `to_json(orient=\"records\")`), or CSV"
        );
        return Err(InputError::Table { file: file.to_owned(), problem });
    }
    Ok(YamlColumns { seen, rows_at, other_names: names_beside(&all, &names) })
}

/// Returns the names of numbered columns by a list of as many texts.
fn names_beside(all: &Node, columns: &[String]) -> BTreeMap<String, String> {
    let Node::Map(map) = all else { return BTreeMap::new() };
    let is_numbered = columns.iter().enumerate().all(|(k, column)| *column == k.to_string());
    let texts = |node: &Node| match node {
        Node::List(list) if is_numbered && list.len() == columns.len() => list.iter().map(text_of).collect(),
        _ => None,
    };
    let names: Option<Vec<String>> = map.iter().find_map(|(_, node)| texts(node));
    names.unwrap_or_default().into_iter().zip(columns.iter().cloned()).collect()
}

/// A scalar that is no number.
fn text_of(node: &Node) -> Option<String> {
    match node {
        Node::Scalar(text) if !text.is_empty() && text.parse::<f64>().is_err() => Some(text.clone()),
        _ => None,
    }
}

/// Reads the paths `wanted` of each entry.
pub(super) fn yaml_rows(file: &str, text: &str, rows_at: &[String], wanted: Wanted<'_>) -> Result<Rows, InputError> {
    let bad = |problem: String| InputError::Table { file: file.to_owned(), problem };
    let all = parse(file, text)?;
    let path = rows_at.join(".");
    let entries: Vec<&Node> = match all.at(rows_at.iter().map(String::as_str)) {
        Some(Node::List(list)) => list.iter().collect(),
        Some(Node::Map(map)) => map.iter().map(|(_, node)| node).collect(),
        Some(Node::Scalar(_)) | None => {
            return Err(bad(format!("there is no list or map of rows at `table.rows` = {path:?} of the input map")));
        }
    };
    let mut columns: BTreeSet<String> = columns_of(&entries).into_iter().collect();
    entries.iter().take(1).for_each(|first| first.columns("", &mut columns));
    let stars: BTreeSet<&str> = wanted.names.iter().filter_map(|name| Some(name.split_once(STAR)?.0)).collect();
    if stars.len() > 1 {
        return Err(bad(format!("the columns have a star for different lists, {stars:?}; name columns of one list")));
    }
    let mut rows = Vec::new();
    for entry in entries {
        for place in 0..n_rows_of(entry, wanted.names) {
            let cell = |column: &String| Some(entry.cell(column, place));
            rows.push(wanted.row((file, rows.len() as u64 + 1), cell)?);
        }
        check_count(file, rows.len())?;
    }
    Ok(Rows { rows, columns })
}

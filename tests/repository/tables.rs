//! Generated pages: the keys of files from their schemas, the options of commands from clap. `INSTA_UPDATE=always`
//! updates them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

use armcal_core::kind::Kind;
use armcal_core::schema::committed;
use serde_json::Value;

use crate::support::{read, root};

pub(super) const KEYS: &str = "docs/reference/keys.md";
pub(super) const OPTIONS: &str = "docs/reference/options.md";
/// Kinds of files that people write.
const WRITTEN: [Kind; 7] =
    [Kind::Robot, Kind::Vehicle, Kind::Routine, Kind::Input, Kind::TagMap, Kind::Task, Kind::Arm];
/// Types of keys that have tables of their own.
const TABLE: &str = "table";
const TABLES: &str = "tables";
/// Keys that a heading shows.
const HEADS: [&str; 3] = ["do", "kind", "version"];
/// Largest number of keys for users to read, without those of the simulated world.
const MOST_KEYS: usize = 300;

/// Compares a page with `text`, or updates it.
#[track_caller]
fn hold(page: &str, text: &str) {
    let file = root().join(page);
    if std::env::var("INSTA_UPDATE").is_ok_and(|update| update == "always") {
        fs::write(file, text).expect("written");
    } else {
        assert!(read(&file) == text, "{page} is not what its sources make; INSTA_UPDATE=always renews it");
    }
}

/// One kind's schema, and the tables of its page.
struct Tables<'a, 'w> {
    root: &'a Value,
    out: String,
    /// Headings by the names of the keys below them.
    written: &'w mut BTreeMap<String, String>,
}

impl<'a> Tables<'a, '_> {
    /// The schema to which a reference leads.
    fn followed(&self, schema: &'a Value) -> &'a Value {
        let reference = reference(schema);
        reference.and_then(|at| self.root.pointer(at.trim_start_matches('#'))).unwrap_or(schema)
    }

    /// Writes the table of `schema`, called `name`, then those below it.
    fn table(&mut self, name: &str, schema: &'a Value) {
        let schema = self.followed(schema);
        if let Some(kinds) = schema["oneOf"].as_array() {
            let is_fault = |kind: &&Value| kind["properties"]["do"]["const"] == "fault";
            for kind in kinds.iter().filter(|kind| !is_fault(kind)) {
                let tag = ["do", "kind"].iter().rev().find(|tag| kind["properties"][tag].get("const").is_some());
                let tag = tag.expect("a tag");
                let value = kind["properties"][tag]["const"].as_str().expect("a name");
                self.table(&format!("{name} {tag} = \"{value}\""), kind);
            }
            if kinds.iter().any(|kind| is_fault(&kind)) {
                let text =
                    "A fault of the simulated world at this step: `kind` and keys of [[world.fault]], no `at_s`.";
                let _ = writeln!(self.out, "\n### {name} do = \"fault\"\n\n{text}");
            }
            return;
        }
        let Some(keys) = schema["properties"].as_object() else { return };
        let rows: Vec<String> = keys.iter().filter_map(|(key, of_key)| self.row(key, of_key, schema)).collect();
        let names = || keys.keys().filter(|key| !HEADS.contains(&key.as_str())).cloned().collect::<Vec<_>>().join(" ");
        if let Some(shown) = self.written.get(&names()).filter(|_| rows.len() > 1) {
            let _ = writeln!(self.out, "\n### {name}\n\nThe keys of {shown}.");
            return;
        }
        self.written.insert(names(), name.to_owned());
        if !name.is_empty() {
            let _ = writeln!(self.out, "\n### {name}\n");
            if let Some(text) = schema["description"].as_str() {
                let _ = writeln!(self.out, "{}\n", escaped(text));
            }
        }
        if !rows.is_empty() {
            let _ =
                writeln!(self.out, "| key | type | unit | allowed | default | meaning |\n|---|---|---|---|---|---|");
            rows.iter().for_each(|row| self.out.push_str(row));
        }
        for (key, of_key) in keys {
            let below = self.followed(of_key);
            let inner = name.trim_matches(['[', ']']);
            let full = if inner.is_empty() { key.clone() } else { format!("{inner}.{key}") };
            if is_table(below) {
                self.table(&format!("[{full}]"), below);
            } else if below["type"] == "array" && is_table(self.followed(&below["items"])) {
                self.table(&format!("[[{full}]]"), &below["items"]);
            }
        }
    }

    /// The row of a key; `None` for a key in the heading.
    fn row(&self, key: &str, of_key: &'a Value, owner: &Value) -> Option<String> {
        if of_key.get("const").is_some() && HEADS.contains(&key) {
            return None;
        }
        let schema = self.followed(of_key);
        let needed = owner["required"].as_array().is_some_and(|keys| keys.iter().any(|name| name == key));
        let usual = match of_key.get("default") {
            Some(value) if value.is_object() || *value == Value::Array(Vec::new()) => String::new(),
            Some(value) => value.to_string(),
            None if needed => "needed".to_owned(),
            None => String::new(),
        };
        let text = of_key["description"].as_str().or_else(|| schema["description"].as_str()).unwrap_or_default();
        let (kind, allowed) = (self.kind(schema), self.allowed(schema));
        let unit = of_key["unit"].as_str().unwrap_or_default();
        Some(format!("| `{key}` | {kind} | {unit} | {allowed} | {usual} | {} |\n", escaped(text)))
    }

    fn kind(&self, schema: &'a Value) -> String {
        let schema = self.followed(schema);
        match schema["type"].as_str() {
            Some("array") => {
                let n = schema["maxItems"].as_u64().map_or_else(|| "list".to_owned(), |n| format!("{n}"));
                if is_table(self.followed(&schema["items"])) {
                    TABLES.to_owned()
                } else {
                    format!("{n} of {}", self.kind(&schema["items"]))
                }
            }
            Some("object") => TABLE.to_owned(),
            Some("boolean") => "true, false".to_owned(),
            Some("string") | None => "text".to_owned(),
            Some(other) => other.to_owned(),
        }
    }

    fn allowed(&self, schema: &'a Value) -> String {
        let schema = self.followed(schema);
        if schema["type"] == "array" {
            return self.allowed(&schema["items"]);
        }
        if let (Some(low), Some(high)) = (schema["minimum"].as_f64(), schema["maximum"].as_f64()) {
            return format!("{low} to {high}");
        }
        let names = schema["enum"].as_array().map(|names| names.iter().filter_map(Value::as_str).collect::<Vec<_>>());
        let constants =
            || schema["oneOf"].as_array().map(|all| all.iter().filter_map(|one| one["const"].as_str()).collect());
        let one = || schema["const"].as_str().map(|one| vec![one]);
        names
            .or_else(constants)
            .or_else(one)
            .unwrap_or_default()
            .iter()
            .map(|name| format!("`{name}`"))
            .collect::<Vec<_>>()
            .join(", ")
    }
}

fn reference(schema: &Value) -> Option<&str> {
    schema.get("$ref").or_else(|| schema.pointer("/allOf/0/$ref")).and_then(Value::as_str)
}

fn is_table(schema: &Value) -> bool {
    schema.get("properties").is_some() || schema["oneOf"][0].get("properties").is_some()
}

fn escaped(text: &str) -> String {
    text.replace('|', "\\|")
}

fn keys_page() -> String {
    let mut page = "# Keys of TOML files\n\nAll keys of the files that people write, for looking one up. Made from \
                    the types that read the files;\n`armcal schema KIND` prints the same as JSON Schema for editors. \
                    Editors find it by\nthe first line of files that armcal writes, `#:schema ADDRESS`. \
                    Every file begins with\n`version = 1` and its `kind`.\n"
        .to_owned();
    let mut written = BTreeMap::new();
    for kind in WRITTEN {
        let schema: Value = serde_json::from_str(committed(kind)).expect("JSON");
        let out = format!("\n## {}\n\n`kind = \"{}\"`: {}.\n\n", kind.name(), kind.name(), kind.in_words());
        let mut tables = Tables { root: &schema, out, written: &mut written };
        tables.table("", &schema);
        page += &tables.out;
    }
    page
}

#[test]
fn the_page_of_keys_is_that_of_the_schemas() {
    hold(KEYS, &keys_page());
}

/// Counts keys by kind, without tables; keys of a table in several kinds count once.
#[test]
fn keys_stay_few() {
    let mut counts = BTreeMap::new();
    let (mut kind, mut is_world) = (String::new(), false);
    for line in keys_page().lines() {
        if let Some(name) = line.strip_prefix("## ") {
            (kind, is_world) = (name.to_owned(), false);
        } else if let Some(name) = line.strip_prefix("### ") {
            is_world = name.contains("[world") || name.contains("\"fault\"");
        } else if line.starts_with("| `") && !is_world && !is_nested(line) {
            *counts.entry(kind.clone()).or_insert(0_usize) += 1;
        }
    }
    let sum: usize = counts.values().sum();
    eprintln!("{sum} keys: {counts:?}");
    assert!(sum <= MOST_KEYS, "{sum} keys: {counts:?}");
}

/// True for a row whose keys are below a heading of their own.
fn is_nested(row: &str) -> bool {
    row.split('|').nth(2).is_some_and(|kind| [TABLE, TABLES].contains(&kind.trim()))
}

fn options_page() -> String {
    let mut page = "# Options of commands\n\nEvery option of every command, for looking one up. Made from the \
                    program's own help.\nWhat the commands do is in [commands.md](commands.md).\n"
        .to_owned();
    let command = armcal::cli::command();
    for below in command.get_subcommands().filter(|below| !below.is_hide_set()) {
        let about = below.get_about().map(ToString::to_string).unwrap_or_default();
        let _ = writeln!(page, "\n## {}\n\n{about}.\n\n| option | meaning |\n|---|---|", below.get_name());
        for argument in below.get_arguments().filter(|argument| !argument.is_hide_set()) {
            let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
            let usual: Vec<_> = argument.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
            let usual = if usual.is_empty() || !argument.get_action().takes_values() {
                String::new()
            } else {
                format!("; default {}", usual.join(", "))
            };
            let values: Vec<String> =
                argument.get_value_names().unwrap_or_default().iter().map(|name| format!(" {name}")).collect();
            let values = if argument.get_action().takes_values() { values.concat() } else { String::new() };
            let name = match (argument.get_long(), argument.get_short()) {
                (Some(long), Some(short)) => format!("-{short}, --{long}{values}"),
                (Some(long), None) => format!("--{long}{values}"),
                _ => values.trim_start().to_owned(),
            };
            let _ = writeln!(page, "| `{name}` | {}{usual} |", escaped(&help.replace('\n', " ")));
        }
    }
    page
}

#[test]
fn the_page_of_options_is_that_of_the_commands() {
    hold(OPTIONS, &options_page());
}

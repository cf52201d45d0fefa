//! Overrides: keys of a routine replaced from outside, such as `--set capture.poses=20`.
//!
//! Overrides are written into the routine's table before it is read, so they pass the same checks as the file itself.

use crate::codes::Code;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::de::DeserializeOwned;
use toml::{Table, Value};

use super::error::RoutineError;
use crate::document::{check_head, parse_file};
use crate::kind::Kind;
use crate::robot::{FileIssue, parse_toml, read_text};
use crate::text::with_nearest;

/// Origin of an override, for messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OverrideOrigin {
    /// An option of the command line.
    CommandLine,
    /// A value of `[campaign.matrix]`.
    Matrix,
}

/// An override: a key and its new value.
#[derive(Clone, Debug, PartialEq)]
pub struct Override {
    /// Dotted path into the routine; a number counts within a list, from 0.
    pub key: String,
    /// New value, which replaces the file's value of any type.
    pub value: Value,
    /// Origin of the value.
    pub origin: OverrideOrigin,
}

/// Overrides of a routine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overrides {
    /// Overrides in the given order: the last one of a key applies.
    pub set: Vec<Override>,
    /// Folder of another robot, relative to the working directory.
    pub robot: Option<PathBuf>,
    /// Another vehicle file, relative to the working directory.
    pub vehicle: Option<PathBuf>,
}

impl Override {
    /// # Errors
    /// The problem of the key.
    pub fn new(key: &str, value: Value) -> Result<Self, String> {
        let is_plain =
            |part: &str| !part.is_empty() && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        if !key.split('.').all(is_plain) {
            return Err(format!("`{key}` is not a key: keys are words joined by dots, as world.camera.rate_hz"));
        }
        Ok(Self { key: key.to_owned(), value, origin: OverrideOrigin::CommandLine })
    }

    /// Returns the override as a value of the matrix.
    #[must_use]
    pub fn of_matrix(self) -> Self {
        Self { origin: OverrideOrigin::Matrix, ..self }
    }

    /// Returns the override with its origin, for messages.
    fn with_origin(&self) -> String {
        match self.origin {
            OverrideOrigin::CommandLine => format!("--set {self}"),
            OverrideOrigin::Matrix => format!("campaign.matrix.{self}"),
        }
    }

    fn apply(&self, table: &mut Table) -> Result<(), String> {
        let (parents, last) = match self.key.rsplit_once('.') {
            Some((parents, last)) => (parents.split('.').collect(), last),
            None => (Vec::new(), self.key.as_str()),
        };
        let Some((first, rest)) = parents.split_first() else {
            table.insert(last.to_owned(), self.value.clone());
            return Ok(());
        };
        let mut at = table.entry(*first).or_insert_with(|| Value::Table(Table::new()));
        for part in rest {
            at = child(at, part, &self.key)?;
        }
        *child(at, last, &self.key)? = self.value.clone();
        Ok(())
    }
}

/// Returns the value under `part`, and inserts it if a table lacks it.
fn child<'a>(at: &'a mut Value, part: &str, key: &str) -> Result<&'a mut Value, String> {
    match at {
        Value::Table(table) => Ok(table.entry(part).or_insert_with(|| Value::Table(Table::new()))),
        Value::Array(list) => {
            let n = list.len();
            let problem = || format!("`{part}` in `{key}` must be a number below {n}: it counts within a list");
            part.parse::<usize>().ok().and_then(|index| list.get_mut(index)).ok_or_else(problem)
        }
        _ => Err(format!("`{key}`: what `{part}` is looked for in is a plain value, not a table")),
    }
}

/// Parses a TOML value; a plain word is a string.
fn parse_value(text: &str) -> Result<Value, String> {
    match toml::from_str::<Table>(&format!("value = {text}")) {
        Ok(mut table) if table.len() == 1 => table.remove("value").ok_or_else(|| format!("`{text}` is no value")),
        Ok(_) => Err(format!("`{text}` is more than one value")),
        Err(_) if is_word(text) => Ok(Value::String(text.to_owned())),
        Err(error) => Err(format!("`{text}` is no TOML value: {}", error.message())),
    }
}

fn is_word(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c))
}

impl FromStr for Override {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (key, value) = text.split_once('=').ok_or_else(|| format!("`{text}` is not KEY=VALUE"))?;
        Self::new(key.trim(), parse_value(value.trim())?)
    }
}

/// Writes `KEY=VALUE`, which parses as the same override.
impl fmt::Display for Override {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.value {
            Value::String(word) if is_word(word) && parse_value(word).as_ref() == Ok(&self.value) => {
                write!(f, "{}={word}", self.key)
            }
            value => write!(f, "{}={value}", self.key),
        }
    }
}

/// Returns the table of a routine file with overrides applied, not yet checked.
///
/// # Errors
/// [`RoutineError`] if the file is no TOML or no key accepts an override.
pub fn effective_table(file: &Path, set: &[Override]) -> Result<Table, RoutineError> {
    let mut table: Table = parse_toml(file, &read_text(file)?)?;
    check_head(Kind::Routine, file, &table)?;
    for one in set {
        one.apply(&mut table)
            .map_err(|problem| FileIssue::new(Code::ValueInvalid, file, one.with_origin(), problem))?;
    }
    Ok(table)
}

/// Reads a routine file as `T`, with overrides applied.
pub(super) fn read_with<T: DeserializeOwned>(file: &Path, set: &[Override]) -> Result<T, RoutineError> {
    let read_alone = || -> Result<T, RoutineError> { Ok(parse_file(Kind::Routine, file, &read_text(file)?)?) };
    if set.is_empty() {
        return read_alone();
    }
    effective_table(file, set)?.try_into().map_err(|error: toml::de::Error| {
        // A problem that exists without the overrides is reported with its line.
        read_alone().err().unwrap_or_else(|| {
            let given: Vec<String> = set.iter().map(Override::with_origin).collect();
            let problem = with_nearest(&error.to_string().trim().replace('\n', " "));
            FileIssue::new(Code::ValueInvalid, file, given.join(" "), problem).into()
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Value {
        text.parse::<Override>().expect("an override").value
    }

    #[test]
    fn values_are_toml_and_plain_words_are_strings() {
        assert_eq!(value("a=20"), Value::Integer(20));
        assert_eq!(value("a=0.45"), Value::Float(0.45));
        assert_eq!(value("a = true"), Value::Boolean(true));
        assert_eq!(value("a=minimum_distance"), Value::String("minimum_distance".into()));
        assert_eq!(value("a=../robots/titan4"), Value::String("../robots/titan4".into()));
        assert_eq!(value("a=\"two words\""), Value::String("two words".into()));
        assert_eq!(value("a=[1.0, 2.0]"), Value::Array(vec![Value::Float(1.0), Value::Float(2.0)]));
        for bad in ["a", "=1", "a..b=1", "a=", "a=two words", "a=1\nb=2", "a b=1", "a=[1"] {
            assert!(bad.parse::<Override>().is_err(), "{bad}");
        }
    }

    #[test]
    fn a_wrong_value_of_the_matrix_is_not_blamed_on_the_command_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("r.toml");
        std::fs::write(&file, "version = 1\nkind = \"routine\"\nseed = 1\n").expect("written");
        let one: Override = "seed.a=1".parse().expect("an override");
        let told = |one: Override| effective_table(&file, &[one]).expect_err("no table").to_string();
        assert!(told(one.clone()).contains("--set"));
        let of_matrix = told(one.of_matrix());
        assert!(of_matrix.contains("campaign.matrix.seed.a=1") && !of_matrix.contains("--set"), "{of_matrix}");
    }

    #[test]
    fn the_text_of_an_override_reads_back() {
        for text in ["a=20", "a.b=0.45", "a=1e-9", "a=word", "a=\"two words\"", "a=\"20\"", "a=[1.0, [2.0]]", "a=\"\""]
        {
            let one: Override = text.parse().expect("an override");
            assert_eq!(one.to_string().parse::<Override>().as_ref(), Ok(&one), "{text} became {one}");
        }
        assert_eq!("a=word".parse::<Override>().expect("an override").to_string(), "a=word");
    }

    #[test]
    fn overrides_reach_into_tables_and_lists() {
        let mut table: Table = "a = 1\n[b]\nc = 2\n[[d]]\ne = 3\n[[d]]\ne = 4".parse().expect("TOML");
        for text in ["a=10", "b.c=20", "b.new=21", "x.y.z=5", "d.1.e=40"] {
            text.parse::<Override>().expect("an override").apply(&mut table).expect("applied");
        }
        let expected: Table =
            "a = 10\n[b]\nc = 20\nnew = 21\n[[d]]\ne = 3\n[[d]]\ne = 40\n[x.y]\nz = 5".parse().expect("TOML");
        assert_eq!(table, expected);
        for text in ["d.2.e=1", "d.x=1", "a.b=1"] {
            assert!(text.parse::<Override>().expect("an override").apply(&mut table).is_err(), "{text}");
        }
    }
}

//! Problems of a TOML text: all missing keys at once, and for an unknown key the likeliest known one.
//!
//! A reader stops at the first missing key. So that key is inserted with a value that it accepts, and the text is read
//! again. This ends when no key is missing or another mistake comes first.

use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::de::Error;

use crate::codes::Code;
use crate::text::with_nearest;

/// Values that keys may accept, the plain ones first.
const VALUES: [&str; 10] =
    ["0", "\"\"", "true", "[]", "{}", "[0, 0, 0]", "[0, 0, 0, 0]", "[0, 0]", "[[0, 0, 0]]", "[\"\", \"\", \"\"]"];
/// Maximum length of texts that are read repeatedly.
const MAX_BYTES: usize = 100_000;
const MAX_MISSING: usize = 100;

/// Returns the reader's message with all missing keys.
pub(super) fn explained<T: DeserializeOwned>(text: &str, error: &Error) -> String {
    let mut message = with_nearest(error.to_string().trim_end());
    let others = others_missing::<T>(text, error);
    if !others.is_empty() {
        message += &format!("; also missing: {}", others.join(", "));
    }
    message
}

/// Returns the class of a reader's message, of TOML as of YAML.
#[must_use]
pub fn syntax_code(message: &str) -> Code {
    let kinds = [
        ("unknown field", Code::KeyUnknown),
        ("missing field", Code::KeyMissing),
        ("duplicate", Code::ValueDuplicate),
        ("unknown variant", Code::NameUnknown),
        ("invalid type", Code::ValueType),
        ("invalid length", Code::ValueCount),
        ("invalid value", Code::ValueInvalid),
    ];
    kinds.into_iter().find(|(words, _)| message.contains(words)).map_or(Code::FileSyntax, |(_, code)| code)
}

/// Describes the problem of a value in a text that was already read: without a line, and with the likeliest known key.
#[must_use]
pub fn toml_problem(error: &toml::de::Error) -> String {
    with_nearest(error.message().trim_end())
}

/// Reads a table of a text that was already read; the message has no line.
///
/// # Errors
/// The problem in words, with every other missing key.
pub fn from_table<T: DeserializeOwned>(table: &toml::Table) -> Result<T, String> {
    toml::Value::Table(table.clone()).try_into().map_err(|error: Error| {
        let message = toml_problem(&error);
        let text = toml::to_string(table).unwrap_or_default();
        let others = toml::from_str::<T>(&text).err().map(|error| others_missing::<T>(&text, &error));
        match others.filter(|others| !others.is_empty()) {
            Some(others) => format!("{message}; also missing: {}", others.join(", ")),
            None => message,
        }
    })
}

/// Returns the missing keys other than the one that `error` names.
fn others_missing<T: DeserializeOwned>(text: &str, error: &Error) -> Vec<String> {
    let mut filled = Filled { text: text.to_owned(), inserted: Vec::new() };
    let (mut names, mut error) = (Vec::new(), error.clone());
    while let Some(name) = missing_name(&error).filter(|_| text.len() < MAX_BYTES && names.len() < MAX_MISSING) {
        let span = error.span().unwrap_or(0..0);
        // A missing table is named without its keys.
        if !filled.is_inserted(&span) {
            names.push(format!("`{name}`{}", filled.place(&span)));
        }
        match filled.fill::<T>(&name, &span) {
            Some(next) => error = next,
            None => break,
        }
    }
    names.into_iter().skip(1).collect()
}

fn missing_name(error: &Error) -> Option<String> {
    let name = error.message().strip_prefix("missing field `")?.split('`').next()?;
    let is_plain = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    is_plain.then(|| name.to_owned())
}

/// A text with the insertions made in it.
struct Filled {
    text: String,
    inserted: Vec<Range<usize>>,
}

impl Filled {
    /// Returns true for an inserted table. The outermost table has an empty span and never counts as inserted.
    fn is_inserted(&self, span: &Range<usize>) -> bool {
        !span.is_empty()
            && self.inserted.iter().any(|inserted| inserted.start <= span.start && span.end <= inserted.end)
    }

    /// Returns the table in words, such as ` in [capture]`; empty for the outermost table.
    fn place(&self, span: &Range<usize>) -> String {
        match self.text.get(span.clone()) {
            Some(header) if header.starts_with('[') && header.ends_with(']') => format!(" in {header}"),
            Some(table) if table.starts_with('{') => {
                let line = 1 + self.text[..span.start].matches('\n').count();
                format!(" in line {line}")
            }
            _ => String::new(),
        }
    }

    /// Inserts the key with a value that it accepts. Returns the next mistake; `None` if there is none, or no value
    /// fits.
    fn fill<T: DeserializeOwned>(&mut self, name: &str, span: &Range<usize>) -> Option<Error> {
        let table = self.text.get(span.clone())?;
        let (at, before, after) = if table.starts_with('{') {
            let is_empty = table.trim_start_matches('{').trim_start().starts_with('}');
            (span.start + 1, " ", if is_empty { "" } else { "," })
        } else if table.starts_with('[') {
            (span.end, "\n", "\n")
        } else if span.is_empty() {
            (0, "", "\n")
        } else {
            return None;
        };
        let mut values: Vec<String> = VALUES.iter().map(|value| (*value).to_owned()).collect();
        let mut next = 0;
        while let Some(value) = values.get(next).cloned() {
            next += 1;
            let entry = format!("{before}{name} = {value}{after}");
            let text = format!("{}{entry}{}", &self.text[..at], &self.text[at..]);
            let inserted = at..at + entry.len();
            let Err(error) = toml::from_str::<T>(&text) else { return None };
            let is_of_value = error.span().is_some_and(|span| inserted.start < span.end && span.start < inserted.end);
            if is_of_value && missing_name(&error).is_none() {
                values.extend(first_variant(&error).filter(|variant| !values.contains(variant)));
                continue;
            }
            self.inserted.iter_mut().filter(|other| other.start >= at).for_each(|other| {
                *other = other.start + entry.len()..other.end + entry.len();
            });
            self.inserted.iter_mut().filter(|other| other.start < at && at < other.end).for_each(|other| {
                other.end += entry.len();
            });
            (self.text, _) = (text, self.inserted.push(inserted));
            return Some(error);
        }
        None
    }
}

/// Returns the first allowed value of a key with few values.
fn first_variant(error: &Error) -> Option<String> {
    let names = error.message().strip_prefix("unknown variant ``, expected ")?;
    Some(format!("\"{}\"", names.split('`').nth(1)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Kind {
        Pinhole,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only its reader counts")]
    struct File {
        version: u32,
        name: String,
        camera: Camera,
        #[serde(default)]
        tag: Vec<Tag>,
        kind: Kind,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only its reader counts")]
    struct Camera {
        focal_px: [f64; 2],
        link: String,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "only its reader counts")]
    struct Tag {
        id: u32,
        size_m: f64,
        position_m: [f64; 3],
    }

    fn problem(text: &str) -> String {
        explained::<File>(text, &toml::from_str::<File>(text).expect_err("a mistake"))
    }

    #[test]
    fn all_missing_keys_are_named_with_their_tables_and_an_unknown_one_with_the_likeliest() {
        let texts = [
            "",
            "version = 1\n[camera]\n[[tag]]\nid = 1\n[[tag]]\nid = 2\nsize_m = 0.1\n",
            "version = 1\nname = \"a\"\nkind = \"pinhole\"\ncamera = {}\n",
            "version = \"one\"",
            "verson = 1",
        ];
        insta::assert_snapshot!("toml_errors", texts.map(|text| format!("{text:?}\n{}\n", problem(text))).concat());
    }
}

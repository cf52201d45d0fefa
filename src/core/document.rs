//! A TOML file of an expected kind: `version` and `kind` are checked before its other keys.

use std::path::Path;

use serde::de::DeserializeOwned;
use toml::{Table, Value};

use crate::codes::Code;
use crate::kind::Kind;
use crate::robot::{FileIssue, RobotError, parse_toml};
use crate::text::nearest;

/// Version of every format that this program reads and writes.
pub const VERSION: u32 = 1;

/// Parses a TOML file that must state this version and `kind`.
///
/// # Errors
/// [`RobotError`] with the line to add, the command that takes a file of another kind, or the wrong key.
pub fn parse_file<T: DeserializeOwned>(kind: Kind, file: &Path, text: &str) -> Result<T, RobotError> {
    let table: Table = parse_toml(file, text)?;
    check_head(kind, file, &table)?;
    parse_toml(file, text)
}

/// Checks that a file states this version and `kind`.
///
/// # Errors
/// [`FileIssue`] as from [`parse_file`], for those two keys.
pub fn check_head(kind: Kind, file: &Path, table: &Table) -> Result<(), FileIssue> {
    let found = stated_kind(file, table, Some(kind))?;
    if found != kind {
        let problem = format!("is {}, not {}; {}", found.in_words(), kind.in_words(), found.takers());
        return Err(FileIssue::new(Code::FileKind, file, "kind", problem));
    }
    match table.get("version") {
        Some(Value::Integer(1)) => Ok(()),
        Some(other) => {
            let problem = format!("{other} is not supported; this program reads version = {VERSION}");
            Err(FileIssue::new(Code::VersionUnsupported, file, "version", problem))
        }
        None => {
            let problem = format!("is missing; add the line version = {VERSION} at its start");
            Err(FileIssue::new(Code::KeyMissing, file, "version", problem))
        }
    }
}

/// Returns the issue of a file of this kind that does not state it.
#[must_use]
pub fn missing_kind(file: &Path, kind: Kind) -> FileIssue {
    let problem = format!("is missing; add the line kind = \"{}\" at its start", kind.name());
    FileIssue::new(Code::FileKind, file, "kind", problem)
}

/// Returns the kind that a file states. A file without `kind`, which version 1 allowed until now, is of the kind that
/// its keys suggest, or else of the expected one. `armcal check` refuses it with the line to add.
///
/// # Errors
/// [`FileIssue`] with the line to add or to correct.
pub fn stated_kind(file: &Path, table: &Table, expected: Option<Kind>) -> Result<Kind, FileIssue> {
    let issue = |problem: String| FileIssue::new(Code::FileKind, file, "kind", problem);
    let all = || Kind::ALL.map(Kind::name).join(", ");
    match table.get("kind") {
        Some(Value::String(name)) => Kind::named(name).ok_or_else(|| {
            let likely = nearest(name, Kind::ALL.map(Kind::name)).or(expected.map(Kind::name));
            let remedy = likely.map_or_else(|| format!("one of {}", all()), |likely| format!("kind = \"{likely}\""));
            issue(format!("{name:?} names no kind of file; write {remedy}"))
        }),
        Some(_) => Err(issue(format!("must be a text, one of {}", all()))),
        None => {
            let suggested = Kind::suggested_by(table);
            let has_version = table.contains_key("version");
            if let Some(kind) =
                suggested.or(expected).filter(|kind| has_version && expected.is_none_or(|of| of == *kind))
            {
                return Ok(kind);
            }
            let head = if has_version { "line" } else { "lines version = 1 and" };
            let line = |kind: Kind| format!("add the {head} kind = \"{}\" at its start", kind.name());
            Err(issue(match (suggested, expected) {
                (Some(found), Some(expected)) if found != expected => {
                    let (found_in_words, expected) = (found.in_words(), expected.in_words());
                    let takers = found.takers();
                    format!(
                        "is missing, and its keys are those of {found_in_words}, not of {expected}; {}, and {takers}",
                        line(found)
                    )
                }
                (Some(kind), _) | (None, Some(kind)) => format!("is missing; {}", line(kind)),
                (None, None) => {
                    format!("is missing; add a line such as kind = \"robot\" at its start, one of {}", all())
                }
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_without_its_kind_or_of_another_is_one_error_with_the_line_to_add() {
        let texts = [
            "tolerance_m = 0.02\n",
            "version = 1\nmount = {}\npart = []\n",
            "version = 1\nkind = \"vehicle\"\n",
            "version = 1\nkind = \"tasks\"\n",
            "version = 1\nkind = \"zebra\"\n",
            "version = 1\nkind = 3\n",
            "kind = \"task\"\n",
            "version = 2\nkind = \"task\"\n",
        ];
        let said = texts.map(|text| {
            let error = parse_file::<Table>(Kind::Task, Path::new("task.toml"), text).expect_err(text);
            format!("{text:?}\n  {error}\n")
        });
        insta::assert_snapshot!("heads", said.concat());
        assert!(parse_file::<Table>(Kind::Task, Path::new("task.toml"), "version = 1\nkind = \"task\"\n").is_ok());
    }

    #[test]
    fn a_file_of_any_kind_is_told_to_state_one() {
        let stated = |text: &str| {
            let table = text.parse().expect("TOML");
            stated_kind(Path::new("a.toml"), &table, None).map_err(|issue| issue.problem)
        };
        assert_eq!(stated("kind = \"plan\""), Ok(Kind::Plan));
        assert!(stated("colour = 1").expect_err("no kind").contains("tag_map"));
        assert!(stated("tolerance_m = 1.0").expect_err("no kind").contains("kind = \"task\""));
        assert_eq!(stated("version = 1\ntolerance_m = 1.0"), Ok(Kind::Task));
        let routine = "robot = \"a\"\n[task]\n[[obstacle]]\n";
        assert!(stated(routine).expect_err("no kind").contains("kind = \"routine\""));
    }
}

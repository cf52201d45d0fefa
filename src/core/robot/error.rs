//! Errors in a robot folder or a vehicle file.

use crate::codes::{Code, Coded};
use std::path::{Path, PathBuf};

use self::toml_errors::explained;
pub use self::toml_errors::{from_table, syntax_code, toml_problem};
use super::toml_text::check_entries;
use crate::files::{self, FileKind};

mod toml_errors;

/// A wrong value in a file, with file, key and allowed values.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
#[error("{}: {key}: {problem}", file.display())]
pub struct FileIssue {
    /// Class of the problem.
    pub code: Code,
    /// File with the wrong value.
    pub file: PathBuf,
    /// Dotted path of the value in the file.
    pub key: String,
    /// Problem as the end of a sentence that begins with the key.
    pub problem: String,
}

/// Reason why a robot folder or vehicle file was refused.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum RobotError {
    #[error("{}: cannot be read: {source}", file.display())]
    Unreadable { file: PathBuf, source: std::io::Error },
    #[error("{}: {message}", file.display())]
    Syntax { code: Code, file: PathBuf, message: String },
    #[error(transparent)]
    Value(#[from] FileIssue),
    #[error(
        "{}: {place}: joint `{joint}` closes a loop at link `{link}`; the arm's chain must be a tree. Delete one of \
         the joints that hold the link",
        file.display()
    )]
    Loop { file: PathBuf, place: String, link: String, joint: String },
    #[error(
        "{}: {place}: joint `{joint}` names the link `{link}`, which the file does not define. Correct the name, or \
         add <link name=\"{link}\"/>",
        file.display()
    )]
    MissingLink { file: PathBuf, place: String, joint: String, link: String },
    #[error("{}: link `{link}` has mass {mass_kg} kg; a simulated link needs a mass above 0", file.display())]
    ZeroMass { file: PathBuf, link: String, mass_kg: f64 },
    #[error("{}: no chain of joints leads from `{from}` to `{to}`", file.display())]
    NoChain { file: PathBuf, from: String, to: String },
    #[error(
        "{}: {place}: joint `{joint}` between base_link and the tool or camera is {kind}; only revolute, continuous, \
         prismatic and fixed joints may be there: name a base_link beyond it, or a tool and camera before it",
        file.display()
    )]
    JointKind { file: PathBuf, place: String, joint: String, kind: String },
}

impl FileIssue {
    /// Returns the issue of the value at `key`, of the class `code`.
    #[must_use]
    pub fn new(code: Code, file: &Path, key: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { code, file: file.to_owned(), key: key.into(), problem: problem.into() }
    }

    /// Returns the issue of the table at `key` that a text's reader reported, classed by its words.
    #[must_use]
    pub fn syntax(file: &Path, key: impl Into<String>, problem: impl Into<String>) -> Self {
        let problem = problem.into();
        Self::new(syntax_code(&problem), file, key, problem)
    }

    /// Merges several issues of `file` into one; `None` if there are none.
    pub(super) fn all(file: &Path, issues: &[Self]) -> Option<Self> {
        match issues {
            [] => None,
            [only] => Some(only.clone()),
            several => {
                let each = several.iter().map(|issue| format!("{}: {}", issue.key, issue.problem));
                Some(Self::new(
                    several[0].code,
                    file,
                    format!("{} keys", several.len()),
                    each.collect::<Vec<_>>().join("; "),
                ))
            }
        }
    }

    /// Checks that `value` is finite and within `low..=high`.
    ///
    /// # Errors
    /// The issue, with the value and the allowed range.
    pub fn check_range(file: &Path, key: &str, value: f64, range: std::ops::RangeInclusive<f64>) -> Result<f64, Self> {
        if value.is_finite() && range.contains(&value) {
            Ok(value)
        } else {
            Err(Self::new(
                Code::ValueOutOfRange,
                file,
                key,
                format!("{value} is outside {} .. {}", range.start(), range.end()),
            ))
        }
    }
}

/// Reads a text file within the limits of [`files`]; the error names it.
pub fn read_text(file: &Path) -> Result<String, RobotError> {
    read(file, FileKind::Text)
}

/// Reads a table of rows, which may be longer than other text files; the error names the file.
pub fn read_table(file: &Path) -> Result<String, RobotError> {
    read(file, FileKind::Table)
}

/// Reads a text file of a robot folder. Its path may lead out of the folder; a link in the folder may not.
pub(super) fn read_in(folder: &Path, file: &Path) -> Result<String, RobotError> {
    files::check_within(folder, file).map_err(|source| RobotError::Unreadable { file: file.to_owned(), source })?;
    read_text(file)
}

fn read(file: &Path, kind: FileKind) -> Result<String, RobotError> {
    files::read_text(file, kind).map_err(|source| RobotError::Unreadable { file: file.to_owned(), source })
}

/// Parses TOML of a limited number of entries; the error names file, line and key.
pub fn parse_toml<T: serde::de::DeserializeOwned>(file: &Path, text: &str) -> Result<T, RobotError> {
    check_entries(text)
        .and_then(|()| toml::from_str(text).map_err(|error| explained::<T>(text, &error)))
        .map_err(|message| RobotError::Syntax { code: syntax_code(&message), file: file.to_owned(), message })
}

impl Coded for RobotError {
    fn code(&self) -> Code {
        match self {
            Self::Unreadable { .. } => Code::FileUnreadable,
            Self::Syntax { code, .. } => *code,
            Self::Value(issue) => issue.code,
            Self::Loop { .. } | Self::MissingLink { .. } | Self::NoChain { .. } | Self::JointKind { .. } => {
                Code::UrdfStructure
            }
            Self::ZeroMass { .. } => Code::ValueOutOfRange,
        }
    }
}

impl Coded for FileIssue {
    fn code(&self) -> Code {
        self.code
    }
}

//! Functions that all fields of the compact text share.

use crate::file::compact::error::CompactError;
use crate::file::compact::precision::MAX_STEPS;

pub(crate) fn bad(field: impl Into<String>, found: &str, expected: &'static str) -> CompactError {
    CompactError::Field { field: field.into(), found: printable(found), expected }
}

/// Parses a number of digits only, within the range.
pub(crate) fn whole(word: &str) -> Option<i64> {
    let is_number = !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| word.parse().ok()).flatten().filter(|steps| *steps <= MAX_STEPS)
}

/// Returns the start of `word`, escaped so that it cannot garble the terminal.
pub(crate) fn printable(word: &str) -> String {
    word.chars().take(40).flat_map(char::escape_default).collect()
}

//! Explanations of the codes, as `armcal explain` prints them.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use crate::codes::Code;

/// Explanation of one code.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Explanation {
    /// Effect of the code on a command.
    pub kind: CodeKind,
    /// Cause in one sentence.
    pub cause: String,
    /// Evidence: the quantity that was measured or checked.
    pub measured: String,
    /// First thing to do.
    pub remedy: String,
    /// Page of the documentation, relative to the repository.
    pub page: String,
}

/// Effect of a code on a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CodeKind {
    /// The command ends without a result.
    Error,
    /// A calibration was computed and must not be used.
    Refusal,
    /// Something differs from robot.toml, the survey or the URDF.
    Finding,
    /// The result stands; this line deserves a look.
    Warning,
}

impl CodeKind {
    /// Returns the word shown to people.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Refusal => "refusal",
            Self::Finding => "finding",
            Self::Warning => "warning",
        }
    }
}

const TEXT: &str = include_str!("explanations.toml");

static EXPLANATIONS: LazyLock<BTreeMap<Code, Explanation>> = LazyLock::new(|| {
    let table: BTreeMap<String, Explanation> = toml::from_str(TEXT).unwrap_or_default();
    table.into_iter().filter_map(|(code, explanation)| Some((code.parse().ok()?, explanation))).collect()
});

/// Returns the explanation of `code`; a test holds that every code has one.
#[must_use]
pub fn explanation(code: Code) -> Option<&'static Explanation> {
    EXPLANATIONS.get(&code)
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "kind      {}", self.kind.word())?;
        writeln!(f, "cause     {}", self.cause)?;
        writeln!(f, "measured  {}", self.measured)?;
        writeln!(f, "remedy    {}", self.remedy)?;
        write!(f, "page      {}", self.page)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_code_has_one_explanation_and_every_explanation_a_code() {
        let table: BTreeMap<String, Explanation> = toml::from_str(TEXT).expect("the table reads");
        let explained: BTreeSet<&str> = table.keys().map(String::as_str).collect();
        let codes: BTreeSet<&str> = Code::ALL.iter().map(|code| code.as_str()).collect();
        assert_eq!(codes.len(), Code::ALL.len(), "two codes have one text");
        assert_eq!(explained, codes);
        for (code, explanation) in &table {
            let Explanation { cause, measured, remedy, page, .. } = explanation;
            for sentence in [cause, measured, remedy] {
                assert!(sentence.ends_with('.') && sentence.split_whitespace().count() >= 3, "{code}: {sentence}");
            }
            let page = page.split('#').next().unwrap_or_default();
            let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
            assert!(root.join(page).is_file(), "{code}: {page}");
        }
    }

    #[test]
    fn codes_are_snake_case_and_read_back() {
        for code in Code::ALL {
            let text = code.as_str();
            assert!(text.chars().all(|c| c.is_ascii_lowercase() || c == '_'), "{text}");
            assert_eq!(text.parse(), Ok(*code));
        }
        assert!("no_such_code".parse::<Code>().is_err());
    }
}

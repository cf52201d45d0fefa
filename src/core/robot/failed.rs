//! Joints declared to have failed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fault of a joint or its sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FailedKind {
    /// The joint is stuck at an unknown angle, regardless of its sensor's readings.
    Locked,
    /// The joint was not moved, and its sensor read one angle: it may be intact.
    NotMoved,
    /// The sensor's output does not depend on the joint angle.
    Dead,
    /// The sensor's output stays constant while the joint moves.
    Stuck,
    /// The sensor slips on its shaft, once or several times.
    Jumps,
}

impl FailedKind {
    /// All kinds that a user may declare, each once.
    pub const ALL: [Self; 4] = [Self::Locked, Self::Dead, Self::Stuck, Self::Jumps];

    /// Returns the name that files and the command line use.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Locked => "locked",
            Self::NotMoved => "not_moved",
            Self::Dead => "dead",
            Self::Stuck => "stuck",
            Self::Jumps => "jumps",
        }
    }

    /// Returns the predicate that follows a name in a sentence.
    #[must_use]
    pub fn predicate(self) -> &'static str {
        match self {
            Self::Locked => "is locked",
            Self::NotMoved => "was not moved",
            Self::Dead => "is dead",
            Self::Stuck => "is stuck",
            Self::Jumps => "slips",
        }
    }

    /// Returns true for a joint that stood at one angle in all views.
    #[must_use]
    pub fn stands_still(self) -> bool {
        matches!(self, Self::Locked | Self::NotMoved)
    }

    /// Returns the kind of that name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// A joint that is declared to have failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FailedJoint {
    /// Index of the joint, base first.
    pub joint: usize,
    /// Fault of the joint or its sensor.
    pub kind: FailedKind,
}

impl FailedJoint {
    /// Builds the declaration from the names of joint and kind, for an arm with the joints `names`.
    ///
    /// # Errors
    /// The wrong name and the allowed ones.
    pub fn of_names(joint: &str, kind: &str, names: &[String]) -> Result<Self, String> {
        let Some(index) = names.iter().position(|name| name == joint) else {
            return Err(format!("joint `{joint}` is none of {names:?}"));
        };
        let Some(kind) = FailedKind::of_name(kind) else {
            return Err(format!("kind `{kind}` is none of {:?}", FailedKind::ALL.map(FailedKind::name)));
        };
        Ok(Self { joint: index, kind })
    }
}

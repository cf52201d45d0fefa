//! Joints declared to have failed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is wrong with a joint or its sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FailedKind {
    /// The joint is stuck at an unknown angle, whatever its sensor reads.
    Locked,
    /// The joint was not moved while its sensor read one angle: it may be sound.
    NotMoved,
    /// The sensor's output does not depend on the joint angle.
    Dead,
    /// The sensor's output stays constant while the joint moves.
    Stuck,
    /// The sensor slips on its shaft, once or several times.
    Jumps,
}

impl FailedKind {
    /// Every kind that a user may declare, once.
    pub const ALL: [Self; 4] = [Self::Locked, Self::Dead, Self::Stuck, Self::Jumps];

    /// As files and the command line write it.
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

    /// After a name, in a sentence.
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

    /// The kind of that name.
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
    /// What is wrong with it.
    pub kind: FailedKind,
}

impl FailedJoint {
    /// By the names of joint and kind, for an arm with the joints `names`.
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

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

    /// Returns true if the two go together: a joint whose sensor is lost may be held still, which is marked as locked.
    fn goes_with(self, other: Self) -> bool {
        let is_lost = |kind: Self| matches!(kind, Self::Dead | Self::Stuck);
        self == Self::Locked && is_lost(other) || is_lost(self) && other == Self::Locked
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

    /// Returns `known` with the `later` declarations. A later one of a joint replaces an earlier one, except that a
    /// joint with a lost sensor may be locked, too.
    pub(super) fn joined(mut known: Vec<Self>, later: &[Self]) -> Vec<Self> {
        for one in later {
            known.retain(|other| other.joint != one.joint || other.kind.goes_with(one.kind));
            known.push(*one);
        }
        known.sort_unstable();
        known
    }

    /// Checks that no joint is declared with two kinds.
    ///
    /// # Errors
    /// The joint and both kinds.
    pub fn check_kinds(declared: &[Self], names: &[String]) -> Result<(), String> {
        let other = |one: &Self| declared.iter().find(|other| other.joint == one.joint && other.kind != one.kind);
        let twice = declared.iter().find_map(|one| Some((one, other(one)?)));
        twice.map_or(Ok(()), |(one, other)| {
            let (name, kinds) = (&names[one.joint], [one.kind.name(), other.kind.name()]);
            Err(format!("`{name}` is declared {} and {}; declare it once, with one of the two", kinds[0], kinds[1]))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_joint_keeps_the_failure_of_its_sensor() {
        let of = |kind: FailedKind| FailedJoint { joint: 1, kind };
        let after = |first: FailedKind, later: &[FailedKind]| -> Vec<FailedKind> {
            let later: Vec<FailedJoint> = later.iter().map(|&kind| of(kind)).collect();
            FailedJoint::joined(vec![of(first)], &later).into_iter().map(|failed| failed.kind).collect()
        };
        let [locked, dead, stuck] = [FailedKind::Locked, FailedKind::Dead, FailedKind::Stuck];
        assert_eq!(after(dead, &[locked]), [locked, dead]);
        assert_eq!(after(locked, &[dead, locked]), [locked, dead]);
        assert_eq!(after(dead, &[locked, stuck]), [locked, stuck]);
        assert_eq!(after(FailedKind::Jumps, &[locked]), [locked]);
    }

    #[test]
    fn a_joint_has_one_kind_of_failure() {
        let names = ["shoulder".to_owned(), "elbow".to_owned()];
        let of = |joint: usize, kind: FailedKind| FailedJoint { joint, kind };
        let [locked, dead] = [FailedKind::Locked, FailedKind::Dead];
        let fine = [of(0, locked), of(1, dead), of(0, locked)];
        assert_eq!(FailedJoint::check_kinds(&fine, &names), Ok(()));
        let told = FailedJoint::check_kinds(&[of(1, dead), of(0, locked), of(1, locked)], &names).expect_err("two");
        assert!(["elbow", "dead", "locked"].iter().all(|word| told.contains(word)), "{told}");
    }
}

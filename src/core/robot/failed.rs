//! Joints of which somebody knows that they are not as the datasheet says.

use serde::{Deserialize, Serialize};

use super::Robot;

/// What is wrong with a joint or its sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FailedKind {
    /// The joint stands at one angle that nobody knows, whatever its sensor reads.
    Locked,
    /// The sensor's word says nothing of the joint.
    Dead,
    /// The sensor keeps one word while the joint moves.
    Stuck,
    /// The sensor slips on its shaft now and then, or once.
    Jumps,
}

impl FailedKind {
    pub const ALL: [Self; 4] = [Self::Locked, Self::Dead, Self::Stuck, Self::Jumps];

    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Locked => "locked",
            Self::Dead => "dead",
            Self::Stuck => "stuck",
            Self::Jumps => "jumps",
        }
    }

    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// A joint that is declared to have failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FailedJoint {
    pub joint: usize,
    pub kind: FailedKind,
}

impl FailedJoint {
    /// By the joint's name.
    ///
    /// # Errors
    /// What is wrong with the names, and which there are.
    pub fn of_names(joint: &str, kind: &str, robot: &Robot) -> Result<Self, String> {
        let names = robot.joint_names();
        let Some(index) = names.iter().position(|name| name == joint) else {
            return Err(format!("joint `{joint}` is none of {names:?}"));
        };
        let Some(kind) = FailedKind::of_name(kind) else {
            return Err(format!("kind `{kind}` is none of {:?}", FailedKind::ALL.map(FailedKind::name)));
        };
        Ok(Self { joint: index, kind })
    }
}

impl Robot {
    /// The same arm of which these joints are declared to have failed; the last word on a joint counts.
    #[must_use]
    pub fn with_failed(mut self, failed: &[FailedJoint]) -> Self {
        for declared in failed {
            self.failed.retain(|known| known.joint != declared.joint);
            self.failed.push(*declared);
        }
        self.failed.sort_unstable();
        self
    }
}

//! Kinds of TOML files: the value of the key `kind`, and the command that takes the file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Kind of a TOML file, stated in its key `kind`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// robot.toml of a robot folder.
    Robot,
    /// self_collision.toml of a robot folder.
    SelfCollision,
    /// Vehicle that carries an arm.
    Vehicle,
    /// Script of a closed loop.
    Routine,
    /// Surroundings that travel with a recording.
    Scene,
    /// Map of the topics or columns of a recording.
    Input,
    /// Tag poses before a calibration.
    TagMap,
    /// Targets of the tool.
    Task,
    /// Connection map of a real arm.
    Arm,
    /// Estimated joint sensors.
    Calibration,
    /// Covariance next to a calibration.
    Covariance,
    /// Planned views and paths.
    Plan,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 12] = [
        Self::Robot,
        Self::SelfCollision,
        Self::Vehicle,
        Self::Routine,
        Self::Scene,
        Self::Input,
        Self::TagMap,
        Self::Task,
        Self::Arm,
        Self::Calibration,
        Self::Covariance,
        Self::Plan,
    ];

    /// Returns the value of the key `kind`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Robot => "robot",
            Self::SelfCollision => "self_collision",
            Self::Vehicle => "vehicle",
            Self::Routine => "routine",
            Self::Scene => "scene",
            Self::Input => "input",
            Self::TagMap => "tag_map",
            Self::Task => "task",
            Self::Arm => "arm",
            Self::Calibration => "calibration",
            Self::Covariance => "covariance",
            Self::Plan => "plan",
        }
    }

    /// Returns the kind with this value of the key `kind`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Default kind of plan files that state none.
    #[must_use]
    pub fn plan() -> Self {
        Self::Plan
    }

    /// Default kind of calibration files that state none.
    #[must_use]
    pub fn calibration() -> Self {
        Self::Calibration
    }

    /// Default kind of covariance files that state none.
    #[must_use]
    pub fn covariance() -> Self {
        Self::Covariance
    }

    /// Default kind of vehicle files that state none.
    #[must_use]
    pub fn vehicle() -> Self {
        Self::Vehicle
    }

    /// Default kind of self-collision files that state none.
    #[must_use]
    pub fn self_collision() -> Self {
        Self::SelfCollision
    }

    /// Default kind of scene files that state none.
    #[must_use]
    pub fn scene() -> Self {
        Self::Scene
    }

    /// Returns the words for a file of this kind, with an article.
    #[must_use]
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Robot => "a robot.toml",
            Self::SelfCollision => "a self_collision.toml",
            Self::Vehicle => "a vehicle",
            Self::Routine => "a routine",
            Self::Scene => "a recording's scene",
            Self::Input => "an input map",
            Self::TagMap => "a tag map",
            Self::Task => "a task",
            Self::Arm => "a connection map",
            Self::Calibration => "a calibration",
            Self::Covariance => "a covariance",
            Self::Plan => "a plan",
        }
    }

    /// Returns the commands and options that take a file of this kind.
    #[must_use]
    pub fn takers(self) -> &'static str {
        match self {
            Self::Robot => "give its folder as --robot",
            Self::SelfCollision => "it belongs to the robot folder that it lies in; give that as --robot",
            Self::Vehicle => "name it in a routine, or give it as --set vehicle=FILE",
            Self::Routine => "`armcal run`, `plan`, `campaign` and `regress` take it",
            Self::Scene => "it belongs to a recording; `armcal replay` takes that",
            Self::Input => "give it as --input to `armcal calibrate`",
            Self::TagMap => "give it as --tag-map to `armcal calibrate`, or as --tags to `armcal tagmap`",
            Self::Task => "give it as --task to `armcal calibrate` or `watch`",
            Self::Arm => "give it as --arm: `armcal drive ROUTINE --arm FILE`",
            Self::Calibration => "`armcal export` takes it, and --prior",
            Self::Covariance => "it belongs to the calibration next to it; `armcal export` takes that, and --prior",
            Self::Plan => "`armcal check` reads it",
        }
    }

    /// Returns the top-level keys that together identify files of this kind.
    fn marks(self) -> &'static [&'static str] {
        match self {
            Self::Robot => &["urdf", "base_link"],
            Self::SelfCollision => &["urdf_blake3"],
            Self::Vehicle => &["mount", "part"],
            Self::Routine => &["robot", "task"],
            Self::Scene => &["obstacle"],
            Self::Input => &["joint_sensors", "tags"],
            Self::TagMap => &["frame", "tag"],
            Self::Task => &["tolerance_m"],
            Self::Arm => &["joint_sensors", "commands"],
            Self::Calibration => &["messages_hash"],
            Self::Covariance => &["lower_triangle"],
            Self::Plan => &["inputs_hash"],
        }
    }

    /// Returns the kind that the keys of a file without `kind` suggest; used only in the words of an error.
    #[must_use]
    pub fn suggested_by(table: &toml::Table) -> Option<Self> {
        // A routine has obstacles of its own.
        let unlike_scene = |kind: &Self| *kind != Self::Scene || !table.contains_key("robot");
        let has_marks = |kind: &Self| kind.marks().iter().all(|key| table.contains_key(*key));
        Self::ALL.into_iter().find(|kind| has_marks(kind) && unlike_scene(kind))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_is_written_and_read_under_its_name() {
        for kind in Kind::ALL {
            assert_eq!(toml::Value::try_from(kind).expect("a name").as_str(), Some(kind.name()));
            assert_eq!(Kind::named(kind.name()), Some(kind));
        }
        assert_eq!(Kind::named("robots"), None);
    }
}

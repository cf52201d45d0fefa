//! Units of recorded joints.

use schemars::JsonSchema;
use serde::Deserialize;

/// Unit of the recorded numbers of the joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum JointUnit {
    /// Raw readings, in the unit of robot.toml's scale.
    #[default]
    Counts,
    /// Angles in radians, computed from the readings by the datasheet: robot.toml's scale and offset.
    Rad,
    /// Angles in degrees, computed from the readings by the datasheet.
    Deg,
}

impl JointUnit {
    /// Returns the unit in words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Counts => "counts",
            Self::Rad => "radians",
            Self::Deg => "degrees",
        }
    }

    /// Returns the name that the input map uses.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Counts => "counts",
            Self::Rad => "rad",
            Self::Deg => "deg",
        }
    }
}

/// Unit of the recorded numbers of slides, if they are no raw readings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SlideUnit {
    /// Metres.
    #[default]
    M,
    /// Millimetres.
    Mm,
}

impl SlideUnit {
    /// Returns the unit in words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::M => "metres",
            Self::Mm => "millimetres",
        }
    }

    /// Returns the name that the input map uses.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Mm => "mm",
        }
    }

    /// Returns one unit in metres.
    pub(in crate::input) fn in_m(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Mm => 1e-3,
        }
    }
}

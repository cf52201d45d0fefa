//! In what units joints are recorded.

use schemars::JsonSchema;
use serde::Deserialize;

/// What the recorded numbers of the joints are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum JointUnit {
    /// Raw readings, in the unit of robot.toml's scale.
    #[default]
    Counts,
    /// Angles made of the readings by the datasheet: robot.toml's scale and offset.
    Rad,
    /// The same in degrees.
    Deg,
}

impl JointUnit {
    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Counts => "counts",
            Self::Rad => "radians",
            Self::Deg => "degrees",
        }
    }

    /// As the input map writes it.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Counts => "counts",
            Self::Rad => "rad",
            Self::Deg => "deg",
        }
    }
}

/// What the recorded numbers of slides are, where they are no raw readings.
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
    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::M => "metres",
            Self::Mm => "millimetres",
        }
    }

    /// As the input map writes it.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Mm => "mm",
        }
    }

    /// Of one in metres.
    pub(in crate::input) fn in_m(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Mm => 1e-3,
        }
    }
}

//! Calibration methods.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A calibration method by its name in files and on the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Nominal end stops against the readings there (Williams 1991); needs no camera.
    JointLimits,
    /// First method of the paper: smallest spread of every landmark's positions. It needs no map, and cannot determine
    /// the first offset.
    MinimumVariance,
    /// Proposed method of the paper: smallest sum of distances to known landmarks.
    MinimumDistance,
    /// Maximum a posteriori estimate over all parameters of the measurements.
    #[default]
    Bundle,
}

impl Method {
    /// Every method once.
    pub const ALL: [Self; 4] = [Self::JointLimits, Self::MinimumVariance, Self::MinimumDistance, Self::Bundle];
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::JointLimits => "joint_limits",
            Self::MinimumVariance => "minimum_variance",
            Self::MinimumDistance => "minimum_distance",
            Self::Bundle => "bundle",
        })
    }
}

impl std::str::FromStr for Method {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|method| method.to_string() == name).ok_or_else(|| {
            let known = Self::ALL.map(|method| method.to_string()).join(", ");
            format!("method `{name}` is not known; there are: {known}")
        })
    }
}

//! `[observability]` and `[verdict]` of calibration.toml.

use armcal_core::codes::Warning;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the data determine, before solving.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservabilityTable {
    /// Directions that the data tell more of than the priors do.
    pub rank: usize,
    /// Parameters: of the joints (without their nonlinearity), mount, gripper tag.
    #[serde(alias = "of")]
    pub n_parameters: usize,
    /// Largest over smallest singular value of the directions that count in `rank`; absent where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition_number: Option<f64>,
    /// Index of Borm and Menq (1991), per root of the number of views; all indices are 0 where the rank is 0.
    pub o1: f64,
    /// Smallest over largest singular value (Driels and Pathre 1990).
    pub o2: f64,
    /// Smallest singular value.
    pub o3: f64,
    /// Its square over the largest one.
    pub o4: f64,
    /// 1 over the sum of the inverse singular values (Sun and Hollerbach 2008).
    pub o5: f64,
    /// Directions that the data tell less of than the priors do, in words.
    #[serde(alias = "null")]
    pub null_space: Vec<String>,
    /// Estimated parameters whose standard deviation is hardly below the prior's.
    pub held_by_prior: Vec<String>,
}

/// What the verdict of `bundle` rests on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VerdictTable {
    /// What deserves a look without being a reason to refuse.
    pub warnings: Vec<Warning>,
    /// Where the task goes beyond what the views covered.
    pub not_covered: Vec<String>,
    /// Every test in its order, passed or not.
    pub checks: Vec<Check>,
}

/// One figure against its limit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// The figure and its unit, in words.
    pub what: String,
    /// Value of the figure.
    pub value: f64,
    /// The largest value that passes.
    pub limit: f64,
    /// Whether it passes.
    pub holds: bool,
}

impl Check {
    /// Holds where `value` is not above `limit`.
    pub(crate) fn at_most(what: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { what: what.into(), value, limit, holds: value <= limit }
    }
}

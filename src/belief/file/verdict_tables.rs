//! `[observability]` and `[verdict]` of calibration.toml.

use armcal_core::codes::Warning;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Observability of the parameters, computed before solving.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservabilityTable {
    /// Number of directions in which the data are more informative than the priors.
    pub rank: usize,
    /// Number of parameters: of the joints (without their nonlinearity), mount, gripper tag.
    #[serde(alias = "of")]
    pub n_parameters: usize,
    /// Largest over smallest singular value of the directions that count in `rank`; absent if `rank` is 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition_number: Option<f64>,
    /// Index O1 of Borm and Menq (1991), divided by the root of the number of views; all indices are 0 if the rank is
    /// 0.
    pub o1: f64,
    /// Smallest over largest singular value (Driels and Pathre 1990).
    pub o2: f64,
    /// Smallest singular value.
    pub o3: f64,
    /// Squared smallest singular value over the largest.
    pub o4: f64,
    /// Inverse of the sum of the inverse singular values (Sun and Hollerbach 2008).
    pub o5: f64,
    /// Directions in which the data are less informative than the priors, in words.
    #[serde(alias = "null")]
    pub null_space: Vec<String>,
    /// Estimated parameters whose standard deviation is hardly below the prior's.
    pub held_by_prior: Vec<String>,
}

/// Warnings and checks behind the verdict of `bundle`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VerdictTable {
    /// Observations that need attention but are no reason to refuse.
    pub warnings: Vec<Warning>,
    /// Parts of the task beyond the range that the views covered.
    pub not_covered: Vec<String>,
    /// All checks in their order, passed or not.
    pub checks: Vec<Check>,
}

/// Comparison of one value with its limit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// Name of the value and its unit, in words.
    pub what: String,
    /// Value that is compared.
    pub value: f64,
    /// The largest value that passes.
    pub limit: f64,
    /// True if the check passes.
    pub holds: bool,
}

impl Check {
    /// Returns a check that passes if `value` is not above `limit`.
    pub(crate) fn at_most(what: impl Into<String>, value: f64, limit: f64) -> Self {
        Self { what: what.into(), value, limit, holds: value <= limit }
    }
}

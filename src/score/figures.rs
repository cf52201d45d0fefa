//! Figures of a run that need the truth, as in summary.json. Lengths in m, angles in rad.

use serde::{Deserialize, Serialize};

use armcal_core::stats::Summary;

/// Distances of the links' ends from their estimated positions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MarginSummary {
    /// Number of compared pairs of link and view.
    pub links: usize,
    /// Number of pairs beyond the predicted 99 % quantile.
    pub exceeded_q99: usize,
    pub largest_m: f64,
    /// Largest distance at the first view, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_largest_m: Option<f64>,
    /// Counts by the number of views behind the estimate: those views, pairs, and pairs beyond their quantile.
    #[serde(default)]
    pub by_views: Vec<[usize; 3]>,
}

/// Comparison of estimates with the truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    pub before: ScoreSide,
    /// Errors after calibration; absent when the calibration was refused, because the arm then kept its previous
    /// estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after: Option<ScoreSide>,
    /// Mean normalized squared error of the tool's position at the task, 3 when the prediction is right.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nees: Option<f64>,
    pub joints: Vec<JointScore>,
    /// Targets at which the arm came to rest before and after; the errors of `before` and `after` are over these. Empty
    /// if there is no such target, or only one side; each side is then over its own targets.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub compared_targets: Vec<usize>,
    /// Errors target by target, where the arm came to rest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<TargetScore>,
    /// Every `reach` step of the script. `before` is the first step with the datasheet's sensors, `after` the last with
    /// calibrated ones.
    pub reaches: Vec<ReachScore>,
    /// Tasks of all `work` steps at which the arm came to rest, in the order of time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub work: Vec<TaskScore>,
}

/// One target of the task, before and after the calibration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TargetScore {
    /// Number of the task's target, from 0.
    pub target: usize,
    /// Distance between estimated and true tool, m; absent where the arm did not come to rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_before_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_after_m: Option<f64>,
    /// Distance between the target and the resting tool, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_error_before_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_error_after_m: Option<f64>,
    /// Predicted probability of an error larger than `tool_error_after_m`; uniformly distributed if predictions are
    /// right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_larger_error: Option<f64>,
    /// Normalized squared error with the covariance of U95.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nees_with_priors: Option<f64>,
}

/// One task of a `work` step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskScore {
    /// Number of the step in the script, from 1.
    pub step: usize,
    /// Time of the rest at the target, since the start, s.
    pub time_s: f64,
    /// Number of the task's target, from 0.
    pub target: usize,
    /// Distance between estimated and true tool, m.
    pub tool_error_m: f64,
    /// Distance between the target and the resting tool, m.
    pub reach_error_m: f64,
}

/// One `reach` step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReachScore {
    /// Number of the step in the script, from 1.
    pub step: usize,
    /// True if the arm used a calibration by then.
    pub calibrated: bool,
    #[serde(flatten)]
    pub side: ScoreSide,
    /// Touches of the targets by the jaws; absent where none was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub touches: Option<TouchScore>,
}

/// Counts of targets on which the jaws closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TouchScore {
    pub tried: usize,
    /// Targets that lay between the jaws.
    pub touched: usize,
}

/// Errors over the task's targets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreSide {
    /// Distance between estimated and true tool, m.
    pub tool_error_m: Option<Summary>,
    pub tool_error_rad: Option<Summary>,
    /// Distance between the target and the resting tool, m.
    pub reach_error_m: Option<Summary>,
    /// Targets reached within the task's tolerance; skipped targets do not count.
    pub hits: usize,
    /// Targets that were requested, including skipped ones.
    #[serde(default)]
    pub targets: usize,
}

/// Error of one joint's estimated angle, estimate less truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointScore {
    pub name: String,
    /// Error before calibration, root mean square over the task's resting poses, rad; `angle_error_after_rad` is that
    /// after it.
    pub angle_error_before_rad: Option<f64>,
    pub angle_error_after_rad: Option<f64>,
    pub estimated: bool,
}

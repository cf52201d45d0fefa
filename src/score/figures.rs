//! The figures that truth adds to a run, as summary.json has them. Lengths in m, angles in rad.

use serde::{Deserialize, Serialize};

use armcal_core::stats::Summary;

/// Displacement of the links' ends from where they are believed to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MarginSummary {
    /// Links times views.
    pub links: usize,
    /// Of them, those beyond the 99 % quantile that was predicted.
    pub exceeded_q99: usize,
    pub largest_m: f64,
    /// At the first view.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_largest_m: Option<f64>,
    /// By how many views the belief rested on: those views, links, and those of them beyond their quantile.
    #[serde(default)]
    pub by_views: Vec<[usize; 3]>,
}

/// Truth against belief.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    pub before: ScoreSide,
    /// Absent when the calibration was refused: the arm then kept its old belief.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after: Option<ScoreSide>,
    /// Mean normalized squared error of the tool's position at the task, 3 when the prediction is right.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nees: Option<f64>,
    pub joints: Vec<JointScore>,
    /// Targets at which the arm came to rest before and after: errors of `before` and `after` are over these. Empty
    /// where there is no such target, or one side only; each side is then over its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub compared_targets: Vec<usize>,
    /// Target by target, as far as the arm came to rest there.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<TargetScore>,
    /// Every `reach` step of the script. `before` is the first of them under the datasheet's sensors, `after` the last
    /// under calibrated ones.
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
    /// Where the arm believes its tool is, against where it is; absent where it did not come to rest there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_before_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_after_m: Option<f64>,
    /// Target against where the tool came to rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_error_before_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach_error_after_m: Option<f64>,
    /// Predicted probability of an error larger than `tool_error_after_m`: evenly distributed where predictions hold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_larger_error: Option<f64>,
    /// Normalized squared error under the covariance of U95.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nees_with_priors: Option<f64>,
}

/// One task of a `work` step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskScore {
    /// Number of the step in the script, from 1.
    pub step: usize,
    /// Of the rest at the target, since the start.
    pub time_s: f64,
    /// Number of the task's target, from 0.
    pub target: usize,
    /// Where the arm believes its tool is, against where it is.
    pub tool_error_m: f64,
    /// Target against where the tool came to rest.
    pub reach_error_m: f64,
}

/// One `reach` step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReachScore {
    /// Number of the step in the script, from 1.
    pub step: usize,
    /// Whether the arm believed in a calibration by then.
    pub calibrated: bool,
    #[serde(flatten)]
    pub side: ScoreSide,
    /// Where the jaws closed on the targets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub touches: Option<TouchScore>,
}

/// Targets on which the jaws closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TouchScore {
    pub tried: usize,
    /// Of those, the ones that lay between the jaws.
    pub touched: usize,
}

/// Errors over the task's targets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreSide {
    /// Where the arm believes its tool is, against where it is.
    pub tool_error_m: Option<Summary>,
    pub tool_error_rad: Option<Summary>,
    /// Target against where the tool came to rest.
    pub reach_error_m: Option<Summary>,
    /// Targets reached within the task's tolerance; one that was skipped is none of them.
    pub hits: usize,
    /// Targets that were asked for, with the skipped ones.
    #[serde(default)]
    pub targets: usize,
}

/// Error of one joint's believed angle, estimate less truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointScore {
    pub name: String,
    /// Root mean square over the task's resting poses, before and after.
    pub angle_error_before_rad: Option<f64>,
    pub angle_error_after_rad: Option<f64>,
    pub estimated: bool,
}

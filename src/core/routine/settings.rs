//! Settings of the capture and the task.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::robot::FileIssue;

/// Settings of the capture of views.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CaptureSettings {
    /// Views that the fit uses.
    #[serde(default = "CaptureSettings::default_poses")]
    #[schemars(range(min = 3, max = 1000))]
    pub poses: u32,
    /// Views that only the verdict uses.
    #[serde(default = "CaptureSettings::default_held_out")]
    #[schemars(range(min = 0, max = 1000))]
    pub held_out: u32,
    /// Tags that a planned view must be predicted to detect.
    #[serde(default = "CaptureSettings::default_min_tags")]
    #[schemars(range(min = 1, max = 100))]
    pub min_tags: u32,
    /// Minimum clearance between the arm and everything else, beyond the sensors' error.
    #[serde(default = "CaptureSettings::default_clearance_m")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub clearance_m: f64,
    /// Time that the settled arm is recorded.
    #[serde(default = "CaptureSettings::default_dwell_s")]
    #[schemars(range(min = 0.2, max = 60.0))]
    pub dwell_s: f64,
    /// Criterion of the choice of views.
    #[serde(default)]
    pub criterion: PoseCriterion,
    /// Views after which the interim estimate updates margins and remaining poses; 0: planned once.
    #[serde(default = "CaptureSettings::default_replan_every")]
    #[schemars(range(min = 0, max = 1000))]
    pub replan_every: u32,
    /// Predicted tool error at the task (root mean square) below which no more views are captured.
    #[serde(default)]
    #[schemars(range(min = 1e-5, max = 1.0))]
    pub stop_at_tool_error_m: Option<f64>,
    /// Time by the arm's clock after which no more views are captured.
    #[serde(default)]
    #[schemars(range(min = 1.0, max = 1e6))]
    pub max_time_s: Option<f64>,
    /// Margin added to `clearance_m`.
    #[serde(default)]
    pub margins: Margins,
}

/// Criterion by which views are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PoseCriterion {
    /// Smallest predicted tool error at the task (the test-pose criterion of Klimchik et al. 2014).
    #[default]
    ToolError,
    /// Smallest volume of the parameters' uncertainty.
    DOptimal,
    /// Smallest sum of the parameters' variances, in units of their priors.
    AOptimal,
    /// Smallest maximum of the variances, in units of their priors.
    EOptimal,
    /// Any views that detect enough tags and keep the clearance; for comparison.
    Random,
}

/// Arms for which the clearance is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Margins {
    /// Every arm that the present estimate allows.
    #[default]
    Belief,
    /// Only the estimated arm; for comparison, never on a real arm.
    Off,
}

impl CaptureSettings {
    fn default_poses() -> u32 {
        30
    }
    fn default_replan_every() -> u32 {
        6
    }

    fn default_held_out() -> u32 {
        8
    }
    fn default_min_tags() -> u32 {
        3
    }
    fn default_clearance_m() -> f64 {
        0.05
    }
    fn default_dwell_s() -> f64 {
        1.0
    }
}

impl CaptureSettings {
    /// Checks the settings; `prefix` precedes the keys in messages.
    pub(super) fn check(&self, file: &Path, prefix: &str) -> Result<(), FileIssue> {
        let check =
            |key: &str, value: f64, range| FileIssue::check_range(file, &format!("{prefix}{key}"), value, range);
        check("poses", f64::from(self.poses), 3.0..=1000.0)?;
        check("held_out", f64::from(self.held_out), 0.0..=1000.0)?;
        check("min_tags", f64::from(self.min_tags), 1.0..=100.0)?;
        check("clearance_m", self.clearance_m, 0.0..=1.0)?;
        check("dwell_s", self.dwell_s, 0.2..=60.0)?;
        check("replan_every", f64::from(self.replan_every), 0.0..=1000.0)?;
        if let Some(tool_error_m) = self.stop_at_tool_error_m {
            check("stop_at_tool_error_m", tool_error_m, 1e-5..=1.0)?;
        }
        if let Some(seconds) = self.max_time_s {
            check("max_time_s", seconds, 1.0..=1e6)?;
        }
        Ok(())
    }
}

impl Default for CaptureSettings {
    fn default() -> Self {
        Self {
            poses: Self::default_poses(),
            held_out: Self::default_held_out(),
            min_tags: Self::default_min_tags(),
            clearance_m: Self::default_clearance_m(),
            dwell_s: Self::default_dwell_s(),
            criterion: PoseCriterion::default(),
            replan_every: Self::default_replan_every(),
            stop_at_tool_error_m: None,
            max_time_s: None,
            margins: Margins::default(),
        }
    }
}

/// Task that the arm is calibrated for.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TaskSettings {
    /// Largest distance between tool and target that counts as a hit.
    #[schemars(range(min = 1e-4, max = 1.0))]
    pub tolerance_m: f64,
    /// Tool positions in the base frame.
    #[schemars(inner(inner(range(min = -100.0, max = 100.0))))]
    pub targets_m: Vec<[f64; 3]>,
}

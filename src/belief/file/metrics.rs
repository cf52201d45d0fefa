//! `[fit]` and `[held_out]` of calibration.toml.

use std::collections::BTreeMap;

use crate::judge::baseline_comparison::BaselineComparison;
use armcal_core::numeric::Outcome;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the fitted views fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitMetrics {
    /// How the solver ended.
    pub outcome: Outcome,
    /// Of the objective; iterations of `bundle`.
    pub evaluations: usize,
    /// At the initial guess, in the unit of the method's objective.
    pub cost_initial: f64,
    /// At the end.
    pub cost_final: f64,
    /// Fitted views that show a tag.
    pub views: usize,
    /// Tags in those views, each view's by itself.
    pub tags_seen: usize,
    /// Detections rejected in all captured views, and outliers of the fit.
    pub rejected: usize,
    /// Single corners that the fit rejected; the others of their tags are in use.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rejected_corners: Option<usize>,
    /// The same by reason; not in the file.
    #[serde(default, skip_serializing)]
    pub rejected_by_reason: BTreeMap<String, usize>,
    /// Root mean square distance between the tags' predicted and surveyed positions.
    pub rms_m: f64,
    /// Absent where the recording has positions or poses and no corners.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
    /// How many times the datasheets' linearity the sensors deviate from a straight line, by the residuals; at least 1.
    #[serde(default = "as_the_datasheet_says")]
    pub linearity_scale: f64,
}

fn as_the_datasheet_says() -> f64 {
    1.0
}

/// Cross-validated views by the 95 % regions of what they measured, noise included: 95 % should lie within.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewContainment {
    /// Number of views that have a region.
    pub views: usize,
    /// Those of them that lie within.
    pub within: usize,
}

/// How views fit that the fit did not use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeldOutMetrics {
    /// Number of views that show a tag.
    pub views: usize,
    /// By cross-validation: each view was held out of one fold, and fitted in the end; else the fit never saw these.
    #[serde(default, alias = "in_turn", skip_serializing_if = "std::ops::Not::not")]
    pub cross_validated: bool,
    /// Root mean square distance between the tags' predicted and surveyed positions; absent without a tag.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_m: Option<f64>,
    /// The mean of the same distances, where views were cross-validated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_m: Option<f64>,
    /// Mean distance of the camera from where the landmarks' measured poses have it, m; where the recording has poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mean_m: Option<f64>,
    /// Root mean square reprojection error per corner; absent without corners.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
    /// The same views with the datasheet's sensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nominal_rms_m: Option<f64>,
    /// The same views by mount and map alone, fitted to the same views as the calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<BaselineComparison>,
    /// Views within their 95 % regions; absent without cross-validation and with the paper's methods.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within_95: Option<ViewContainment>,
}

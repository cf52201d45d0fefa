//! `[fit]` and `[held_out]` of calibration.toml.

use std::collections::BTreeMap;

use crate::judge::baseline_comparison::BaselineComparison;
use armcal_core::numeric::Outcome;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Outcome of the solver and residuals of the fitted views.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FitMetrics {
    /// Outcome of the solver.
    pub outcome: Outcome,
    /// Number of evaluations of the objective; iterations with `bundle`.
    pub evaluations: usize,
    /// Cost at the initial guess, in the unit of the method's objective.
    pub cost_initial: f64,
    /// Cost at the end, in the same unit.
    pub cost_final: f64,
    /// Number of fitted views that show a tag.
    pub views: usize,
    /// Number of tags in those views; each view counts its own.
    pub tags_seen: usize,
    /// Number of detections rejected in all captured views, including outliers of the fit.
    pub rejected: usize,
    /// Number of single corners that the fit rejected; the other corners of their tags are in use.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rejected_corners: Option<usize>,
    /// Number of rejected detections by reason; not in the file.
    #[serde(default, skip_serializing)]
    pub rejected_by_reason: BTreeMap<String, usize>,
    /// Root mean square distance between the tags' predicted and surveyed positions.
    pub rms_m: f64,
    /// Root mean square reprojection error per corner; absent if the recording has positions or poses but no corners.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
    /// Ratio of the sensors' nonlinearity, as the residuals show it, to the datasheets' linearity; at least 1.
    #[serde(default = "as_the_datasheet_says")]
    pub linearity_scale: f64,
}

fn as_the_datasheet_says() -> f64 {
    1.0
}

/// Cross-validated views against the 95 % regions of their measurements, noise included. About 95 % should lie within.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewContainment {
    /// Number of views that have a region.
    pub views: usize,
    /// Number of those views that lie within their region.
    pub within: usize,
}

/// Errors at views that the fit did not use.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeldOutMetrics {
    /// Number of views that show a tag.
    pub views: usize,
    /// True if each view was held out of one fold and fitted in the end; otherwise the fit never used these views.
    #[serde(default, alias = "in_turn", skip_serializing_if = "std::ops::Not::not")]
    pub cross_validated: bool,
    /// Root mean square distance between the tags' predicted and surveyed positions; absent without a tag.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_m: Option<f64>,
    /// Mean of the same distances, if the views were cross-validated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_m: Option<f64>,
    /// Mean distance between the camera and its position from the landmarks' measured poses, m; absent without poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_mean_m: Option<f64>,
    /// Root mean square reprojection error per corner; absent without corners.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
    /// Root mean square distance at the same views with the datasheet's sensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nominal_rms_m: Option<f64>,
    /// Errors at the same views if only mount and map are fitted, to the same views as the calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<BaselineComparison>,
    /// Views within their 95 % regions; absent without cross-validation and with the paper's methods.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within_95: Option<ViewContainment>,
}

//! What the compact text holds.

use serde::Serialize;

use crate::calib::result::calibration::Status;
use crate::calib::result::compact::terms::{CompactReference, CompactTerms};
use armcal_core::routine::Method;

/// What the compact text holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompactCalibration {
    /// `armcal1`; `armcal2` with terms.
    pub format: &'static str,
    /// Long names are shortened, see [`CompactCalibration::fits`].
    pub robot: String,
    pub method: Method,
    pub status: Status,
    /// Short code of the reason where refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refusal_code: Option<String>,
    /// End of the last fitted view, seconds since the Unix epoch.
    pub time_s: i64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_m: Option<PredictedToolError>,
    /// First digits of the full calibration's `messages_hash`.
    pub messages_hash_start: String,
    /// Hash of the robot's joints: their names and the middles of their ranges; with terms also half of the ranges.
    pub joints_hash: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<CompactReference>,
    /// In the order of the chain, base first.
    pub joint: Vec<CompactJoint>,
}

/// Over the task's targets, m, rounded up to whole micrometres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PredictedToolError {
    pub median: f64,
    pub p95: f64,
}

/// Corrections of one joint to its datasheet, with one sigma each; `None` where that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CompactJoint {
    /// Gain over the datasheet's, less 1.
    pub gain_correction: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_std: Option<f64>,
    /// Otherwise it is the datasheet's.
    pub gain_estimated: bool,
    pub offset_rad: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_std_rad: Option<f64>,
    pub offset_estimated: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub terms: Option<CompactTerms>,
}

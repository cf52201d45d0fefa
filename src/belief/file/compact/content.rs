//! What the compact text holds.

use serde::Serialize;

use crate::file::calibration::Status;
use crate::file::compact::terms::{CompactReference, CompactTerms};
use armcal_core::routine::Method;

/// What the compact text holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompactCalibration {
    /// `armcal1`; `armcal2` with terms.
    pub format: &'static str,
    /// Long names are shortened, see [`CompactCalibration::fits`].
    pub robot: String,
    /// Method that made it.
    pub method: Method,
    /// Whether it may be used.
    pub status: Status,
    /// Short code of the reason where refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refusal_code: Option<String>,
    /// End of the last fitted view, seconds since the Unix epoch.
    pub time_s: i64,
    /// `None` without a task, or where it is not finite.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_m: Option<PredictedToolError>,
    /// First digits of the full calibration's `messages_hash`.
    pub messages_hash_start: String,
    /// Hash of the robot's joints: their names and the middles of their ranges; with terms also half of the ranges.
    pub joints_hash: String,
    /// What the terms are counted from; `None` for straight sensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<CompactReference>,
    /// In the order of the chain, base first.
    pub joint: Vec<CompactJoint>,
}

/// Over the task's targets, m, rounded up to whole micrometres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PredictedToolError {
    /// Half of the targets are below it.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
}

/// Corrections of one joint to its datasheet, with one sigma each; `None` where that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CompactJoint {
    /// Gain over the datasheet's, less 1.
    pub gain_correction: f64,
    /// Of the gain over the datasheet's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_std: Option<f64>,
    /// Otherwise it is the datasheet's.
    pub gain_estimated: bool,
    /// Added to the angle.
    pub offset_rad: f64,
    /// Of the offset.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_std_rad: Option<f64>,
    /// Otherwise it is the datasheet's.
    pub offset_estimated: bool,
    /// `None` for a straight sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub terms: Option<CompactTerms>,
}

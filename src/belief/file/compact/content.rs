//! Content of the compact text.

use serde::Serialize;

use crate::file::calibration::Status;
use crate::file::compact::terms::{CompactReference, CompactTerms};
use armcal_core::routine::Method;

/// Content of the compact text.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CompactCalibration {
    /// Format: `armcal1`, or `armcal2` with terms.
    pub format: &'static str,
    /// Name of the robot; long names are shortened, see [`CompactCalibration::fits`].
    pub robot: String,
    /// Method that made the calibration.
    pub method: Method,
    /// Verdict: accepted or refused.
    pub status: Status,
    /// Short code of the reason, if refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refusal_code: Option<String>,
    /// End of the last fitted view, in seconds since the Unix epoch.
    pub time_s: i64,
    /// Predicted tool error; `None` without a task, or if it is not finite.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_tool_error_m: Option<PredictedToolError>,
    /// First digits of the full calibration's `messages_hash`.
    pub messages_hash_start: String,
    /// Hash of the robot's joints: their names and the middles of their ranges; with terms also half of the ranges.
    pub joints_hash: String,
    /// Reference conditions of the terms; `None` for straight sensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<CompactReference>,
    /// Joints in the order of the chain, base first.
    pub joint: Vec<CompactJoint>,
}

/// Predicted tool error over the task's targets, m, rounded up to whole micrometres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PredictedToolError {
    /// Median over the targets.
    pub median: f64,
    /// 95th percentile over the targets.
    pub p95: f64,
}

/// Corrections of one joint to its datasheet, each with its standard deviation; `None` where that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CompactJoint {
    /// Ratio of the gain to the datasheet's, minus 1.
    pub gain_correction: f64,
    /// Standard deviation of the ratio of the gain to the datasheet's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_std: Option<f64>,
    /// True if the gain was estimated; otherwise it is the datasheet's.
    pub gain_estimated: bool,
    /// Sensor error at mid-range, added to the angle.
    pub offset_rad: f64,
    /// Standard deviation of the offset.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset_std_rad: Option<f64>,
    /// True if the offset was estimated; otherwise it is the datasheet's.
    pub offset_estimated: bool,
    /// Terms of the sensor; `None` for a straight sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub terms: Option<CompactTerms>,
}

//! `[model]` of calibration.toml: estimated terms, and noise and prior scales that were fitted to the data.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Model that `bundle` estimated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelTable {
    /// Ratio of the measurement noise to its stated value.
    pub noise_scale: f64,
    /// Standard deviation of tag positions, if the recording has positions or poses instead of corners.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_std_m: Option<f64>,
    /// Standard deviation of the rotations of tag poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation_std_rad: Option<f64>,
    /// Factor on all variances, estimated because errors of held-out cameras exceeded their prediction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variance_factor: Option<f64>,
    /// Standard deviation of the camera pose error that all tags of a view share: translation m, rotation rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_error_std: Option<[f64; 2]>,
    /// Delay of the joint sensors' stamps behind the camera's, and its standard deviation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_offset_s: Option<[f64; 2]>,
    /// Standard deviation of each estimated joint's nonlinearity, rad, base first.
    pub nonlinearity_std_rad: Vec<f64>,
    /// Terms that the evidence included or excluded, such as `drift: in, 12.3 nats`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub decided: Vec<String>,
}

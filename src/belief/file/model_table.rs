//! `[model]` of calibration.toml: what was estimated, and the sizes that the data gave the unknown errors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What `bundle` took for its model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelTable {
    /// Measurement noise over what was stated for it.
    pub noise_scale: f64,
    /// Positions or poses that a recording gave in place of corners: their noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_std_m: Option<f64>,
    /// The same of poses' rotations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation_std_rad: Option<f64>,
    /// All variances are multiplied by it, for held-out cameras were farther off than predicted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variance_factor: Option<f64>,
    /// The error of the camera's pose that all tags of a view share: translation m, rotation rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_error_std: Option<[f64; 2]>,
    /// How much later the joint sensors' stamps are than the camera's, and one sigma.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_offset_s: Option<[f64; 2]>,
    /// One sigma of each joint's nonlinearity, rad; joints that are not estimated have none.
    pub nonlinearity_std_rad: Vec<f64>,
    /// Terms that the evidence decided on: `drift: in, 12.3 nats`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub decided: Vec<String>,
}

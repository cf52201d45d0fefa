//! What a calibration found to be other than robot.toml, survey and drawing say.

use serde::{Deserialize, Serialize};

/// One finding; a repaired one does not refuse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Finding {
    pub kind: FindingKind,
    /// Joint, tag id or link.
    pub name: String,
    /// In `unit`; absent where the finding has no size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<FindingUnit>,
    /// Root mean square over the task, where it was predicted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_error_m: Option<f64>,
    /// When it happened, s since the first view.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// Whether the estimate takes account of it.
    pub repaired: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    TagMoved,
    Link,
    CameraMount,
    Base,
    Tool,
    SensorSlip,
    SensorFailed,
    SensorWorn,
    Outliers,
}

/// SI, and plain numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FindingUnit {
    #[serde(rename = "m")]
    Metre,
    #[serde(rename = "rad")]
    Radian,
    #[serde(rename = "1")]
    One,
}

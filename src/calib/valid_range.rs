//! `[valid]` of calibration.toml.

use serde::{Deserialize, Serialize};

use super::associate::CaptureData;
use crate::time::Stamp;

/// What the captured views covered; beyond it the result is a guess.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValidRange {
    /// When the last view was captured, nanoseconds since the epoch.
    pub time_nanos: i64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub oil_c: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub water_c: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pressure_pa: Option<[f64; 2]>,
}

impl ValidRange {
    pub(super) fn of(data: &CaptureData) -> Self {
        let pair = |range: Option<(f64, f64)>| range.map(|(low, high)| [low, high]);
        let last = data.fit.iter().map(|view| view.end).max().unwrap_or(Stamp { nanos: 0 });
        Self {
            time_nanos: last.nanos,
            oil_c: pair(data.oil_c),
            water_c: pair(data.water_c),
            pressure_pa: pair(data.pressure_pa),
        }
    }
}

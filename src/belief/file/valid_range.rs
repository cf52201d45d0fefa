//! `[valid]` of calibration.toml.

use crate::file::constants::valid_range::{MARGIN_H, MARGIN_K, MARGIN_PA};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::views::view::CaptureData;
use armcal_core::sensor::Conditions;
use armcal_core::time::{Stamp, utc};

/// Conditions that the captured views covered; beyond them the result is extrapolated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ValidRange {
    /// Time at which the last view was captured, in nanoseconds since the epoch.
    pub time_nanos: i64,
    /// Lowest and highest oil temperature, degrees Celsius; absent where it was not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub oil_c: Option<[f64; 2]>,
    /// Lowest and highest water temperature, degrees Celsius; absent where it was not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub water_c: Option<[f64; 2]>,
    /// Lowest and highest absolute ambient pressure; absent where it was not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pressure_pa: Option<[f64; 2]>,
}

impl ValidRange {
    pub(crate) fn of(data: &CaptureData) -> Self {
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

impl ValidRange {
    pub(crate) fn beyond(&self, conditions: &Conditions) -> Vec<String> {
        let mut beyond = Vec::new();
        if let (Some(range), Some(oil_c)) = (self.oil_c, conditions.oil_c)
            && past(oil_c, range) > MARGIN_K
        {
            let [low, high] = range;
            beyond.push(format!("oil at {oil_c:.1} C is {:.1} K beyond {low:.1} .. {high:.1} C", past(oil_c, range)));
        }
        if let (Some(range), Some(pressure_pa)) = (self.pressure_pa, conditions.pressure_pa)
            && past(pressure_pa, range) > MARGIN_PA
        {
            let ([low, high], at) = (range.map(|pa| pa * 1e-6), pressure_pa * 1e-6);
            let by = past(pressure_pa, range) * 1e-6;
            beyond.push(format!("pressure of {at:.1} MPa is {by:.1} MPa beyond {low:.1} .. {high:.1} MPa"));
        }
        if let Some(stamp) = conditions.stamp {
            let age_h = stamp.since_s(Stamp { nanos: self.time_nanos }) / 3600.0;
            if age_h.abs() > MARGIN_H {
                beyond.push(format!("it is {age_h:.1} h old"));
            }
        }
        beyond
    }

    pub(crate) fn in_words(&self) -> Vec<String> {
        let range = |what: &str, range: Option<[f64; 2]>, unit: &str, scale: f64| {
            range.map(|[low, high]| format!("{what} {:.1} .. {:.1} {unit}", low * scale, high * scale))
        };
        let oil = range("oil", self.oil_c, "C", 1.0);
        let pressure = range("pressure", self.pressure_pa, "MPa", 1e-6);
        let at = u64::try_from(self.time_nanos).map_or_else(|_| "a time before 1970".to_owned(), utc);
        let age = format!("some {MARGIN_H:.0} h about {at}");
        oil.into_iter().chain(pressure).chain([age]).collect()
    }
}

/// Returns the range in ascending order; it is descending if the sensor's counts run the other way.
pub(crate) fn ordered([a, b]: [f64; 2]) -> [f64; 2] {
    [a.min(b), a.max(b)]
}

/// Returns the distance of `value` outside of the range; zero or less inside.
pub(crate) fn past(value: f64, [low, high]: [f64; 2]) -> f64 {
    (low - value).max(value - high)
}

//! `[valid]` of calibration.toml.

use serde::{Deserialize, Serialize};

use crate::calib::result::calibration::Calibration;
use crate::calib::views::association::CaptureData;
use armcal_core::sensor::Conditions;
use armcal_core::streams::JointAngles;
use armcal_core::time::Stamp;

/// What may lie beyond without a word: angles (rad), oil (K), pressure (Pa), age (h). Assumed.
const MARGIN_RAD: f64 = 0.05;
const MARGIN_K: f64 = 2.0;
const MARGIN_PA: f64 = 0.5e6;
const MARGIN_H: f64 = 6.0;

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

impl Calibration {
    /// In words, what `angles` (of as many joints as there are, base first) under `conditions` have beyond what the calibration saw;
    /// nothing where all is within it. Joints of which nothing was estimated have no range, and what is unknown is not beyond.
    #[must_use]
    pub fn beyond(&self, angles: &JointAngles, conditions: &Conditions) -> Vec<String> {
        let joints = self.joint.iter().zip(angles.iter()).filter(|(j, _)| j.gain_estimated || j.offset_estimated);
        let of_joint = |(joint, angle_rad): (&crate::calib::result::calibration::JointResult, &f64)| {
            let [low, high] = ordered(joint.covered_rad);
            let by_rad = past(*angle_rad, [low, high]);
            (by_rad > MARGIN_RAD).then(|| {
                format!("{} at {angle_rad:.2} rad is {by_rad:.2} rad beyond {low:.2} .. {high:.2}", joint.name)
            })
        };
        let mut beyond: Vec<String> = joints.filter_map(of_joint).collect();
        beyond.extend(self.valid.beyond(conditions));
        beyond
    }

    /// In words, what it is valid for.
    #[must_use]
    pub fn valid_for(&self) -> Vec<String> {
        let joints = self.joint.iter().filter(|joint| joint.gain_estimated || joint.offset_estimated);
        let one = |joint: &crate::calib::result::calibration::JointResult| {
            let [low, high] = ordered(joint.covered_rad);
            format!("{} {low:.2} .. {high:.2} rad", joint.name)
        };
        joints.map(one).chain(self.valid.in_words()).collect()
    }
}

/// Joint by joint, how many of a task's postures go how far beyond what the views covered; nothing where all are within it.
pub(crate) fn not_covered(calibration: &Calibration, postures: &[JointAngles]) -> Vec<String> {
    let joints = calibration.joint.iter().enumerate().filter(|(_, j)| j.gain_estimated || j.offset_estimated);
    let of_joint = |(joint, result): (usize, &crate::calib::result::calibration::JointResult)| {
        let [low, high] = ordered(result.covered_rad);
        let beyond = postures.iter().map(|angles| past(angles[joint], [low, high])).filter(|by| *by > MARGIN_RAD);
        let (n, most) = beyond.fold((0usize, 0.0_f64), |(n, most), by| (n + 1, most.max(by)));
        let (name, all) = (&result.name, postures.len());
        let words = || format!("{name}: {n} of {all} targets lie up to {most:.2} rad beyond {low:.2} .. {high:.2} rad");
        (n > 0).then(words)
    };
    joints.filter_map(of_joint).collect()
}

impl ValidRange {
    fn beyond(&self, conditions: &Conditions) -> Vec<String> {
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

    fn in_words(&self) -> Vec<String> {
        let range = |what: &str, range: Option<[f64; 2]>, unit: &str, scale: f64| {
            range.map(|[low, high]| format!("{what} {:.1} .. {:.1} {unit}", low * scale, high * scale))
        };
        let oil = range("oil", self.oil_c, "C", 1.0);
        let pressure = range("pressure", self.pressure_pa, "MPa", 1e-6);
        let age = format!("some {MARGIN_H:.0} h about {} s since 1970", self.time_nanos.div_euclid(1_000_000_000));
        oil.into_iter().chain(pressure).chain([age]).collect()
    }
}

/// A sensor whose counts run the other way has its range the other way round.
fn ordered([a, b]: [f64; 2]) -> [f64; 2] {
    [a.min(b), a.max(b)]
}

/// How far `value` is outside of the range; zero or less inside.
fn past(value: f64, [low, high]: [f64; 2]) -> f64 {
    (low - value).max(value - high)
}

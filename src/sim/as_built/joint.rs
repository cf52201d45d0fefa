//! A joint sensor as built.

use std::f64::consts::TAU;
use std::num::NonZeroU8;

use serde::{Deserialize, Serialize};

/// A joint sensor as built; `sensors::joint` has the equations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointAsBuilt {
    pub name: String,
    pub center_rad: f64,
    pub range_rad: f64,
    pub gain_error: f64,
    pub offset_error_rad: f64,
    pub temperature_offset_rad_per_k: f64,
    pub temperature_gain_per_k: f64,
    /// Counts per radian over the datasheet's.
    #[serde(default = "one_to_one")]
    pub gear_ratio: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pressure_offset_rad_per_mpa: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pressure_gain_per_mpa: f64,
    pub harmonics: Vec<Harmonic>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worn_spot: Option<WornSpot>,
    /// Of an encoder: `amplitude * sin(order * shaft + phase)`, shaft's angle in rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eccentricity: Option<Harmonic>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolver: Option<ResolverAsBuilt>,
}

/// One sine term of an error.
///
/// Nonlinearity: `amplitude * sin(2 pi order (theta - center) / range + phase)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Harmonic {
    pub order: f64,
    pub amplitude_rad: f64,
    pub phase_rad: f64,
}

/// Worn spot of a potentiometer's track: `peak * wear`, `wear = exp(-((theta - center) / width)^2 / 2)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WornSpot {
    pub center_rad: f64,
    /// Of either sign.
    pub peak_rad: f64,
    pub width_rad: f64,
}

impl WornSpot {
    /// 1 in its middle, 0 far from it.
    #[must_use]
    pub fn wear(&self, angle_rad: f64) -> f64 {
        (-0.5 * ((angle_rad - self.center_rad) / self.width_rad).powi(2)).exp()
    }

    /// Largest addition to the reading, rad.
    #[must_use]
    pub fn bump_rad(&self, angle_rad: f64) -> f64 {
        self.peak_rad * self.wear(angle_rad)
    }
}

/// Errors of a resolver's windings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResolverAsBuilt {
    pub pole_pairs: NonZeroU8,
    /// Electrical angle at shaft angle zero.
    pub phase_rad: f64,
    pub imbalance: f64,
    pub quadrature_rad: f64,
    pub temperature_offset_rad_per_k: f64,
}

/// Truths recorded before there were gears.
fn one_to_one() -> f64 {
    1.0
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl JointAsBuilt {
    /// The smooth deviation of the sensor at `angle_rad`, rad.
    #[must_use]
    pub fn nonlinearity_rad(&self, angle_rad: f64) -> f64 {
        let turn = TAU * (angle_rad - self.center_rad) / self.range_rad;
        self.harmonics.iter().map(|h| h.amplitude_rad * (h.order * turn + h.phase_rad).sin()).sum()
    }
}

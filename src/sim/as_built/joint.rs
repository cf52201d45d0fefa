//! A joint sensor as built.

use std::f64::consts::TAU;
use std::num::NonZeroU8;

use serde::{Deserialize, Serialize};

/// A joint sensor as built; `sensors::joint` has the equations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointAsBuilt {
    /// Name of the joint in the URDF.
    pub name: String,
    /// Middle of the joint's range, about which gain errors act.
    pub center_rad: f64,
    /// Whole range between the stops; a turn for a joint without stops.
    pub range_rad: f64,
    /// Relative, of a potentiometer.
    pub gain_error: f64,
    /// Added to the angle, of every kind.
    pub offset_error_rad: f64,
    /// Change of a potentiometer's offset with the oil temperature.
    pub temperature_offset_rad_per_k: f64,
    /// Relative change of a potentiometer's gain with the oil temperature, 1/K.
    pub temperature_gain_per_k: f64,
    /// Counts per radian over the datasheet's.
    #[serde(default = "one_to_one")]
    pub gear_ratio: f64,
    /// Change of a potentiometer's offset with the ambient pressure.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pressure_offset_rad_per_mpa: f64,
    /// Relative change of a potentiometer's gain with the ambient pressure, 1/MPa.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pressure_gain_per_mpa: f64,
    /// Nonlinearity of a potentiometer; empty for other kinds.
    pub harmonics: Vec<Harmonic>,
    /// Of a potentiometer's track; `None` where the world has no wear.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worn_spot: Option<WornSpot>,
    /// Of an encoder: `amplitude * sin(order * shaft + phase)`, shaft's angle in rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eccentricity: Option<Harmonic>,
    /// Of a resolver; `None` for other kinds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolver: Option<ResolverAsBuilt>,
}

/// One sine term of an error.
///
/// Nonlinearity: `amplitude * sin(2 pi order (theta - center) / range + phase)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Harmonic {
    /// Periods over the range, or in a turn of the shaft.
    pub order: f64,
    /// Peak value.
    pub amplitude_rad: f64,
    /// Phase in the middle of the range, or at shaft angle zero.
    pub phase_rad: f64,
}

/// Worn spot of a potentiometer's track: `peak * wear`, `wear = exp(-((theta - center) / width)^2 / 2)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WornSpot {
    /// Angle in the middle of the spot.
    pub center_rad: f64,
    /// Of either sign.
    pub peak_rad: f64,
    /// Standard width of the spot.
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
    /// Electrical turns in one of the shaft.
    pub pole_pairs: NonZeroU8,
    /// Electrical angle at shaft angle zero.
    pub phase_rad: f64,
    /// Relative difference of the windings' amplitudes.
    pub imbalance: f64,
    /// What the windings lack to a right angle, electrical.
    pub quadrature_rad: f64,
    /// Change of the offset with the oil temperature.
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

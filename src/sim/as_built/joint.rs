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
    /// Relative gain error of a potentiometer.
    pub gain_error: f64,
    /// Offset of a sensor of any kind, added to the angle.
    pub offset_error_rad: f64,
    /// Change of a potentiometer's offset with the oil temperature.
    pub temperature_offset_rad_per_k: f64,
    /// Relative change of a potentiometer's gain with the oil temperature, 1/K.
    pub temperature_gain_per_k: f64,
    /// Counts per radian over those of the datasheet.
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
    /// Worn spot of a potentiometer's track; `None` in a world without wear.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worn_spot: Option<WornSpot>,
    /// Eccentricity of an encoder: `amplitude * sin(order * shaft + phase)`, shaft's angle in rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eccentricity: Option<Harmonic>,
    /// Errors of a resolver; `None` for other kinds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolver: Option<ResolverAsBuilt>,
}

/// Sine term of an error.
///
/// Nonlinearity: `amplitude * sin(2 pi order (theta - center) / range + phase)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Harmonic {
    /// Number of periods over the range, or in a turn of the shaft.
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
    /// Peak error, of either sign.
    pub peak_rad: f64,
    /// Standard width of the spot.
    pub width_rad: f64,
}

impl WornSpot {
    /// Returns the wear at an angle: 1 in the middle of the spot, 0 far from it.
    #[must_use]
    pub fn wear(&self, angle_rad: f64) -> f64 {
        (-0.5 * ((angle_rad - self.center_rad) / self.width_rad).powi(2)).exp()
    }

    /// Returns the largest addition to the reading, rad.
    #[must_use]
    pub fn bump_rad(&self, angle_rad: f64) -> f64 {
        self.peak_rad * self.wear(angle_rad)
    }
}

/// Errors of a resolver's windings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResolverAsBuilt {
    /// Number of electrical turns in one turn of the shaft.
    pub pole_pairs: NonZeroU8,
    /// Electrical angle at shaft angle zero.
    pub phase_rad: f64,
    /// Relative difference of the windings' amplitudes.
    pub imbalance: f64,
    /// Deviation of the windings from a right angle, electrical.
    pub quadrature_rad: f64,
    /// Change of the offset with the oil temperature.
    pub temperature_offset_rad_per_k: f64,
}

/// Returns the gear ratio of truths that were recorded before there were gears.
fn one_to_one() -> f64 {
    1.0
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl JointAsBuilt {
    /// Returns the smooth deviation of the sensor at `angle_rad`, rad.
    #[must_use]
    pub fn nonlinearity_rad(&self, angle_rad: f64) -> f64 {
        let turn = TAU * (angle_rad - self.center_rad) / self.range_rad;
        self.harmonics.iter().map(|h| h.amplitude_rad * (h.order * turn + h.phase_rad).sin()).sum()
    }
}

//! Model of one joint sensor, and of all joint sensors of an arm.

use crate::joints::{JointAngles, JointCounts};
use crate::robot::{JointSensorSpec, Robot};
use crate::time::Stamp;

/// Number of terms of each sensor's smooth nonlinearity.
pub const N_SHAPE: usize = 12;

/// Correction of the datasheet by calibration. With the travel t from the middle of the range, the angle is the sum of
/// `center + (gain + gain_per_k T) t + offset + sum_h nonlinearity_h phi_h(t / half_range)` and
/// `offset_per_k T + offset_per_mpa P + drift h + half_backlash a + bump(t)`. T (K), P (MPa) and h (hours) are the
/// [`ConditionChange`] from the calibration's reference; a is the side from which the joint came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    /// Factor on the nominal travel; 1 is the datasheet.
    pub gain: f64,
    /// Offset added to the angle, rad.
    pub offset_rad: f64,
    /// Coefficients beyond gain and offset.
    pub terms: Terms,
}

/// Terms beyond gain and offset; all zero for a linear sensor that no condition affects.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// Coefficients of [`nonlinearity_basis`].
    pub nonlinearity_rad: [f64; N_SHAPE],
    /// Change of the offset with the oil temperature, rad/K.
    pub offset_rad_per_k: f64,
    /// Change of the gain with the oil temperature, 1/K.
    pub gain_per_k: f64,
    /// Change of the offset with the ambient pressure, rad/MPa.
    pub offset_rad_per_mpa: f64,
    /// Change of the offset with time, rad/h.
    pub drift_rad_per_h: f64,
    /// Half of the backlash between joint and sensor shaft.
    pub half_backlash_rad: f64,
    /// Worn spot of the sensor's track.
    pub bump: Bump,
}

/// A local bump of a sensor's curve: it adds `height exp(-(t - at)^2 / 2 width^2)` to the angle at travel t.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bump {
    /// Travel from the middle of the range at the top of the bump.
    pub at_rad: f64,
    /// Standard width of the bump; at most 0 if there is no bump.
    pub width_rad: f64,
    /// Angle added at the top of the bump.
    pub height_rad: f64,
}

impl Bump {
    /// Returns the share of the height at a travel from the middle of the range; 1 at the top.
    #[must_use]
    pub fn share(&self, travel_rad: f64) -> f64 {
        if self.width_rad <= 0.0 {
            return 0.0;
        }
        (-0.5 * ((travel_rad - self.at_rad) / self.width_rad).powi(2)).exp()
    }
}

impl Terms {
    /// Returns true if all terms are zero.
    #[must_use]
    pub fn are_zero(&self) -> bool {
        *self == Self::default()
    }
}

impl Default for Correction {
    fn default() -> Self {
        Self { gain: 1.0, offset_rad: 0.0, terms: Terms::default() }
    }
}

/// Half-width of the domain of [`nonlinearity_basis`], in half ranges. It exceeds the joint's range because the
/// functions vanish at its ends.
const SHAPE_DOMAIN: f64 = 1.25;

/// Smooth functions over the joint's range: `phi_h(x) = sin(pi h (x + L) / 2 L) / sqrt(L)`, h = 1.., L = 1.25, x in
/// -1..1. With the prior variances of [`shape_prior`] they are the eigenfunctions of a Gaussian process (Solin and
/// Sarkka 2020, eq. 6). They are constant outside.
#[must_use]
#[inline]
pub fn nonlinearity_basis(x: f64) -> [f64; N_SHAPE] {
    let turn = std::f64::consts::PI * (x.clamp(-1.0, 1.0) + SHAPE_DOMAIN) / (2.0 * SHAPE_DOMAIN);
    let (sin, cos) = turn.sin_cos();
    // sin((h + 1) a) = 2 cos(a) sin(h a) - sin((h - 1) a).
    let (mut before, mut now) = (0.0, sin);
    std::array::from_fn(|_| {
        let value = now / SHAPE_DOMAIN.sqrt();
        (before, now) = (now, 2.0 * cos * now - before);
        value
    })
}

/// Prior standard deviations of the coefficients of [`nonlinearity_basis`] for a process of unit standard deviation
/// with a squared exponential covariance of length `length` half ranges: `S(w)^(1/2)` at `w = pi h / 2 L` (Solin and
/// Sarkka 2020, eq. 8).
#[must_use]
pub fn shape_prior(length: f64) -> [f64; N_SHAPE] {
    std::array::from_fn(|n| {
        let w = std::f64::consts::PI * (n + 1) as f64 / (2.0 * SHAPE_DOMAIN);
        ((std::f64::consts::TAU).sqrt() * length * (-0.5 * (length * w).powi(2)).exp()).sqrt()
    })
}

/// Change of the conditions from a calibration's reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ConditionChange {
    /// Oil temperature above the reference's, K.
    pub oil_k: f64,
    /// Ambient pressure above the reference's, MPa.
    pub pressure_mpa: f64,
    /// Time since the reference, hours; negative before it.
    pub elapsed_h: f64,
}

/// Conditions of a reading, apart from the angle; `None` is unknown and counts as the reference's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Conditions {
    /// Oil temperature, degrees Celsius.
    pub oil_c: Option<f64>,
    /// Ambient pressure, absolute.
    pub pressure_pa: Option<f64>,
    /// Time of the reading, by the joint sensors' clock.
    pub stamp: Option<Stamp>,
}

impl Conditions {
    /// Returns the change of the conditions from `reference` to these.
    #[must_use]
    pub fn departure_from(&self, reference: &Self) -> ConditionChange {
        let difference = |a: Option<f64>, b: Option<f64>| a.zip(b).map_or(0.0, |(a, b)| a - b);
        ConditionChange {
            oil_k: difference(self.oil_c, reference.oil_c),
            pressure_mpa: difference(self.pressure_pa, reference.pressure_pa) * 1e-6,
            elapsed_h: self.stamp.zip(reference.stamp).map_or(0.0, |(a, b)| a.since_s(b) / 3600.0),
        }
    }
}

impl Correction {
    /// Returns the angle at `travel_rad` from the middle of the range. `approach` is the direction in which the joint
    /// moved: -1, 0 (unknown) or 1.
    #[must_use]
    pub fn angle_rad(
        &self,
        spec: &JointSensorSpec,
        travel_rad: f64,
        departure: &ConditionChange,
        approach: f64,
    ) -> f64 {
        let terms = &self.terms;
        if terms.are_zero() {
            return spec.center_rad + self.gain * travel_rad + self.offset_rad;
        }
        let basis = nonlinearity_basis(travel_rad / spec.half_range_rad);
        let shape: f64 = basis.iter().zip(&terms.nonlinearity_rad).map(|(b, a)| a * b).sum();
        spec.center_rad
            + (self.gain + terms.gain_per_k * departure.oil_k) * travel_rad
            + self.offset_rad
            + shape
            + terms.offset_rad_per_k * departure.oil_k
            + terms.offset_rad_per_mpa * departure.pressure_mpa
            + terms.drift_rad_per_h * departure.elapsed_h
            + terms.half_backlash_rad * approach
            + terms.bump.height_rad * terms.bump.share(travel_rad)
    }
}

impl Correction {
    /// Returns d(angle)/d(travel) at `travel_rad` from the middle of the range, as a difference over 2 mrad.
    #[must_use]
    pub fn slope(&self, spec: &JointSensorSpec, travel_rad: f64, departure: &ConditionChange) -> f64 {
        const STEP_RAD: f64 = 1e-3;
        let at = |travel_rad: f64| self.angle_rad(spec, travel_rad, departure, 0.0);
        (at(travel_rad + STEP_RAD) - at(travel_rad - STEP_RAD)) / (2.0 * STEP_RAD)
    }
}

/// Model of a joint sensor: datasheet and estimated correction.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorModel {
    /// Datasheet.
    pub spec: JointSensorSpec,
    /// Correction of the datasheet by calibration.
    pub correction: Correction,
}

impl SensorModel {
    /// Returns the datasheet's sensor, without a correction.
    #[must_use]
    pub fn nominal(spec: &JointSensorSpec) -> Self {
        Self { spec: spec.clone(), correction: Correction::default() }
    }

    /// Returns the datasheet's travel from the middle of the range, rad; the word wraps about that middle.
    #[must_use]
    pub fn nominal_travel_rad(&self, counts: f64) -> f64 {
        let spec = &self.spec;
        let center_counts = spec.offset_counts + spec.counts_per_rad * spec.center_rad;
        wrap_symmetric(counts - center_counts, spec.wrap_counts) / spec.counts_per_rad
    }

    /// Returns the angle that `counts` mean under the reference's conditions, rad.
    #[must_use]
    pub fn angle_rad(&self, counts: f64) -> f64 {
        self.angle_under_rad(counts, &ConditionChange::default())
    }

    /// Returns the angle that `counts` mean under conditions that differ from the reference, rad.
    #[must_use]
    pub fn angle_under_rad(&self, counts: f64, departure: &ConditionChange) -> f64 {
        self.correction.angle_rad(&self.spec, self.nominal_travel_rad(counts), departure, 0.0)
    }

    /// Returns the reading at `angle_rad`, not rounded: the inverse of [`Self::angle_rad`]. It is in 0..wrap, except of
    /// a word that never repeats.
    #[must_use]
    pub fn counts(&self, angle_rad: f64) -> f64 {
        self.counts_under(angle_rad, &ConditionChange::default())
    }

    /// Returns the inverse of [`Self::angle_under_rad`].
    #[must_use]
    pub fn counts_under(&self, angle_rad: f64, departure: &ConditionChange) -> f64 {
        let spec = &self.spec;
        let travel = self.travel_under_rad(angle_rad, departure);
        let counts = spec.offset_counts + spec.counts_per_rad * (spec.center_rad + travel);
        if spec.never_repeats() { counts } else { counts.rem_euclid(spec.wrap_counts) }
    }

    /// Returns the datasheet's travel at `angle_rad`, rad: the inverse of [`Correction::angle_rad`] with the approach
    /// unknown.
    #[must_use]
    pub fn travel_under_rad(&self, angle_rad: f64, departure: &ConditionChange) -> f64 {
        /// The nonlinearity's slope is a few hundredths of the gain, so that each step gains a digit or two.
        const STEPS: usize = 16;
        let spec = &self.spec;
        let mut travel = (angle_rad - spec.center_rad - self.correction.offset_rad) / self.correction.gain;
        if !self.correction.terms.are_zero() {
            for _ in 0..STEPS {
                let error = angle_rad - self.correction.angle_rad(spec, travel, departure, 0.0);
                let before = travel;
                travel += error / self.correction.gain;
                if travel == before {
                    break;
                }
            }
        }
        travel
    }

    /// Returns the smallest and largest slope of the angle over the range, relative to the gain; 1 and 1 for a linear
    /// sensor. If both lie well within 0 to 2, each reading has one angle and [`Self::counts`] finds it.
    #[must_use]
    pub fn slope_over_gain(&self) -> (f64, f64) {
        if self.correction.terms.are_zero() {
            return (1.0, 1.0);
        }
        /// Number of chords of the range; the fastest of the functions has five periods in it.
        const CHORDS: usize = 64;
        let end_rad = self.spec.half_range_rad;
        let angle = |n: usize| {
            let travel_rad = end_rad * (2.0 * n as f64 / CHORDS as f64 - 1.0);
            self.correction.angle_rad(&self.spec, travel_rad, &ConditionChange::default(), 0.0)
        };
        let gain_rad = self.correction.gain * 2.0 * end_rad / CHORDS as f64;
        let slopes = (0..CHORDS).map(|n| (angle(n + 1) - angle(n)) / gain_rad);
        slopes.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), slope| (low.min(slope), high.max(slope)))
    }
}

/// Returns `value` modulo `period`, in -period/2 .. period/2.
#[must_use]
pub fn wrap_symmetric(value: f64, period: f64) -> f64 {
    let half = 0.5 * period;
    (value + half).rem_euclid(period) - half
}

/// The sensors of an arm, base first.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmSensors {
    /// Sensor models, one per joint.
    pub models: Vec<SensorModel>,
    /// Reference conditions of the corrections' terms.
    pub reference: Conditions,
}

impl ArmSensors {
    /// Returns the datasheet's model of every joint.
    #[must_use]
    pub fn nominal(robot: &Robot) -> Self {
        Self { models: robot.sensors.iter().map(SensorModel::nominal).collect(), reference: Conditions::default() }
    }

    /// Returns the datasheet's travel of every joint, rad.
    #[must_use]
    pub fn travel_rad(&self, counts: &JointCounts) -> JointAngles {
        JointAngles::from_fn(self.models.len(), |j| self.models[j].nominal_travel_rad(counts[j]))
    }

    /// Returns true if any sensor has terms beyond gain and offset.
    #[must_use]
    pub fn have_terms(&self) -> bool {
        self.models.iter().any(|model| !model.correction.terms.are_zero())
    }

    /// Returns the angles of readings that were taken under `conditions`.
    #[must_use]
    pub fn angles_under(&self, counts: &JointCounts, conditions: &Conditions) -> JointAngles {
        let departure = conditions.departure_from(&self.reference);
        JointAngles::from_fn(self.models.len(), |j| self.models[j].angle_under_rad(counts[j], &departure))
    }

    /// Returns the readings at `angles` under `conditions`.
    #[must_use]
    pub fn counts_under(&self, angles: &JointAngles, conditions: &Conditions) -> JointCounts {
        let departure = conditions.departure_from(&self.reference);
        JointCounts::from_fn(self.models.len(), |j| self.models[j].counts_under(angles[j], &departure))
    }

    /// Returns the angles under the reference's conditions.
    #[must_use]
    pub fn angles(&self, counts: &JointCounts) -> JointAngles {
        JointAngles::from_fn(self.models.len(), |j| self.models[j].angle_rad(counts[j]))
    }

    /// Returns the readings under the reference's conditions.
    #[must_use]
    pub fn counts(&self, angles: &JointAngles) -> JointCounts {
        JointCounts::from_fn(self.models.len(), |j| self.models[j].counts(angles[j]))
    }
}

#[cfg(test)]
mod tests;

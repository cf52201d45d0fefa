//! One sensor, and all sensors of an arm.

use crate::joints::{JointAngles, JointCounts};
use crate::robot::{JointSensorSpec, Robot};

/// What calibration adds to the datasheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    /// Factor on the nominal travel; 1 is the datasheet.
    pub gain: f64,
    /// Added to the angle, rad.
    pub offset_rad: f64,
}

impl Default for Correction {
    fn default() -> Self {
        Self { gain: 1.0, offset_rad: 0.0 }
    }
}

/// A joint sensor as believed.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorModel {
    pub spec: JointSensorSpec,
    pub correction: Correction,
}

impl SensorModel {
    #[must_use]
    pub fn nominal(spec: &JointSensorSpec) -> Self {
        Self { spec: spec.clone(), correction: Correction::default() }
    }

    /// Travel from the middle of the range by the datasheet, rad; the word wraps about that middle.
    #[must_use]
    pub fn nominal_travel_rad(&self, counts: f64) -> f64 {
        let spec = &self.spec;
        let center_counts = spec.offset_counts + spec.counts_per_rad * spec.center_rad;
        wrap_symmetric(counts - center_counts, spec.wrap_counts) / spec.counts_per_rad
    }

    /// The angle that `counts` mean, rad.
    #[must_use]
    pub fn angle_rad(&self, counts: f64) -> f64 {
        self.spec.center_rad + self.correction.gain * self.nominal_travel_rad(counts) + self.correction.offset_rad
    }

    /// The reading at `angle_rad`, 0..wrap, not rounded: the inverse of [`Self::angle_rad`].
    #[must_use]
    pub fn counts(&self, angle_rad: f64) -> f64 {
        let spec = &self.spec;
        let travel = (angle_rad - spec.center_rad - self.correction.offset_rad) / self.correction.gain;
        let counts = spec.offset_counts + spec.counts_per_rad * (spec.center_rad + travel);
        counts.rem_euclid(spec.wrap_counts)
    }
}

/// `value` modulo `period`, in -period/2 .. period/2.
#[must_use]
pub(crate) fn wrap_symmetric(value: f64, period: f64) -> f64 {
    let half = 0.5 * period;
    (value + half).rem_euclid(period) - half
}

/// The sensors of an arm, base first.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmSensors {
    pub models: Vec<SensorModel>,
}

impl ArmSensors {
    /// The datasheet's model of every joint.
    #[must_use]
    pub fn nominal(robot: &Robot) -> Self {
        Self { models: robot.sensors.iter().map(SensorModel::nominal).collect() }
    }

    #[must_use]
    pub fn angles(&self, counts: &JointCounts) -> JointAngles {
        JointAngles::from_fn(self.models.len(), |j| self.models[j].angle_rad(counts[j]))
    }

    #[must_use]
    pub fn counts(&self, angles: &JointAngles) -> JointCounts {
        JointCounts::from_fn(self.models.len(), |j| self.models[j].counts(angles[j]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::SensorKind;
    use proptest::prelude::*;

    fn spec() -> JointSensorSpec {
        JointSensorSpec {
            joint: "j".into(),
            kind: SensorKind::Potentiometer,
            offset_counts: 65322.0,
            counts_per_rad: 46.0 * 180.0 / std::f64::consts::PI,
            wrap_counts: 65536.0,
            center_rad: -1.5352,
            gain_std: 0.03,
            offset_std_rad: 0.05,
            gain_bound: 0.05,
            offset_bound_rad: 0.0873,
            noise_std_counts: 2.0,
            linearity_std_rad: 0.002,
            temperature_std_rad_per_k: 0.0,
            drift_std_rad_per_sqrt_h: 0.0,
            max_rate_rad_s: 0.5,
        }
    }

    proptest! {
        #[test]
        fn counts_and_angles_round_trip_over_the_full_range(
            angle in -3.7f64..0.6, gain in 0.9f64..1.1, offset_rad in -0.1f64..0.1
        ) {
            let model = SensorModel { spec: spec(), correction: Correction { gain, offset_rad } };
            let counts = model.counts(angle);
            prop_assert!((0.0..65536.0).contains(&counts));
            prop_assert!((model.angle_rad(counts) - angle).abs() < 1e-9);
        }
    }

    #[test]
    fn the_nominal_model_is_the_datasheet_formula() {
        let model = SensorModel::nominal(&spec());
        // theta_deg = (raw - offset) / scale, with the raw word wrapped: -20 deg.
        let raw = 65322.0 - 46.0 * 20.0;
        assert!((model.angle_rad(raw).to_degrees() + 20.0).abs() < 1e-9);
        // +20 deg has wrapped past 65536.
        let raw = 65322.0 + 46.0 * 20.0 - 65536.0;
        assert!((model.angle_rad(raw).to_degrees() - 20.0).abs() < 1e-9);
    }
}

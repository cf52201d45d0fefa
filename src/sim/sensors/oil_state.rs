//! State of the joint sensors' surroundings: their own temperature, and the pressure with its hysteresis.
//!
//! The sensors follow the oil with a first-order lag. Their housings yield to pressure with a hysteresis independent of
//! the rate, a play operator. (Krasnosel'skii and Pokrovskii, Systems with Hysteresis, 1989; the element of Prandtl and
//! Ishlinskii's sums.) `felt = p + w (play(p) - p)`, with a play `hysteresis / w` wide. After a dive, half of the
//! hysteresis remains at the surface.

use crate::sensors::lag::Lag;
use crate::spec::JointSensorsSpec;

/// Temperature and pressure at the joint sensors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OilState {
    pub oil_c: f64,
    /// Pressure above that of the surface, Pa.
    pub pressure_pa: f64,
}

/// Temperature and pressure at the joint sensors, with lag and hysteresis.
#[derive(Clone, Debug)]
pub(crate) struct SensorSurroundings {
    temperature: Lag,
    lag_s: f64,
    /// Middle of the play, Pa.
    lagging_pa: Option<f64>,
    half_play_pa: f64,
    share: f64,
}

impl SensorSurroundings {
    pub(crate) fn new(spec: &JointSensorsSpec) -> Self {
        let share = spec.pressure_hysteresis_share;
        Self {
            temperature: Lag::default(),
            lag_s: spec.sensor_lag_s,
            lagging_pa: None,
            half_play_pa: 0.5e6 * spec.pressure_hysteresis_mpa / share,
            share,
        }
    }

    /// Returns the sensors' state `elapsed_s` after the last one, in oil of the present state. At the first call they
    /// have settled.
    pub(crate) fn follow(&mut self, oil: OilState, elapsed_s: f64) -> OilState {
        let OilState { oil_c, pressure_pa } = oil;
        let half_play = self.half_play_pa;
        let before = self.lagging_pa.unwrap_or(pressure_pa);
        let lagging_pa = before.clamp(pressure_pa - half_play, pressure_pa + half_play);
        self.lagging_pa = Some(lagging_pa);
        OilState {
            oil_c: self.temperature.follow(oil_c, elapsed_s, self.lag_s),
            pressure_pa: pressure_pa + self.share * (lagging_pa - pressure_pa),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn felt_mpa(spec: &JointSensorsSpec, turns_mpa: &[f64]) -> Vec<f64> {
        let mut sensors = SensorSurroundings::new(spec);
        let mut at_mpa = 0.0;
        let mut feel =
            |mpa: f64| sensors.follow(OilState { oil_c: 4.0, pressure_pa: 1e6 * mpa }, 1.0).pressure_pa * 1e-6;
        feel(at_mpa);
        let way = |to: &f64| {
            let from = std::mem::replace(&mut at_mpa, *to);
            let feel = &mut feel;
            (1..=50).map(|k| feel(from + f64::from(k) / 50.0 * (to - from))).last().expect("steps")
        };
        turns_mpa.iter().map(way).collect()
    }

    /// In a dive to 40 MPa and back with a hysteresis of 2 MPa, half of it lags on either way. Inside a loop, only the
    /// share without lag changes.
    #[test]
    fn pressure_is_felt_as_by_the_play_operator() {
        let spec = JointSensorsSpec { pressure_hysteresis_mpa: 2.0, ..JointSensorsSpec::default() };
        let felt = felt_mpa(&spec, &[1.0, 40.0, 39.0, 36.0, 20.0, 0.0]);
        // From rest, the play of 4 MPa is 2 MPa to either side.
        for (felt, expected) in felt.iter().zip([0.5, 39.0, 38.5, 37.0, 21.0, 1.0]) {
            assert!((felt - expected).abs() < 1e-12, "{felt} against {expected}");
        }
        let none = JointSensorsSpec::default();
        assert!(felt_mpa(&none, &[0.3, 40.0, 17.1]).iter().zip([0.3, 40.0, 17.1]).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    /// In oil that cools linearly, settled sensors are behind by rate times lag. They approach this as a first-order
    /// lag does.
    #[test]
    fn sensors_lag_behind_the_oil() {
        let spec = JointSensorsSpec { sensor_lag_s: 400.0, ..JointSensorsSpec::default() };
        let mut sensors = SensorSurroundings::new(&spec);
        let mut feel =
            |oil_c: f64, elapsed_s: f64| sensors.follow(OilState { oil_c, pressure_pa: 0.0 }, elapsed_s).oil_c;
        assert_eq!(feel(25.0, 0.0), 25.0);
        let mut t_s = 0.0;
        for elapsed_s in [0.01, 1.0, 10.0, 389.0, 1600.0] {
            t_s += elapsed_s;
            let expected = 25.0 - 0.005 * (t_s - 400.0 * (1.0 - (-t_s / 400.0_f64).exp()));
            let sensor_c = feel(25.0 - 0.005 * t_s, elapsed_s);
            assert!((sensor_c - expected).abs() < 1e-9, "{sensor_c} against {expected} after {t_s} s");
        }
    }
}

//! The temperature of a sensor that follows the oil's with a lag: `dT/dt = (oil - T) / lag`.

use armcal_core::sensor::Conditions;
use armcal_core::time::Stamp;

/// A first-order lag, exact for readings on straight steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LaggedTemperature {
    pub lag_s: f64,
    last: Option<(Stamp, f64)>,
}

impl LaggedTemperature {
    pub(crate) fn new(lag_s: f64) -> Self {
        Self { lag_s, last: None }
    }

    /// Takes in a reading of the thermometer; the first one is the sensor's initial temperature.
    pub(crate) fn hear(&mut self, stamp: Stamp, oil_c: f64) {
        if !oil_c.is_finite() {
            return;
        }
        self.last = Some(match self.last {
            None => (stamp, oil_c),
            Some((before, sensor_c)) => {
                let share = (-stamp.since_s(before).max(0.0) / self.lag_s.max(1e-3)).exp();
                (stamp.max(before), oil_c + (sensor_c - oil_c) * share)
            }
        });
    }

    /// Returns the conditions at the sensors.
    pub(crate) fn of_sensors(&self, conditions: &Conditions) -> Conditions {
        Conditions { oil_c: conditions.oil_c.map(|now_c| self.behind(now_c)), ..*conditions }
    }

    /// Returns the sensor's temperature when the oil has `oil_c`; that of the oil before any reading.
    fn behind(&self, oil_c: f64) -> f64 {
        match self.last {
            Some((_, sensor_c)) if self.lag_s > 0.0 => sensor_c,
            _ => oil_c,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::time::SIMULATION_EPOCH;

    #[test]
    fn a_step_is_followed_by_its_share() {
        let mut lagged = LaggedTemperature::new(100.0);
        lagged.hear(SIMULATION_EPOCH, 20.0);
        for s in 1..=100 {
            lagged.hear(SIMULATION_EPOCH.plus_s(f64::from(s)), 10.0);
        }
        let expected_c = 10.0 + 10.0 * (-1.0_f64).exp();
        assert!((lagged.behind(10.0) - expected_c).abs() < 1e-9);
        assert_eq!(LaggedTemperature::new(0.0).behind(7.0), 7.0);
    }
}

//! Thermometers in oil and water, and the depth gauge, at 1 Hz.
//!
//! A thermometer follows with a first-order lag (exact for temperatures that change linearly between its samples), and
//! adds its bias and noise. Its converter has a step. `gauge = (1 + scale error) pressure + bias + noise`.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::as_built::GaugesAsBuilt;
use crate::sensors::lag::Lag;
use crate::spec::{TemperatureSpec, WaterSpec};
use armcal_core::robot::GRAVITY_M_S2;
use armcal_core::stats::stream_rng;
use armcal_core::streams::{PressureSample, TemperatureSample, Thermometer};
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

/// Pressure of the air at the surface, Pa.
const ATMOSPHERE_PA: f64 = 101_325.0;

/// Sensors with a low rate.
#[derive(Clone, Debug)]
pub(crate) struct SlowSensors {
    spec: TemperatureSpec,
    water: WaterSpec,
    built: GaugesAsBuilt,
    oil: Probe,
    sea: Probe,
    gauge: ChaCha8Rng,
}

/// Thermometer's own temperature.
#[derive(Clone, Debug)]
struct Probe {
    rng: ChaCha8Rng,
    lag: Lag,
    read_at: Option<Stamp>,
}

impl SlowSensors {
    pub(crate) fn new(temperature: &TemperatureSpec, water: &WaterSpec, built: &GaugesAsBuilt, seed: u64) -> Self {
        let probe = |name: &str| Probe { rng: stream_rng(seed, name), lag: Lag::default(), read_at: None };
        Self {
            spec: *temperature,
            water: *water,
            built: *built,
            oil: probe("thermometer/oil"),
            sea: probe("thermometer/water"),
            gauge: stream_rng(seed, "depth_gauge"),
        }
    }

    pub(crate) fn temperature(&mut self, which: Thermometer, true_c: f64, stamp: Stamp) -> TemperatureSample {
        let (probe, bias_k) = match which {
            Thermometer::Oil => (&mut self.oil, self.built.oil_bias_k),
            Thermometer::Water => (&mut self.sea, self.built.water_bias_k),
        };
        let noise_k = self.spec.thermometer_noise_k;
        let noise: f64 = StandardNormal.sample(&mut probe.rng);
        let shown_c = probe.follow(true_c, stamp, self.spec.thermometer_lag_s) + bias_k + noise_k * noise;
        let step_k = self.spec.thermometer_resolution_k;
        TemperatureSample {
            stamp,
            thermometer: which,
            temperature_c: if step_k > 0.0 { (shown_c / step_k).round() * step_k } else { shown_c },
            variance_c2: noise_k * noise_k,
        }
    }

    /// Returns the pressure at the vehicle, `heave_m` above its station.
    pub(crate) fn pressure(&mut self, heave_m: f64, stamp: Stamp) -> PressureSample {
        let noise: f64 = StandardNormal.sample(&mut self.gauge);
        let depth_m = self.water.station_depth_m(stamp.since_s(SIMULATION_EPOCH)) - heave_m;
        let true_pa = ATMOSPHERE_PA + gauge_pressure_pa(&self.water, depth_m);
        let noise_pa = self.water.pressure_noise_pa;
        let shown_pa = true_pa * (1.0 + self.built.pressure_scale_error) + self.built.pressure_bias_pa;
        PressureSample { stamp, pressure_pa: shown_pa + noise_pa * noise, variance_pa2: noise_pa * noise_pa }
    }
}

impl Probe {
    fn follow(&mut self, true_c: f64, stamp: Stamp, lag_s: f64) -> f64 {
        let elapsed_s = self.read_at.map_or(0.0, |read_at| stamp.since_s(read_at));
        self.read_at = Some(stamp);
        self.lag.follow(true_c, elapsed_s, lag_s)
    }
}

/// Returns the water's pressure at a depth, above that of the surface, Pa.
pub(crate) fn gauge_pressure_pa(water: &WaterSpec, depth_m: f64) -> f64 {
    water.density_kg_m3 * GRAVITY_M_S2 * depth_m
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensors(temperature: &TemperatureSpec, built: &GaugesAsBuilt) -> SlowSensors {
        let silent = TemperatureSpec { thermometer_noise_k: 0.0, ..*temperature };
        let water = WaterSpec { pressure_noise_pa: 0.0, ..WaterSpec::default() };
        SlowSensors::new(&silent, &water, built, 1)
    }

    /// A step, then a linear rise, agree with the closed forms of a first-order lag, at 1 Hz and at uneven times.
    #[test]
    fn a_thermometer_lags_as_its_closed_form() {
        let spec = TemperatureSpec { thermometer_lag_s: 20.0, ..TemperatureSpec::default() };
        for seconds in [vec![1.0; 120], vec![0.5, 3.0, 7.5, 40.0, 69.0]] {
            for (jump_k, rise_k_s) in [(5.0, 0.0), (0.0, 0.03)] {
                let mut slow = sensors(&spec, &GaugesAsBuilt::default());
                let mut read = |true_c: f64, t_s: f64| {
                    slow.temperature(Thermometer::Oil, true_c, SIMULATION_EPOCH.plus_s(t_s)).temperature_c
                };
                assert_eq!(read(10.0, 0.0), 10.0);
                // The step is just after the first sample.
                let mut t_s = 1e-6;
                let mut shown = read(10.0 + jump_k, t_s);
                for elapsed_s in &seconds {
                    t_s += elapsed_s;
                    shown = read(10.0 + jump_k + rise_k_s * t_s, t_s);
                }
                let left = (-t_s / 20.0_f64).exp();
                let expected = 10.0 + jump_k * (1.0 - left) + rise_k_s * (t_s - 20.0 * (1.0 - left));
                // The step takes a microsecond, over which the probe already follows.
                assert!((shown - expected).abs() < 1e-6, "{shown} against {expected}");
            }
        }
    }

    #[test]
    fn biases_add_scales_multiply_and_steps_round() {
        let built =
            GaugesAsBuilt { oil_bias_k: 0.3, water_bias_k: -0.2, pressure_bias_pa: 700.0, pressure_scale_error: 1e-3 };
        let spec = TemperatureSpec { thermometer_resolution_k: 0.25, ..TemperatureSpec::default() };
        let mut slow = sensors(&spec, &built);
        let at = SIMULATION_EPOCH;
        assert_eq!(slow.temperature(Thermometer::Oil, 10.0, at).temperature_c, 10.25);
        assert_eq!(slow.temperature(Thermometer::Water, 4.0, at).temperature_c, 3.75);
        let true_pa = 101_325.0 + 1025.0 * 9.806_65 * 498.0;
        assert!((slow.pressure(2.0, at).pressure_pa - (true_pa * 1.001 + 700.0)).abs() < 1e-6);
    }
}

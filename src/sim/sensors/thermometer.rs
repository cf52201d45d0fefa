//! Thermometers in oil and water, and the depth gauge, at 1 Hz.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::sim::spec::{TemperatureSpec, WaterSpec};
use crate::sim::vehicle::GRAVITY_M_S2;
use crate::stats::stream_rng;
use crate::streams::{PressureSample, TemperatureSample, Thermometer};
use crate::time::Stamp;

/// Of the air at the surface.
const ATMOSPHERE_PA: f64 = 101_325.0;

/// True temperatures over time: water that may change, oil that warms and follows it.
#[derive(Clone, Copy, Debug)]
pub(in crate::sim) struct Temperatures {
    pub spec: TemperatureSpec,
}

impl Temperatures {
    /// `start + rise (1 - exp(-t / b)) + change (1 - (a exp(-t / a) - b exp(-t / b)) / (a - b))`, Celsius: its own warming
    /// with time constant b, and the water's change (time constant a) behind the same lag.
    pub(in crate::sim) fn oil_c(&self, t_s: f64) -> f64 {
        let spec = &self.spec;
        let (water_s, oil_s) = (spec.water_time_constant_s, spec.oil_time_constant_s);
        let (by_water, by_oil) = ((-t_s / water_s).exp(), (-t_s / oil_s).exp());
        // Equal time constants: the limit of the quotient.
        let followed = if (water_s - oil_s).abs() < 1e-6 * oil_s {
            1.0 - by_oil * (1.0 + t_s / oil_s)
        } else {
            1.0 - (water_s * by_water - oil_s * by_oil) / (water_s - oil_s)
        };
        spec.oil_start_c + spec.oil_rise_k * (1.0 - by_oil) + spec.water_change_k * followed
    }

    /// `water + change (1 - exp(-t / a))`, Celsius.
    pub(in crate::sim) fn water_c(&self, t_s: f64) -> f64 {
        let spec = &self.spec;
        spec.water_c + spec.water_change_k * (1.0 - (-t_s / spec.water_time_constant_s).exp())
    }
}

/// The slow sensors.
#[derive(Clone, Debug)]
pub(in crate::sim) struct SlowSensors {
    noise_k: f64,
    water: WaterSpec,
    oil: ChaCha8Rng,
    sea: ChaCha8Rng,
    gauge: ChaCha8Rng,
}

impl SlowSensors {
    pub(in crate::sim) fn new(temperature: &TemperatureSpec, water: &WaterSpec, seed: u64) -> Self {
        Self {
            noise_k: temperature.thermometer_noise_k,
            water: *water,
            oil: stream_rng(seed, "thermometer/oil"),
            sea: stream_rng(seed, "thermometer/water"),
            gauge: stream_rng(seed, "depth_gauge"),
        }
    }

    pub(in crate::sim) fn temperature(&mut self, which: Thermometer, true_c: f64, stamp: Stamp) -> TemperatureSample {
        let rng = match which {
            Thermometer::Oil => &mut self.oil,
            Thermometer::Water => &mut self.sea,
        };
        let noise: f64 = StandardNormal.sample(rng);
        TemperatureSample {
            stamp,
            thermometer: which,
            temperature_c: true_c + self.noise_k * noise,
            variance_c2: self.noise_k * self.noise_k,
        }
    }

    /// Pressure at the vehicle, `heave_m` above its station.
    pub(in crate::sim) fn pressure(&mut self, heave_m: f64, stamp: Stamp) -> PressureSample {
        let noise: f64 = StandardNormal.sample(&mut self.gauge);
        let depth_m = self.water.depth_m - heave_m;
        let true_pa = ATMOSPHERE_PA + self.water.density_kg_m3 * GRAVITY_M_S2 * depth_m;
        let noise_pa = self.water.pressure_noise_pa;
        PressureSample { stamp, pressure_pa: true_pa + noise_pa * noise, variance_pa2: noise_pa * noise_pa }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oil_warms_by_six_kelvin_within_ten_minutes() {
        let temperatures = Temperatures { spec: TemperatureSpec::default() };
        assert!((temperatures.oil_c(0.0) - 10.0).abs() < 1e-12);
        assert!(temperatures.oil_c(600.0) - temperatures.oil_c(0.0) > 6.0);
    }
}

//! A potentiometer as built: gain, nonlinearity, temperature and pressure coefficients, worn spot.

use std::f64::consts::TAU;

use rand::RngExt;

use crate::as_built::joint::{Harmonic, JointAsBuilt, WornSpot};
use crate::as_built::normal::{effect_normal, effect_rng};
use crate::spec::JointSensorsSpec;

impl JointAsBuilt {
    pub(super) fn draw_potentiometer(&mut self, sensors: &JointSensorsSpec, gain_max: f64, seed: u64) {
        let name = self.name.clone();
        let normal = |effect: &str, std: f64| effect_normal(seed, effect, &name, std);
        self.gain_error = gain_max * effect_rng(seed, "gain", &name).random_range(-1.0..=1.0);
        self.temperature_offset_rad_per_k = normal("temperature_offset", sensors.temperature_offset_std_rad_per_k);
        self.temperature_gain_per_k = normal("temperature_gain", sensors.temperature_gain_std_per_k);
        self.pressure_offset_rad_per_mpa = normal("pressure_offset", sensors.pressure_offset_std_rad_per_mpa);
        self.pressure_gain_per_mpa = normal("pressure_gain", sensors.pressure_gain_std_per_mpa);
        self.harmonics = draw_harmonics(self, sensors.nonlinearity_peak, &mut effect_rng(seed, "nonlinearity", &name));
        if sensors.wears() {
            let mut rng = effect_rng(seed, "worn_spot", &name);
            // Not near the end stops, where no arm works.
            let center_rad = self.center_rad + self.range_rad * rng.random_range(-0.4..=0.4);
            let sign = if rng.random_range(0.0..1.0) < 0.5 { -1.0 } else { 1.0 };
            let peak_rad = sign * sensors.worn_spot_peak_rad;
            self.worn_spot = Some(WornSpot { center_rad, peak_rad, width_rad: sensors.worn_spot_width_rad });
        }
    }
}

/// Draws two to four harmonics over the range, scaled so that the largest deviation within it is `peak` of the range.
fn draw_harmonics(joint: &JointAsBuilt, peak: f64, rng: &mut impl rand::Rng) -> Vec<Harmonic> {
    const SAMPLES: u32 = 2000;
    let n = rng.random_range(2..=4_u32);
    let raw = (1..=n)
        .map(|order| Harmonic {
            order: f64::from(order),
            amplitude_rad: rng.random_range(0.2..=1.0),
            phase_rad: rng.random_range(0.0..TAU),
        })
        .collect();
    let mut unscaled = JointAsBuilt { harmonics: raw, ..joint.clone() };
    let largest = (0..=SAMPLES)
        .map(|i| joint.center_rad + joint.range_rad * (f64::from(i) / f64::from(SAMPLES) - 0.5))
        .map(|angle| unscaled.nonlinearity_rad(angle).abs())
        .fold(f64::MIN_POSITIVE, f64::max);
    for harmonic in &mut unscaled.harmonics {
        harmonic.amplitude_rad *= peak * joint.range_rad / largest;
    }
    unscaled.harmonics
}

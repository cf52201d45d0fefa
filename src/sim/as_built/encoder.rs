//! An encoder as built: eccentricity of its disc.

use std::f64::consts::TAU;

use rand::RngExt;

use crate::as_built::joint::{Harmonic, JointAsBuilt};
use crate::as_built::normal::effect_rng;
use crate::spec::JointSensorsSpec;

impl JointAsBuilt {
    pub(super) fn draw_encoder(&mut self, sensors: &JointSensorsSpec, seed: u64) {
        if sensors.encoder_eccentricity_rad > 0.0 {
            let phase_rad = effect_rng(seed, "eccentricity", &self.name).random_range(0.0..TAU);
            let amplitude_rad = sensors.encoder_eccentricity_rad;
            self.eccentricity = Some(Harmonic { order: 1.0, amplitude_rad, phase_rad });
        }
    }
}

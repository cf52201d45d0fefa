//! A resolver as built: errors of its windings and its temperature coefficient.

use std::f64::consts::TAU;

use rand::RngExt;

use crate::as_built::joint::{JointAsBuilt, ResolverAsBuilt};
use crate::as_built::normal::{effect_normal, effect_rng};
use crate::spec::JointSensorsSpec;

impl JointAsBuilt {
    pub(super) fn draw_resolver(&mut self, sensors: &JointSensorsSpec, seed: u64) {
        let normal = |effect: &str, std: f64| effect_normal(seed, effect, &self.name, std);
        self.resolver = Some(ResolverAsBuilt {
            pole_pairs: sensors.resolver_pole_pairs,
            phase_rad: effect_rng(seed, "resolver_phase", &self.name).random_range(0.0..TAU),
            imbalance: normal("resolver_imbalance", sensors.resolver_imbalance_std),
            quadrature_rad: normal("resolver_quadrature", sensors.resolver_quadrature_std_rad),
            temperature_offset_rad_per_k: normal("resolver_temperature", sensors.resolver_temperature_std_rad_per_k),
        });
    }
}

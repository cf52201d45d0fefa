//! Resolver: `reading = shaft + offset + c (T - T0) + (atan2((1 + a) sin f, cos(f + q)) - f) / p`, `f = p shaft +
//! phase`.
//!
//! The windings' voltages differ by a, and their angle differs from a right one by q; there are p pole pairs. To first
//! order the error is `(a sin 2f + q (1 - cos 2f)) / 2p`: twice per electrical turn.

use std::f64::consts::TAU;

use crate::as_built::{JointAsBuilt, ResolverAsBuilt};
use crate::sensors::OilState;
use crate::spec::JointSensorsSpec;

#[derive(Clone, Copy, Debug)]
pub(super) struct Resolver {
    offset_rad: f64,
    reference_c: f64,
    built: Option<ResolverAsBuilt>,
}

impl Resolver {
    pub(super) fn new(built: &JointAsBuilt, spec: &JointSensorsSpec) -> Self {
        Self { offset_rad: built.offset_error_rad, reference_c: spec.reference_c, built: built.resolver }
    }

    pub(super) fn reading_rad(&self, shaft_rad: f64, around: &OilState) -> f64 {
        let Some(built) = self.built else { return shaft_rad + self.offset_rad };
        let pole_pairs = f64::from(built.pole_pairs.get());
        let electrical_rad = pole_pairs * shaft_rad + built.phase_rad;
        let sine = (1.0 + built.imbalance) * electrical_rad.sin();
        let cosine = (electrical_rad + built.quadrature_rad).cos();
        let error_rad = (sine.atan2(cosine) - electrical_rad + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
        let warm_k = around.oil_c - self.reference_c;
        shaft_rad + self.offset_rad + built.temperature_offset_rad_per_k * warm_k + error_rad / pole_pairs
    }
}

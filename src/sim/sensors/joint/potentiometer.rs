//! A potentiometer: a wiper on a resistive track.
//!
//! `reading = m + (1 + g + cg (T - T0) + pg p) (x - m) + nl(x) + o + co (T - T0) + po p + spot(x) + drift`. Here m is
//! the middle of the joint's range, T the oil's temperature, and p the pressure above that of the surface. The spot is
//! `spot = peak exp(-((x - c) / width)^2 / 2)`. The wiper's contact x drags behind the shaft: `x = shaft + w
//! (play(shaft) - shaft)`, with a play `hysteresis / w` wide. The backlash between joint and shaft has w = 1: a
//! reversal first moves nothing. The contact, however, moves at once with slope 1 - w, because only part of the spring
//! has to turn over. `drift` walks with time and with travel. A lost contact leaves the input open: a Markov chain in
//! time with rates `anywhere + worn spot(x) / peak` and `1 / mean length`.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::as_built::JointAsBuilt;
use crate::sensors::OilState;
use crate::spec::JointSensorsSpec;
use armcal_core::stats::stream_rng;

#[derive(Clone, Debug)]
pub(super) struct Potentiometer {
    built: JointAsBuilt,
    spec: JointSensorsSpec,
    /// Shaft angle at the last sample.
    shaft_rad: f64,
    /// Middle of the wiper's play.
    dragged_rad: f64,
    drift_rad: f64,
    is_open: bool,
    walk: ChaCha8Rng,
    use_walk: ChaCha8Rng,
    dropouts: ChaCha8Rng,
}

impl Potentiometer {
    pub(super) fn new(built: &JointAsBuilt, spec: &JointSensorsSpec, seed: u64) -> Self {
        let rng = |effect: &str| stream_rng(seed, &format!("pot/{effect}/{}", built.name));
        Self {
            built: built.clone(),
            spec: *spec,
            shaft_rad: built.center_rad,
            dragged_rad: built.center_rad,
            drift_rad: 0.0,
            is_open: false,
            walk: rng("drift"),
            use_walk: rng("use_drift"),
            dropouts: rng("dropouts"),
        }
    }

    pub(super) fn settle(&mut self, shaft_rad: f64) {
        self.shaft_rad = shaft_rad;
        self.dragged_rad = shaft_rad;
    }

    /// Follows the shaft; returns the contact's position, and true if contact is lost.
    pub(super) fn advance(&mut self, shaft_rad: f64, elapsed_s: f64) -> (f64, bool) {
        self.walk_on((shaft_rad - self.shaft_rad).abs(), elapsed_s);
        self.shaft_rad = shaft_rad;
        let share = self.spec.hysteresis_share;
        let half_play = 0.5 * self.spec.hysteresis_rad / share;
        self.dragged_rad = self.dragged_rad.clamp(shaft_rad - half_play, shaft_rad + half_play);
        let contact_rad = shaft_rad + share * (self.dragged_rad - shaft_rad);
        self.lose_or_find_contact(contact_rad, elapsed_s);
        (contact_rad, self.is_open)
    }

    /// Sets the rate at which contact is lost anywhere on the track from now on.
    pub(super) fn lose_contact(&mut self, dropout_per_s: f64) {
        self.spec.dropout_per_s = dropout_per_s;
    }

    pub(super) fn reading_rad(&self, contact_rad: f64, around: &OilState) -> f64 {
        let built = &self.built;
        let warm_k = around.oil_c - self.spec.reference_c;
        let pressure_mpa = around.pressure_pa * 1e-6;
        let gain =
            1.0 + built.gain_error + built.temperature_gain_per_k * warm_k + built.pressure_gain_per_mpa * pressure_mpa;
        built.center_rad
            + gain * (contact_rad - built.center_rad)
            + built.nonlinearity_rad(contact_rad)
            + built.offset_error_rad
            + built.temperature_offset_rad_per_k * warm_k
            + built.pressure_offset_rad_per_mpa * pressure_mpa
            + built.worn_spot.map_or(0.0, |spot| spot.bump_rad(contact_rad))
            + self.drift_rad
    }

    fn walk_on(&mut self, travel_rad: f64, elapsed_s: f64) {
        let step: f64 = StandardNormal.sample(&mut self.walk);
        self.drift_rad += self.spec.drift_rad_per_sqrt_h * (elapsed_s / 3600.0).sqrt() * step;
        let by_use = self.spec.drift_rad_per_sqrt_turn;
        if by_use > 0.0 {
            let step: f64 = StandardNormal.sample(&mut self.use_walk);
            self.drift_rad += by_use * (travel_rad / std::f64::consts::TAU).sqrt() * step;
        }
    }

    /// Advances the chain by one step, exact for any length of time while the contact does not move.
    fn lose_or_find_contact(&mut self, contact_rad: f64, elapsed_s: f64) {
        let (anywhere, on_spot) = (self.spec.dropout_per_s, self.spec.worn_dropout_per_s);
        if anywhere <= 0.0 && on_spot <= 0.0 {
            return;
        }
        let wear = self.built.worn_spot.map_or(0.0, |spot| spot.wear(contact_rad));
        let (lost_per_s, found_per_s) = (anywhere + on_spot * wear, 1.0 / self.spec.dropout_mean_s);
        let both_per_s = lost_per_s + found_per_s;
        let change = -(-both_per_s * elapsed_s).exp_m1() / both_per_s;
        let chance = change * if self.is_open { found_per_s } else { lost_per_s };
        if self.dropouts.random_range(0.0..1.0) < chance {
            self.is_open = !self.is_open;
        }
    }
}

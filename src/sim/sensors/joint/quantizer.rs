//! Quantizer of raw counts: `wrap(step round((offset + scale angle + noise) / step))`, by the datasheet's offset and
//! scale.
//!
//! An input without a sensor is pulled to 0 counts and shows the converter's noise, limited at 0 (assumed).

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::spec::JointSensorsSpec;
use armcal_core::robot::{JointSensorSpec, SensorKind};
use armcal_core::stats::stream_rng;

#[derive(Clone, Debug)]
pub(super) struct Quantizer {
    offset_counts: f64,
    counts_per_rad: f64,
    wrap_counts: f64,
    noise_rms_counts: f64,
    /// Step of the converter, counts; 0 for none.
    step_counts: f64,
    state: State,
    /// Last word, counts.
    counts: f64,
    noise: ChaCha8Rng,
}

/// Smallest scale of a converter's word: nine bits per turn are 1.4 counts per degree. A smaller scale is that of an
/// angle in rad or deg.
const MIN_WORD_COUNTS_PER_DEG: f64 = 1.4;

fn is_word(nominal: &JointSensorSpec) -> bool {
    nominal.counts_per_rad.abs() * 1.0_f64.to_radians() >= MIN_WORD_COUNTS_PER_DEG
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Alive,
    Stuck,
    Dead,
}

impl Quantizer {
    pub(super) fn new(nominal: &JointSensorSpec, spec: &JointSensorsSpec, seed: u64) -> Self {
        Self {
            offset_counts: nominal.offset_counts,
            counts_per_rad: nominal.counts_per_rad,
            wrap_counts: nominal.wrap_counts,
            // An encoder counts lines; it has no converter.
            noise_rms_counts: if nominal.kind == SensorKind::Encoder { 0.0 } else { spec.noise_rms_counts },
            step_counts: if is_word(nominal) { spec.resolution_counts } else { 0.0 },
            state: State::Alive,
            counts: 0.0,
            noise: stream_rng(seed, &format!("pot/noise/{}", nominal.joint)),
        }
    }

    /// A dead sensor cannot stick.
    pub(super) fn stick(&mut self) {
        if self.state == State::Alive {
            self.state = State::Stuck;
        }
    }

    pub(super) fn die(&mut self) {
        self.state = State::Dead;
    }

    /// Returns the word for an angle, or for an open input. Each call draws one noise value, so that faults do not
    /// shift the stream.
    pub(super) fn read(&mut self, angle_rad: Option<f64>) -> f64 {
        let noise: f64 = StandardNormal.sample(&mut self.noise);
        let noise_counts = self.noise_rms_counts * noise;
        match (self.state, angle_rad) {
            (State::Stuck, _) => {}
            (State::Alive, Some(angle_rad)) => {
                let exact = self.offset_counts + self.counts_per_rad * angle_rad;
                self.counts = self.stepped(exact + noise_counts).rem_euclid(self.wrap_counts);
            }
            (State::Dead, _) | (State::Alive, None) => {
                // The addition turns -0.0, a rounded -0.3, into 0.0.
                self.counts = self.stepped(noise_counts).clamp(0.0, self.wrap_counts - 1.0) + 0.0;
            }
        }
        self.counts
    }

    fn stepped(&self, counts: f64) -> f64 {
        let step = self.step_counts;
        if step > 0.0 { (counts / step).round() * step } else { counts }
    }
}

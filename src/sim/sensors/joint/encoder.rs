//! Encoder: `reading = shaft + offset + e sin(shaft + phase)`, in whole steps of a turn.
//!
//! The once-a-turn error is that of a disc off its axis (eccentricity over the lines' radius). An encoder has no wiper
//! and no track: temperature, pressure, drift and noise do not affect it.

use std::f64::consts::TAU;

use crate::as_built::{Harmonic, JointAsBuilt};
use crate::spec::JointSensorsSpec;

#[derive(Clone, Copy, Debug)]
pub(super) struct Encoder {
    offset_rad: f64,
    eccentricity: Option<Harmonic>,
    /// Resolution, rad; 0 for none.
    step_rad: f64,
}

impl Encoder {
    pub(super) fn new(built: &JointAsBuilt, spec: &JointSensorsSpec) -> Self {
        let steps = spec.encoder_steps_per_turn;
        Self {
            offset_rad: built.offset_error_rad,
            eccentricity: built.eccentricity,
            step_rad: if steps > 0.0 { TAU / steps } else { 0.0 },
        }
    }

    pub(super) fn reading_rad(&self, shaft_rad: f64) -> f64 {
        let error = self.eccentricity.map_or(0.0, |e| e.amplitude_rad * (e.order * shaft_rad + e.phase_rad).sin());
        shaft_rad + self.offset_rad + error
    }

    /// Returns the step nearest to a reading.
    pub(super) fn stepped_rad(&self, reading_rad: f64) -> f64 {
        if self.step_rad > 0.0 { (reading_rad / self.step_rad).round() * self.step_rad } else { reading_rad }
    }
}

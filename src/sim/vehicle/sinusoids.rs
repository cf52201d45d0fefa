//! Sums of sinusoids with random periods and phases and a given rms.

use rand::RngExt;

use crate::spec::VehicleMotionSpec;
use armcal_core::stats::stream_rng;

const N_SINUSOIDS: usize = 6;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sinusoid {
    amplitude: f64,
    rate_rad_s: f64,
    phase_rad: f64,
}

/// Sum of sinusoids on one axis.
pub(super) type SinusoidSum = [Sinusoid; N_SINUSOIDS];

/// Value, first and second derivative.
pub(super) type Derivatives = [f64; 3];

/// Draws random shares and phases, with periods spread evenly in their logarithm; the RMS of the sum of sinusoids is
/// exact.
pub(super) fn draw_sinusoids(spec: &VehicleMotionSpec, rms: f64, seed: u64, name: &str) -> SinusoidSum {
    let mut rng = stream_rng(seed, &format!("vehicle/{name}"));
    let (low, high) = (spec.period_min_s.ln(), spec.period_max_s.ln());
    let mut axis = [Sinusoid::default(); N_SINUSOIDS];
    for (k, sinusoid) in axis.iter_mut().enumerate() {
        // One period from each sixth of the band: no two are alike, because beats would change the RMS of a short run.
        let place = (k as f64 + rng.random_range(0.0..1.0)) / N_SINUSOIDS as f64;
        sinusoid.rate_rad_s = std::f64::consts::TAU / (low + place * (high - low)).exp();
        sinusoid.amplitude = rng.random_range(0.5..1.0);
        sinusoid.phase_rad = rng.random_range(0.0..std::f64::consts::TAU);
    }
    let norm = axis.iter().map(|s| 0.5 * s.amplitude * s.amplitude).sum::<f64>().sqrt();
    for sinusoid in &mut axis {
        sinusoid.amplitude *= rms / norm;
    }
    axis
}

/// Returns value and derivatives of the sum.
pub(super) fn evaluate(axis: &SinusoidSum, t_s: f64) -> Derivatives {
    let mut jet = [0.0; 3];
    for s in axis {
        let (sin, cos) = (s.rate_rad_s * t_s + s.phase_rad).sin_cos();
        jet[0] += s.amplitude * sin;
        jet[1] += s.amplitude * s.rate_rad_s * cos;
        jet[2] -= s.amplitude * s.rate_rad_s * s.rate_rad_s * sin;
    }
    jet
}

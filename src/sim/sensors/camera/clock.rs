//! The camera's clock: latency, jitter and drift of image stamps.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::spec::ClockSpec;
use armcal_core::stats::stream_rng;
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

#[derive(Debug)]
pub(super) struct CameraClock {
    spec: ClockSpec,
    jitter: ChaCha8Rng,
}

impl CameraClock {
    pub(super) fn new(spec: &ClockSpec, seed: u64) -> Self {
        Self { spec: *spec, jitter: stream_rng(seed, "camera/clock") }
    }

    /// Returns the arrival time of an image whose shutter closed at `closed`, and its stamp by the camera's own clock.
    pub(super) fn stamps(&mut self, closed: Stamp) -> (Stamp, Stamp) {
        let jitter: f64 = StandardNormal.sample(&mut self.jitter);
        let late_s = (self.spec.camera_latency_s + self.spec.camera_jitter_s * jitter).max(0.0);
        let gained_s = 1e-6 * self.spec.camera_clock_drift_ppm * closed.since_s(SIMULATION_EPOCH);
        (closed.plus_s(late_s), closed.plus_s(late_s + gained_s))
    }
}

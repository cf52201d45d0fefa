//! Detects that an arm stands still, from its own noisy sensors.

pub(crate) use crate::session::constants::settling::NEAR_RAD;
use crate::session::constants::settling::{NOISE_SIGMAS, SMOOTHING, STILL_RAD};
use armcal_core::streams::JointAngles;

/// Follows the readings since the arm was commanded to stop.
pub(crate) struct SettlingDetector {
    smooth: JointAngles,
    /// Mean square of a reading's distance from the smoothed one, rad^2: noise, and lag while it moves.
    scatter: JointAngles,
    /// Smoothed angles at which the arm began to stand, rad.
    anchor: JointAngles,
    still_s: f64,
}

impl SettlingDetector {
    pub fn new(angles: JointAngles) -> Self {
        Self { smooth: angles, scatter: JointAngles::zeros(angles.len()), anchor: angles, still_s: 0.0 }
    }

    /// Takes in one reading. Returns the time for which the arm has stood near `set_point`, s.
    pub fn update(&mut self, now: &JointAngles, set_point: &JointAngles, period_s: f64) -> f64 {
        for joint in 0..now.len() {
            let apart = now[joint] - self.smooth[joint];
            self.smooth[joint] += SMOOTHING * apart;
            self.scatter[joint] += SMOOTHING * (apart * apart - self.scatter[joint]);
        }
        // The variance of such a mean is SMOOTHING / (2 - SMOOTHING) of a reading's.
        let stands = (0..now.len()).all(|j| {
            let noise_rad = (self.scatter[j] * SMOOTHING / (2.0 - SMOOTHING)).sqrt();
            (self.smooth[j] - self.anchor[j]).abs() < STILL_RAD + NOISE_SIGMAS * noise_rad
        });
        if stands && self.smooth.max_abs_difference(set_point) < NEAR_RAD {
            self.still_s += period_s;
        } else {
            (self.still_s, self.anchor) = (0.0, self.smooth);
        }
        self.still_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::stats::stream_rng;
    use rand_distr::{Distribution, StandardNormal};

    const PERIOD_S: f64 = 0.01;
    const REST_S: f64 = 0.4;

    /// Moves at `rate_rad_s` towards zero, stops `left_rad` before it, with noisy readings. Returns the time at which
    /// it counts as standing, s.
    fn stood_at_s(rate_rad_s: f64, left_rad: f64, noise_rad: f64, seed: u64) -> Option<f64> {
        let mut rng = stream_rng(seed, "stillness");
        let set_point = JointAngles::zeros(2);
        let start = JointAngles::from_fn(2, |_| 0.3);
        let mut stillness = SettlingDetector::new(start);
        for k in 0..1200 {
            let t_s = f64::from(k) * PERIOD_S;
            let angle = (0.3 - rate_rad_s * t_s).max(left_rad);
            let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
            let now = JointAngles::from_fn(2, |_| angle + noise_rad * noise());
            if stillness.update(&now, &set_point, PERIOD_S) >= REST_S {
                return Some(t_s);
            }
        }
        None
    }

    #[test]
    fn an_arm_that_stopped_stands_and_one_that_creeps_on_does_not() {
        for seed in 1..=40 {
            for noise_rad in [0.0, 0.0006, 0.003] {
                for left_rad in [0.0, 0.005] {
                    let stopped_s = (0.3 - left_rad) / 0.2;
                    let at_s = stood_at_s(0.2, left_rad, noise_rad, seed).expect("it stands");
                    assert!(at_s > stopped_s && at_s < stopped_s + 3.0, "{noise_rad} {left_rad}: {stopped_s} {at_s}");
                }
                // At 0.02 rad/s it moves 0.008 rad within the time that it must stand; it arrives after 14 s.
                assert_eq!(stood_at_s(0.02, 0.0, noise_rad, seed), None, "{noise_rad}");
            }
        }
    }

    #[test]
    fn an_arm_that_stopped_far_from_its_set_point_never_counts_as_there() {
        assert_eq!(stood_at_s(0.2, 0.03, 0.0006, 1), None);
    }
}

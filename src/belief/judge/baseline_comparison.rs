//! Held-out views by a calibration against the same views by mount and map alone, the joints at the datasheet.
//!
//! A paired test over views, for all tags of a view share its errors: `l_v`, the mean over the tags of view v of `ln
//! (distance by the baseline / distance by the calibration)`, has the mean m and the standard deviation s over n views;
//! `t = m sqrt(n) / s` is Student's with n - 1 degrees of freedom where neither is better (Student 1908). The
//! logarithm, for distances differ between views by factors.

use crate::judge::constants::baseline_comparison::LEAST_P;
pub use crate::judge::constants::baseline_comparison::SIGNIFICANCE;
use armcal_core::stats::StudentT;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Mount and map alone on the held-out views, and whether the calibration beats it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BaselineComparison {
    /// Tag position error by mount and map alone.
    pub rms_m: f64,
    /// Distances by the calibration over those by mount and map alone, geometric mean.
    pub ratio: f64,
    /// Probability of as large an improvement where there is none; close to one where the calibration is worse.
    pub p_value: f64,
}

impl BaselineComparison {
    /// `log_ratios`: of each view, baseline over calibration. `None` below two views.
    pub(crate) fn new(rms_m: f64, log_ratios: &[f64]) -> Option<Self> {
        let n = log_ratios.len();
        if n < 2 {
            return None;
        }
        let mean = log_ratios.iter().sum::<f64>() / n as f64;
        let variance = log_ratios.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / (n - 1) as f64;
        let t = if mean == 0.0 { 0.0 } else { mean / (variance / n as f64).sqrt() };
        let p_value = StudentT::new(n - 1).above(t).clamp(LEAST_P, 1.0 - LEAST_P);
        Some(Self { rms_m, ratio: (-mean).exp(), p_value })
    }

    /// Whether the calibration is better than by chance.
    #[must_use]
    pub fn is_beaten(&self) -> bool {
        self.p_value < SIGNIFICANCE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::stats::stream_rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Of arms that neither fits better, one in a hundred passes.
    #[test]
    fn chance_passes_as_often_as_it_should() {
        const SEEDS: u64 = 4000;
        for n in [4, 10, 40] {
            let passed = (0..SEEDS).filter(|&seed| {
                let mut rng = stream_rng(seed, "log ratios");
                let log_ratios: Vec<f64> = (0..n).map(|_| StandardNormal.sample(&mut rng)).collect();
                BaselineComparison::new(0.01, &log_ratios).expect("views").is_beaten()
            });
            let share = passed.count() as f64 / SEEDS as f64;
            println!("{n} views: {share:.4} of {SEEDS} pass by chance");
            assert!((0.006..0.014).contains(&share), "{n} views: {share}");
        }
    }

    #[test]
    fn half_the_distance_in_each_view_is_no_chance() {
        let halved = BaselineComparison::new(0.02, &[0.6, 0.8, 0.7, 0.65]).expect("views");
        assert!(halved.is_beaten() && (halved.ratio - 0.5).abs() < 0.01, "{halved:?}");
        let doubled = BaselineComparison::new(0.02, &[-0.6, -0.8, -0.7, -0.65]).expect("views");
        assert!(!doubled.is_beaten() && doubled.p_value > 0.99, "{doubled:?}");
        let same = BaselineComparison::new(0.02, &[0.0; 5]).expect("views");
        assert!(!same.is_beaten() && same.p_value == 0.5, "{same:?}");
        assert_eq!(BaselineComparison::new(0.02, &[1.0]), None);
    }
}

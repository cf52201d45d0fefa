//! Constants of `optics::CornerNoise` fitted to trials by maximum likelihood, for each kind of water.

use nalgebra::Vector2;

use crate::trials::{DetectionStudy, Outcome, TagTrial};
use armcal_core::optics::{CornerNoise, DetectionChance};
use armcal_sim::WaterKind;

/// Limit of a squared normalised error in the fit: chi-square of 2 degrees of freedom, one in 300 000.
const CLIP: f64 = 25.0;

/// A fitted model and how well it agrees with its trials.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedNoise {
    pub water: WaterKind,
    pub noise: CornerNoise,
    pub n_corners: usize,
    /// Mean squared normalised error of a corner: 2 where the model is right.
    pub mean_chi_square: f64,
}

/// Fits the trials in one kind of water.
#[must_use]
pub fn fit_noise(study: &DetectionStudy, water: WaterKind) -> FittedNoise {
    let trials: Vec<&TagTrial> = study.trials.iter().filter(|trial| trial.condition.water == water).collect();
    let chance = fit_chance(&trials);
    let with = |x: &[f64; 3]| CornerNoise {
        edge_std_px: x[0].exp(),
        contrast_loss_per_m: x[1],
        floor_std_px: x[2].exp(),
        chance,
    };
    let start = [0.05_f64.ln(), 0.5, 0.01_f64.ln()];
    let best = search(start, [0.5, 0.3, 0.5], |x| {
        let floor_is_sane = (1e-4_f64.ln()..1.0).contains(&x[2]) && (-1.0..10.0).contains(&x[1]);
        if floor_is_sane { misfit(&with(x), &trials) } else { f64::INFINITY }
    });
    let noise = with(&best);
    let chi_squares: Vec<f64> = corners(&noise, &trials).map(|(_, chi_square)| chi_square).collect();
    let n_corners = chi_squares.len();
    let mean_chi_square = chi_squares.iter().map(|c| c.min(CLIP)).sum::<f64>() / n_corners.max(1) as f64;
    FittedNoise { water, noise, n_corners, mean_chi_square }
}

/// Twice the negative log likelihood with clipped errors.
fn misfit(noise: &CornerNoise, trials: &[&TagTrial]) -> f64 {
    corners(noise, trials).map(|(log_determinant, chi_square)| log_determinant + chi_square.min(CLIP)).sum()
}

/// Pairs for every detected corner: logarithm of the covariance's determinant, and squared normalised error.
fn corners<'a>(noise: &'a CornerNoise, trials: &'a [&TagTrial]) -> impl Iterator<Item = (f64, f64)> + 'a {
    trials.iter().flat_map(|trial| {
        let Outcome::Found { corners_px, .. } = &trial.outcome else { return Vec::new() };
        let covariances = noise.covariances_px2(&trial.truth_px, trial.condition.range_m, trial.condition.blur_px);
        (0..4)
            .filter_map(|k| {
                let error = Vector2::from(corners_px[k]) - Vector2::from(trial.truth_px[k]);
                let inverse = covariances[k].try_inverse()?;
                Some((covariances[k].determinant().ln(), (error.transpose() * inverse * error).x))
            })
            .collect()
    })
}

/// Fits the chance of detection by logistic regression in shortest side and range.
fn fit_chance(trials: &[&TagTrial]) -> DetectionChance {
    let with = |x: &[f64; 4]| DetectionChance {
        half_side_px: x[0],
        side_width_px: x[1].exp(),
        half_range_m: x[2],
        range_width_m: x[3].exp(),
    };
    let best = search([12.0, 0.0, 3.0, -1.5], [2.0, 0.5, 0.5, 0.5], |x| {
        if !(-3.0..2.0).contains(&x[1]) || !(-4.0..1.0).contains(&x[3]) || !(0.1..20.0).contains(&x[2]) {
            return f64::INFINITY;
        }
        let chance = with(x);
        let surprise = |trial: &&TagTrial| {
            let p = chance.of(trial.shortest_side_px, trial.condition.range_m).clamp(1e-6, 1.0 - 1e-6);
            let is_found = matches!(trial.outcome, Outcome::Found { .. });
            -2.0 * if is_found { p.ln() } else { (1.0 - p).ln() }
        };
        trials.iter().map(surprise).sum()
    });
    with(&best)
}

/// Minimises `cost` by coordinate search with shrinking steps (Hooke and Jeeves 1961 without pattern moves).
fn search<const N: usize>(start: [f64; N], mut steps: [f64; N], cost: impl Fn(&[f64; N]) -> f64) -> [f64; N] {
    let (mut best, mut lowest) = (start, cost(&start));
    for _ in 0..200 {
        let mut is_better = false;
        for k in 0..N {
            for sign in [1.0, -1.0] {
                let mut trial = best;
                trial[k] += sign * steps[k];
                let value = cost(&trial);
                if value < lowest {
                    (best, lowest, is_better) = (trial, value, true);
                    break;
                }
            }
        }
        if !is_better {
            steps.iter_mut().for_each(|step| *step *= 0.5);
        }
        if steps.iter().all(|step| *step < 1e-4) {
            break;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_search_finds_the_bottom_of_a_bowl() {
        let best =
            search([0.0, 0.0], [0.5, 0.5], |x| (x[0] - 1.3).powi(2) + 2.0 * (x[1] + 0.7).powi(2) + 0.5 * x[0] * x[1]);
        // The gradient vanishes at 2x + y/2 = 2.6, x/2 + 4y = -2.8.
        assert!((best[0] - 1.522_58).abs() < 1e-3 && (best[1] + 0.890_32).abs() < 1e-3, "{best:?}");
    }
}

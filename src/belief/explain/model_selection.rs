//! Selection of the optional terms that the data need, by Laplace's approximation of the evidence.
//!
//! `ln Z = -cost/2 + (ln|P| - ln|N|)/2 + sum over views (ln|L| - ln|S^T G S + L|)/2 - n ln(noise)` at the fitted
//! scales. N is the reduced normal matrix, P the common parameters' prior, L the views' own (MacKay 1992, eq. 4.4). A
//! term is added if it brings three nats or more (Kass and Raftery 1995: strong evidence). Known terms of such a sensor
//! (nonlinearity, temperature, backlash) are in from the start. Their prior scale is fitted, so that an absent one
//! costs nothing.

pub(crate) use crate::explain::constants::model_selection::CAMERA_ERROR_STD;
use crate::explain::constants::model_selection::{MIN_GAIN_NATS, MIN_RATE_RAD_S, MIN_SESSION_H};
use armcal_core::numeric::Loss;
use nalgebra::Cholesky;

use crate::measure::WeightedMeasurement;
use crate::model::blocks::Block;
use crate::model::parameters::ParameterKind;
use crate::model::prior::at_least;
use crate::model::scales::TIME_JITTER_STD_S;
use crate::solve::constants::levenberg_marquardt::TIGHT;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::BundleInput;
use crate::solve::levenberg_marquardt::solve;
use crate::solve::linearize::NormalEquations;
use crate::solve::outliers::{Rejected, rejected};
use crate::solve::problem::BundleProblem;

/// Term that not every recording has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OptionalTerm {
    /// An error of the camera's pose that all tags of a view share.
    CameraError,
    /// An offset between the clocks of joint sensors and camera; only if joints move.
    TimeOffset,
    /// A drift of every joint's offset; only in long sessions without a prior.
    Drift,
    /// A random walk of every joint's offset; only without a prior, and after failures and geometry.
    Walk,
}

/// Result of the trial of an optional term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// The term that was tried.
    pub term: OptionalTerm,
    /// True if the term stayed.
    pub is_in: bool,
    /// Natural logarithm of the evidence with the term over that without it.
    pub gain_nats: f64,
}

/// Estimates without and with each optional term that the data may need; returns the best estimate and the trials.
#[must_use]
pub fn select_model<'a>(input: &BundleInput<'a>) -> Option<(Estimate<'a>, Vec<Selection>)> {
    let mut best = estimate(input)?;
    let mut best_input = input.clone();
    let mut selections = Vec::new();
    for term in candidates(input) {
        let wider = with(&best_input, term);
        let Some(found) = estimate(&wider) else { continue };
        let gain_nats = evidence_gain_nats(&found, &best);
        let is_in = gain_nats > MIN_GAIN_NATS;
        selections.push(Selection { term, is_in, gain_nats });
        if is_in {
            (best, best_input) = (found, wider);
        }
    }
    Some((best, selections))
}

fn candidates(input: &BundleInput<'_>) -> Vec<OptionalTerm> {
    let positions = |view: &crate::views::view::View| {
        let other = |tag: &&crate::views::view::TagObservation| !tag.is_in_pixels();
        view.tags.iter().filter(other).count() >= 2
    };
    let moves = input.views.iter().any(|view| view.rate_rad_s.iter().any(|rate| rate.abs() > MIN_RATE_RAD_S));
    let stamps = || input.views.iter().filter_map(|view| view.conditions.stamp);
    let lasts_h = stamps().min().zip(stamps().max()).map_or(0.0, |(a, b)| b.since_s(a) / 3600.0);
    let mut out = Vec::new();
    if input.scales.camera_error_std.is_none() && input.views.iter().any(positions) {
        out.push(OptionalTerm::CameraError);
    }
    if moves && !input.model.has(Block::Clock) {
        out.push(OptionalTerm::TimeOffset);
    }
    // A prior has its own columns.
    if lasts_h > MIN_SESSION_H && input.joint_prior.is_none() {
        out.push(OptionalTerm::Drift);
    }
    out
}

/// Adds the offset between the clocks to `input`, together with the jitter of an image's stamp.
pub(crate) fn estimate_clock(input: &mut BundleInput<'_>) {
    input.model.blocks.insert(Block::Clock);
    input.scales.time_jitter_std_s = TIME_JITTER_STD_S;
}

fn with<'a>(input: &BundleInput<'a>, term: OptionalTerm) -> BundleInput<'a> {
    let mut wider = input.clone();
    match term {
        OptionalTerm::CameraError => wider.scales.camera_error_std = Some(CAMERA_ERROR_STD),
        OptionalTerm::TimeOffset => estimate_clock(&mut wider),
        OptionalTerm::Drift => {
            for kinds in wider.model.joints.iter_mut().filter(|kinds| !kinds.is_empty()) {
                if !kinds.contains(&ParameterKind::DriftPerH) {
                    kinds.push(ParameterKind::DriftPerH);
                }
            }
        }
        // The walk is tried when all other terms are known (`walk`).
        OptionalTerm::Walk => {}
    }
    wider
}

/// Natural logarithm of the evidence of `wider` over that of `other`, two models of the same views. It counts the
/// observations that both use, because a model that rejects more has less to explain.
pub(crate) fn evidence_gain_nats(wider: &Estimate<'_>, other: &Estimate<'_>) -> f64 {
    let observations = wider.problem.observations.iter().zip(&other.problem.observations);
    let both = |a: [bool; 4], b: [bool; 4]| [0, 1, 2, 3].map(|corner| a[corner] && b[corner]);
    let shared: Vec<[bool; 4]> = observations.map(|(a, b)| both(a.used(), b.used())).collect();
    log_evidence_on(wider, &shared) - log_evidence_on(other, &shared)
}

/// Logarithm of the evidence with the scales of `found` and only the corners that are `used`.
fn log_evidence_on(found: &Estimate<'_>, used: &[[bool; 4]]) -> f64 {
    if found.problem.observations.iter().zip(used).all(|(observation, used)| observation.used() == *used) {
        return log_evidence(&found.problem, &found.solved.normal);
    }
    let mut problem = found.problem.clone();
    problem.observations.iter_mut().zip(used).for_each(|(observation, used)| observation.set_used(*used));
    let solved = solve(&problem, found.solved.state.clone(), Loss::Square, TIGHT);
    log_evidence(&problem, &solved.normal)
}

/// Logarithm of the evidence, up to terms that all models of the same data share.
pub(crate) fn log_evidence(problem: &BundleProblem<'_>, normal: &NormalEquations) -> f64 {
    let log_det = |matrix: &nalgebra::DMatrix<f64>| {
        Cholesky::new(matrix.clone()).map(|f| 2.0 * f.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>())
    };
    let Some(of_normal) = log_det(&normal.matrix) else { return f64::NEG_INFINITY };
    let of_information = log_det(&problem.prior.information.matrix).unwrap_or(f64::NEG_INFINITY);
    // The tags' priors are the same under all models.
    let by_std = problem.prior.by_std(&problem.layout).filter(|(block, ..)| !block.is_tag());
    let of_prior = of_information - 2.0 * by_std.map(|(.., std)| log_sum(std)).sum::<f64>();
    let of_views: f64 = normal.eliminated.iter().map(|own| own.log_ratio).sum();
    let log_noise = |data: &WeightedMeasurement| {
        let [position, rotation] = [problem.scales.position_std_m, problem.scales.rotation_std_rad].map(f64::ln);
        match data {
            WeightedMeasurement::Corners(_) | WeightedMeasurement::Board { .. } => {
                data.n_coordinates() as f64 * problem.scales.noise.ln()
            }
            WeightedMeasurement::Position { .. } => 3.0 * position,
            WeightedMeasurement::Pose { .. } => 3.0 * (position + rotation),
        }
    };
    let used = problem.observations.iter().filter(|observation| observation.is_used);
    let of_noise: f64 = used.map(|observation| log_noise(&observation.data)).sum();
    0.5 * (of_prior - of_normal + of_views - normal.cost) - of_noise
}

fn log_sum(std: &[f64]) -> f64 {
    std.iter().map(|std| at_least(*std).ln()).sum()
}

/// Logarithm of the evidence with each rejected observation at its rejection cost, to compare estimates that reject
/// different ones.
pub(crate) fn log_evidence_of_all(found: &Estimate<'_>) -> f64 {
    let log_noise = found.problem.scales.noise.ln();
    let cost = |rejected: Rejected| 0.5 * rejected.chi2 + rejected.n_coordinates as f64 * log_noise;
    let rejected = found.problem.observations.iter().map(|observation| cost(rejected(observation)));
    log_evidence(&found.problem, &found.solved.normal) - rejected.sum::<f64>()
}

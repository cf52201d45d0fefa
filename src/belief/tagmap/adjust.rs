//! Levenberg-Marquardt on cameras and tags, and the selection of the detections in use.
//!
//! The first loss is Cauchy's, under which outliers lose their pull; the median of the residuals gives its width. Then
//! detections with large residuals are rejected. The last loss is quadratic for all but the rarest of correct
//! residuals, so that the result is as good as least squares.

pub(super) use crate::tagmap::constants::adjust::MAX_STEPS;
use crate::tagmap::constants::adjust::{
    AT_REST, CAUCHY_WIDTH, CONVERGED, DAMPING, FIRST_WIDTH, HUBER_WIDTH, MAX_ITERATIONS, MEDIAN_OF_LENGTH, ROUGHLY,
    ROUNDING, SCALE_BOUNDS,
};
use nalgebra::{Isometry3, Vector6};

use crate::tagmap::linearize::{cost, squares};
use crate::tagmap::normal_equations::{NormalEquations, Reduced};
use crate::tagmap::problem::{Block, MapProblem};
use armcal_core::numeric::{self, LeastSquares, Loss, Outcome, Proposal, Stop, StopRule};
use armcal_core::spatial::exp;

/// Lowers the cost from the state of `problem`; returns true if the search converged.
pub(super) fn minimize(problem: &mut MapProblem<'_>, loss: Loss, converged: f64) -> bool {
    let n_steps = MAX_ITERATIONS.min(problem.steps_left);
    if n_steps == 0 {
        return false;
    }
    let mut normal = NormalEquations::new(problem);
    normal.update(problem, loss);
    let state = State::of(problem);
    let mut search = Search { problem, loss, normal, state, has_trial: false };
    let stop = StopRule { gain: converged, rounding: ROUNDING, ..StopRule::after(n_steps) };
    let report = numeric::minimize(&mut search, &DAMPING, &stop);
    search.problem.steps_left -= report.iterations;
    search.restore();
    match report.stop {
        Stop::Iterations => report.last_gain * degrees_of_freedom(problem).max(1) as f64 <= AT_REST,
        Stop::Damping => true,
        _ => report.outcome() == Outcome::Converged,
    }
}

/// A search over the map's poses; the trial state is in the problem itself.
struct Search<'a, 'b> {
    problem: &'a mut MapProblem<'b>,
    loss: Loss,
    normal: NormalEquations,
    /// The last accepted state.
    state: State,
    has_trial: bool,
}

impl Search<'_, '_> {
    fn restore(&mut self) {
        if self.has_trial {
            self.state.restore(self.problem);
            self.has_trial = false;
        }
    }
}

impl LeastSquares for Search<'_, '_> {
    fn cost(&self) -> f64 {
        self.normal.cost
    }

    fn propose(&mut self, damping: f64) -> Option<Proposal> {
        self.restore();
        if !step(self.problem, &self.normal, damping) {
            return None;
        }
        self.has_trial = true;
        Some(Proposal { length: f64::INFINITY, predicted_gain: f64::INFINITY })
    }

    fn trial_cost(&mut self) -> Option<f64> {
        Some(cost(self.problem, self.loss))
    }

    fn accept(&mut self) {
        self.has_trial = false;
        self.state = State::of(self.problem);
        self.normal.update(self.problem, self.loss);
    }
}

/// Poses that an adjustment changes.
struct State {
    tags: Vec<Isometry3<f64>>,
    extras: Vec<Isometry3<f64>>,
    blocks: Vec<Isometry3<f64>>,
}

impl State {
    fn of(problem: &MapProblem<'_>) -> Self {
        Self {
            tags: problem.tags.iter().map(|tag| tag.pose).collect(),
            extras: problem.extras.iter().map(|extra| extra.pose).collect(),
            blocks: problem.blocks.iter().map(|block| block.pose).collect(),
        }
    }

    fn restore(&self, problem: &mut MapProblem<'_>) {
        problem.tags.iter_mut().zip(&self.tags).for_each(|(tag, pose)| tag.pose = *pose);
        problem.extras.iter_mut().zip(&self.extras).for_each(|(extra, pose)| extra.pose = *pose);
        problem.blocks.iter_mut().zip(&self.blocks).for_each(|(block, pose)| block.pose = *pose);
    }
}

/// Takes one damped step; `false` where the system is singular.
fn step(problem: &mut MapProblem<'_>, normal: &NormalEquations, damping: f64) -> bool {
    let Some(Reduced { system, right, inverses }) = normal.reduce(problem, damping) else { return false };
    let Some(factor) = system.factorize() else { return false };
    let nodes = factor.solve(&right);
    let of_block = |(idx, block): (usize, &Block)| match block.node {
        Some(node) => nodes[node],
        None => normal.back_substitute(problem, idx, &inverses[idx], &nodes),
    };
    let steps: Vec<Vector6<f64>> = problem.blocks.iter().enumerate().map(of_block).collect();
    let turn = |pose: &mut Isometry3<f64>, step: &Vector6<f64>| {
        *pose *= exp(step);
        pose.rotation.renormalize();
    };
    for tag in &mut problem.tags {
        if let Some(node) = tag.node {
            turn(&mut tag.pose, &nodes[node]);
        }
    }
    problem.extras.iter_mut().for_each(|extra| turn(&mut extra.pose, &nodes[extra.node]));
    problem.blocks.iter_mut().zip(&steps).for_each(|(block, step)| turn(&mut block.pose, step));
    true
}

/// Ratio of the corners' standard deviation to the given one, from the median length of the residuals in use.
pub(super) fn scale(problem: &MapProblem<'_>) -> f64 {
    let mut lengths = Vec::new();
    for block in &problem.blocks {
        for seen in problem.observations[block.range.clone()].iter().filter(|seen| seen.is_used) {
            let camera_from_tag = block.pose.inv_mul(&problem.tags[seen.tag].pose);
            lengths.extend(squares(&problem.cameras[seen.camera], &camera_from_tag, seen));
        }
    }
    if lengths.is_empty() {
        return 1.0;
    }
    // Where the poses absorb much of the measurements, residuals are smaller than the noise.
    let freedom = degrees_of_freedom(problem) as f64 / (2 * lengths.len()) as f64;
    let middle = lengths.len() / 2;
    let (_, median, _) = lengths.select_nth_unstable_by(middle, f64::total_cmp);
    (median.sqrt() / MEDIAN_OF_LENGTH / freedom.max(0.05).sqrt()).clamp(SCALE_BOUNDS.0, SCALE_BOUNDS.1)
}

/// Residual coordinates less unknowns; a view of a single tag counts in both numbers.
pub(super) fn degrees_of_freedom(problem: &MapProblem<'_>) -> usize {
    let used = problem.observations.iter().filter(|seen| seen.is_used).count();
    let blocks = problem
        .blocks
        .iter()
        .filter(|block| problem.observations[block.range.clone()].iter().any(|s| s.is_used))
        .count();
    let priors = problem.tags.iter().filter(|tag| tag.prior.is_some()).count();
    let unknowns = 6 * blocks + 6 * problem.tags.iter().filter(|tag| tag.node.is_some()).count();
    (8 * used + 6 * priors).saturating_sub(unknowns)
}

/// Moves a rough initial guess near the solution.
pub(super) fn approach(problem: &mut MapProblem<'_>) {
    // Loops that do not close yet must not count as outliers.
    let loss = Loss::Huber { k: FIRST_WIDTH * scale(problem) };
    minimize(problem, loss, ROUGHLY);
    for _ in 0..4 {
        let loss = Loss::Cauchy { c: CAUCHY_WIDTH * scale(problem) };
        minimize(problem, loss, ROUGHLY);
    }
}

/// Uses exactly the detections whose corners agree within `beyond` standard deviations (root mean square, in the
/// estimated scale). Returns true if the selection changed.
pub(super) fn select(problem: &mut MapProblem<'_>, beyond: f64) -> bool {
    let limit = 4.0 * 2.0 * (beyond * scale(problem)).powi(2);
    let mut changed = false;
    for block in &problem.blocks {
        for at in block.range.clone() {
            let seen = &problem.observations[at];
            let camera_from_tag = block.pose.inv_mul(&problem.tags[seen.tag].pose);
            let squares = squares(&problem.cameras[seen.camera], &camera_from_tag, seen);
            let agrees = squares.into_iter().sum::<f64>() <= limit;
            changed |= agrees != seen.is_used;
            problem.observations[at].is_used = agrees;
        }
    }
    changed
}

/// Runs the last adjustment, to convergence.
pub(super) fn finish(problem: &mut MapProblem<'_>) -> bool {
    let loss = Loss::Huber { k: HUBER_WIDTH * scale(problem) };
    minimize(problem, loss, CONVERGED)
}

//! Levenberg-Marquardt over the common parameters; the views' own follow by back substitution.

use nalgebra::{Cholesky, DMatrix, DVector, Vector6};

use super::eliminated::SchurBlock;
use super::linearize::NormalEquations;
use super::problem::{BundleProblem, State};
use super::robust::Loss;
use crate::calib::methods::SolveOutcome;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::spatial::exp;

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct StopRule {
    pub max_iterations: usize,
    /// The cost that one more step would save, over the cost.
    pub relative_gain: f64,
}

pub(super) const TIGHT: StopRule = StopRule { max_iterations: 100, relative_gain: 1e-15 };
/// While scales or weights still change.
pub(super) const LOOSE: StopRule = StopRule { max_iterations: 20, relative_gain: 1e-6 };

/// The state at the end, its normal equations, and how it went.
pub(super) struct Solved {
    pub state: State,
    pub normal: NormalEquations,
    pub iterations: usize,
    pub outcome: SolveOutcome,
    /// Of the start.
    pub cost_initial: f64,
}

/// Relative error of a sum of thousands of squares.
const ROUNDING: f64 = 1e-11;
const FIRST_DAMPING: f64 = 1e-6;
const MAX_DAMPING: f64 = 1e12;

/// Minimizes the problem's cost from `state`.
pub(super) fn solve(problem: &BundleProblem<'_>, state: State, loss: Loss, stop: StopRule) -> Solved {
    let mut state = state;
    let mut normal = NormalEquations::new(problem);
    normal.update(problem, &state, loss);
    let cost_initial = normal.cost;
    let mut trial_normal = NormalEquations::new(problem);
    let mut trial = state.clone();
    let mut room = DMatrix::zeros(problem.layout.n, problem.layout.n);
    let mut step = DVector::zeros(problem.layout.n);
    let mut damping = FIRST_DAMPING;
    let mut iterations = 0;
    let outcome = loop {
        if iterations >= stop.max_iterations {
            break SolveOutcome::Stalled;
        }
        if solve_damped(&normal, damping, &mut room, &mut step).is_none() {
            damping = (damping * 10.0).max(FIRST_DAMPING);
            if damping > MAX_DAMPING {
                break SolveOutcome::Degenerate;
            }
            iterations += 1;
            continue;
        }
        let gain = step.dot(&normal.right) + own_gain(&normal);
        if gain.abs() <= stop.relative_gain * normal.cost.max(1e-300) {
            break if normal.cost.is_finite() { SolveOutcome::Converged } else { SolveOutcome::Degenerate };
        }
        iterations += 1;
        take_step(problem, &state, &normal, &step, &mut trial);
        trial_normal.update(problem, &trial, loss);
        // Rounding: near the end a step may cost a few last digits.
        if trial_normal.cost <= normal.cost * (1.0 + 1e-13) {
            std::mem::swap(&mut state, &mut trial);
            std::mem::swap(&mut normal, &mut trial_normal);
            damping = (damping * 0.1).max(1e-14);
        } else {
            // Where the step would save no more than the sum's last digits, the minimum is found as well as numbers go.
            if gain.abs() <= ROUNDING * normal.cost {
                break SolveOutcome::Converged;
            }
            damping *= 10.0;
            if damping > MAX_DAMPING {
                break SolveOutcome::Stalled;
            }
        }
    };
    Solved { state, normal, iterations, outcome, cost_initial }
}

/// The step by the matrix with its diagonal raised, factored in `room`; `None` where it has no Cholesky factor.
fn solve_damped(
    normal: &NormalEquations,
    damping: f64,
    room: &mut DMatrix<f64>,
    step: &mut DVector<f64>,
) -> Option<()> {
    let mut raised = std::mem::replace(room, DMatrix::zeros(0, 0));
    if raised.shape() == normal.matrix.shape() {
        raised.copy_from(&normal.matrix);
    } else {
        // A matrix that could not be factored took its room along.
        raised.clone_from(&normal.matrix);
    }
    for k in 0..raised.nrows() {
        raised[(k, k)] *= 1.0 + damping;
    }
    let factor = Cholesky::new(raised)?;
    step.copy_from(&normal.right);
    factor.solve_mut(step);
    *room = factor.unpack_dirty();
    Some(())
}

/// What the views' own parameters would save if the common ones stayed.
fn own_gain(normal: &NormalEquations) -> f64 {
    normal.eliminated.iter().filter(|own| own.has_any).map(|own| own.gradient.dot(&(own.inverse * own.gradient))).sum()
}

#[cfg(test)]
pub(super) fn stepped(
    problem: &BundleProblem<'_>,
    state: &State,
    normal: &NormalEquations,
    step: &DVector<f64>,
) -> State {
    let mut next = state.clone();
    take_step(problem, state, normal, step, &mut next);
    next
}

/// Makes `next` of `state` by a step of the common parameters, the views' own following.
fn take_step(
    problem: &BundleProblem<'_>,
    state: &State,
    normal: &NormalEquations,
    step: &DVector<f64>,
    next: &mut State,
) {
    let layout = &problem.layout;
    let twist = |at: usize| Vector6::from_fn(|k, _| step[at + k]);
    next.copy_from(state);
    next.joint += step.rows(0, layout.n_joint());
    if let Some(at) = layout.mount {
        next.mount *= exp(&twist(at));
    }
    if let Some(at) = layout.time {
        next.time_s += step[at];
    }
    if let Some(at) = layout.lens {
        for k in 0..2 {
            next.lens.focal_px[k] += step[at + k];
            next.lens.center_px[k] += step[at + 2 + k];
        }
        for k in 0..4 {
            next.lens.distortion[k] += step[at + 4 + k];
        }
    }
    for (pose, column) in next.tags.iter_mut().zip(&layout.tags) {
        if let Some(at) = column {
            *pose *= exp(&twist(*at));
        }
    }
    if let Some(at) = layout.gripper_tag {
        next.gripper_tag *= exp(&twist(at));
    }
    let mut groups = normal.eliminated.iter();
    for (view_idx, view) in problem.views.iter().enumerate() {
        let n_groups = 1 + usize::from(view.gripper.is_some());
        for own in groups.by_ref().take(n_groups).filter(|own| own.has_any) {
            add_own(problem, normal, own, view_idx, step, next);
        }
    }
}

fn add_own(
    problem: &BundleProblem<'_>,
    normal: &NormalEquations,
    own: &SchurBlock,
    view_idx: usize,
    step: &DVector<f64>,
    next: &mut State,
) {
    let pushed = own.push(problem, normal, view_idx, step);
    let own_step = own.inverse * (own.gradient - own.twists.tr_mul(&pushed));
    for joint in 0..MAX_JOINTS {
        next.joint_error[view_idx][joint] += own_step[joint];
    }
    if problem.scales.camera_error_std.is_some() && own.twists[(0, MAX_JOINTS)] != 0.0 {
        next.camera_error[view_idx] *= exp(&own_step.fixed_rows::<6>(MAX_JOINTS).into_owned());
    }
}

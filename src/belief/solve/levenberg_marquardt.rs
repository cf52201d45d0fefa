//! Levenberg-Marquardt over the common parameters; the views' own follow by back substitution.
//!
//! Gauss-Newton leaves out how the residuals bend. Where that matters (a compliance times an unknown load, both small)
//! its steps overshoot to and fro along one direction, each by the same share. So what a step gained tells the
//! curvature along it, and the next step is as much shorter, if it only goes back (the secant's rule along a line).

use crate::solve::constants::levenberg_marquardt::{COST_AT_PRIORS, DAMPING, GOES_BACK, OVERSHOT, TELLING_GAIN, TIGHT};
use nalgebra::{Cholesky, DMatrix, DVector, Vector6};

use crate::model::state::State;
use crate::solve::linearize::NormalEquations;
use crate::solve::problem::BundleProblem;
use crate::solve::schur::SchurBlock;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::numeric::{LeastSquares, Loss, Outcome, Proposal, StopRule, minimize};
use armcal_core::spatial::exp;

/// Until one more step would save less than `predicted_gain` of the cost.
pub(crate) const fn until(max_iterations: usize, predicted_gain: f64) -> StopRule {
    StopRule { max_iterations, predicted_gain, ..TIGHT }
}

/// The state at the end, its normal equations, and how it went.
#[derive(Clone)]
pub(crate) struct Solved {
    pub state: State,
    pub normal: NormalEquations,
    pub iterations: usize,
    pub outcome: Outcome,
    /// Cost at the start.
    pub cost_initial: f64,
}

/// The problem as the loop sees it, with the memory of one step.
struct Solver<'a, 'b> {
    problem: &'a BundleProblem<'b>,
    loss: Loss,
    state: State,
    normal: NormalEquations,
    trial: State,
    trial_normal: NormalEquations,
    room: DMatrix<f64>,
    step: DVector<f64>,
    /// Decrease of the cost by the whole step if the problem is linear; `share` of that step is taken.
    predicted_gain: f64,
    share: f64,
    last: LastStep,
}

/// The step that led here, and what it told.
struct LastStep {
    step: DVector<f64>,
    /// Its square in the metric of the normal equations.
    square: f64,
    /// Curvature of the cost along it, over that of the linear problem; 1 where nothing is known.
    curvature: f64,
}

impl LastStep {
    /// The share of a step that leads to the least cost: all of it, unless it goes back along a step that overshot.
    /// `pull`: the right side of the normal equations that `step` solves.
    fn share(&self, step: &DVector<f64>, pull: &DVector<f64>) -> f64 {
        if self.curvature < OVERSHOT {
            return 1.0;
        }
        let cosine = pull.dot(&self.step) / (pull.dot(step) * self.square).sqrt();
        if cosine < GOES_BACK { 1.0 / self.curvature } else { 1.0 }
    }
}

impl LeastSquares for Solver<'_, '_> {
    fn cost(&self) -> f64 {
        self.normal.cost
    }

    fn propose(&mut self, damping: f64) -> Option<Proposal> {
        solve_damped(&self.normal, damping, &mut self.room, &mut self.step)?;
        self.predicted_gain = self.step.dot(&self.normal.right) + own_gain(&self.normal);
        self.share = self.last.share(&self.step, &self.normal.right);
        if self.share < 1.0 {
            self.step *= self.share;
        }
        Some(Proposal { length: f64::INFINITY, predicted_gain: self.predicted_gain })
    }

    fn trial_cost(&mut self) -> Option<f64> {
        take_step(self.problem, &self.state, &self.normal, &self.step, &mut self.trial);
        self.trial_normal.update(self.problem, &self.trial, self.loss);
        Some(self.trial_normal.cost)
    }

    fn accept(&mut self) {
        // The gain of a share s of a step that should save P, under the curvature c: (2 s - s^2 c) P.
        let (share, gain) = (self.share, self.normal.cost - self.trial_normal.cost);
        // A gain of the sum's last digits tells nothing.
        if self.predicted_gain > TELLING_GAIN * self.normal.cost {
            self.last.curvature = (2.0 * share - gain / self.predicted_gain) / (share * share);
        }
        self.last.square = share * self.step.dot(&self.normal.right);
        std::mem::swap(&mut self.last.step, &mut self.step);
        std::mem::swap(&mut self.state, &mut self.trial);
        std::mem::swap(&mut self.normal, &mut self.trial_normal);
    }
}

/// Minimizes the problem's cost from `state`. Where every observation is rejected it stalls at the priors.
pub(crate) fn solve(problem: &BundleProblem<'_>, state: State, loss: Loss, stop: StopRule) -> Solved {
    let mut observations = problem.observations.iter();
    let is_without_data = !problem.observations.is_empty() && observations.all(|observation| !observation.is_used);
    let stop = if is_without_data { StopRule { cost: COST_AT_PRIORS, ..stop } } else { stop };
    let mut normal = NormalEquations::new(problem);
    normal.update(problem, &state, loss);
    let cost_initial = normal.cost;
    let n = problem.layout.n;
    let mut solver = Solver {
        problem,
        loss,
        trial: state.clone(),
        state,
        normal,
        trial_normal: NormalEquations::new(problem),
        room: DMatrix::zeros(n, n),
        step: DVector::zeros(n),
        predicted_gain: 0.0,
        share: 1.0,
        last: LastStep { step: DVector::zeros(n), square: 0.0, curvature: 1.0 },
    };
    let report = minimize(&mut solver, &DAMPING, &stop);
    let Solver { state, normal, .. } = solver;
    let outcome = if is_without_data { Outcome::Stalled } else { report.outcome() };
    Solved { state, normal, iterations: report.iterations, outcome, cost_initial }
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

/// Decrease of the cost by a step of the views' own parameters with the common ones held.
pub(crate) fn own_gain(normal: &NormalEquations) -> f64 {
    normal.eliminated.iter().filter(|own| own.has_any).map(|own| own.gradient.dot(&(own.inverse * own.gradient))).sum()
}

#[cfg(test)]
pub(crate) fn stepped(
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
pub(crate) fn take_step(
    problem: &BundleProblem<'_>,
    state: &State,
    normal: &NormalEquations,
    step: &DVector<f64>,
    next: &mut State,
) {
    next.copy_from(state);
    next.step(&problem.layout, step);
    let mut groups = normal.eliminated.iter();
    for (view_idx, view) in problem.views.iter().enumerate() {
        let n_groups = 1 + usize::from(view.gripper.is_some());
        for own in groups.by_ref().take(n_groups).filter(|own| own.has_any) {
            let pushed = own.push(problem, &normal.by_tag, view_idx, step);
            add_own(problem, own, view_idx, &pushed, next);
        }
    }
}

/// The step of a view's own parameters, where the common ones push the camera's twist by `pushed`.
fn add_own(problem: &BundleProblem<'_>, own: &SchurBlock, view_idx: usize, pushed: &Vector6<f64>, next: &mut State) {
    let own_step = own.inverse * (own.gradient - own.twists.tr_mul(pushed));
    for joint in 0..MAX_JOINTS {
        next.joint_error[view_idx][joint] += own_step[joint];
    }
    if problem.scales.camera_error_std.is_some() && own.moves_camera() {
        next.camera_error[view_idx] *= exp(&own_step.fixed_rows::<6>(MAX_JOINTS).into_owned());
    }
}

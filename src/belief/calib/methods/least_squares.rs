//! Least squares on landmark positions: what isotropic Gaussian noise asks for, and the reference for the paper's methods.
//!
//! Levenberg-Marquardt in prior-scaled parameters (no prior enters), with the analytic Jacobians of [`PositionProblem`].

use nalgebra::{DMatrix, DVector};

use super::{Solution, SolveOutcome};
use crate::calib::problem::{JointParameters, Parameter, PositionProblem};

const MAX_ITERATIONS: usize = 100;
/// A step of this length in prior sigma is the end.
const STEP_END: f64 = 1e-9;
const DAMPING_BEGIN: f64 = 1e-6;
const DAMPING_MIN: f64 = 1e-15;
const DAMPING_MAX: f64 = 1e12;

/// Sum of squared distances between seen and surveyed landmarks, m^2.
pub(super) fn sum_of_squares_m2(problem: &PositionProblem<'_>, at: &JointParameters) -> f64 {
    let mut sum = 0.0;
    problem.each(at, |o| sum += o.residual_m.norm_squared());
    sum
}

/// Minimizes the sum of squared distances over `free` from `guess`, m^2.
#[must_use]
pub fn least_squares(problem: &PositionProblem<'_>, free: &[Parameter], guess: &JointParameters) -> Solution {
    let cost_initial = sum_of_squares_m2(problem, guess);
    let scale = DVector::from_iterator(free.len(), free.iter().map(|p| p.prior_std(problem.robot)));
    let mut descent =
        Descent { problem, free, scale, at: *guess, cost_m2: cost_initial, damping: DAMPING_BEGIN, evaluations: 1 };
    let outcome = descent.run();
    let Descent { at: parameters, cost_m2: cost_final, evaluations, .. } = descent;
    Solution { parameters, outcome, evaluations, cost_initial, cost_final }
}

struct Descent<'a> {
    problem: &'a PositionProblem<'a>,
    free: &'a [Parameter],
    /// Prior sigma of each parameter.
    scale: DVector<f64>,
    at: JointParameters,
    cost_m2: f64,
    damping: f64,
    evaluations: usize,
}

impl Descent<'_> {
    fn run(&mut self) -> SolveOutcome {
        for _ in 0..MAX_ITERATIONS {
            let (residuals, mut jacobian) = self.problem.linearize(&self.at, self.free);
            for (column, scale) in self.scale.iter().enumerate() {
                jacobian.column_mut(column).scale_mut(*scale);
            }
            let normal = jacobian.transpose() * &jacobian;
            match self.descend(&normal, &(jacobian.transpose() * residuals)) {
                Some(length) if length < STEP_END => return SolveOutcome::Converged,
                Some(_) => {}
                None => return SolveOutcome::Degenerate,
            }
        }
        SolveOutcome::Stalled
    }

    /// Takes the first damped step that does not go up, and gives its length in prior sigma; `None` if there is none.
    fn descend(&mut self, normal: &DMatrix<f64>, gradient: &DVector<f64>) -> Option<f64> {
        while self.damping < DAMPING_MAX {
            let mut damped = normal.clone();
            for k in 0..damped.nrows() {
                damped[(k, k)] *= 1.0 + self.damping;
            }
            let step = -damped.cholesky()?.solve(gradient);
            let mut next = self.at;
            for ((parameter, step), scale) in self.free.iter().zip(step.iter()).zip(self.scale.iter()) {
                next.set(*parameter, self.at.get(*parameter) + step * scale);
            }
            let cost_m2 = sum_of_squares_m2(self.problem, &next);
            self.evaluations += 1;
            if cost_m2 <= self.cost_m2 {
                (self.at, self.cost_m2) = (next, cost_m2);
                self.damping = (self.damping * 0.1).max(DAMPING_MIN);
                return Some(step.norm());
            }
            if step.norm() < STEP_END {
                // At the bottom, rounding alone goes up.
                return Some(0.0);
            }
            self.damping *= 10.0;
        }
        None
    }
}

/// Fisher information of landmark positions with isotropic Gaussian noise of `position_std_m` per axis, at `at`, by `free` in
/// their own units: `J^T J / sigma^2`. Its inverse bounds the covariance of every unbiased estimator (Cramer and Rao).
#[must_use]
pub fn fisher_information(
    problem: &PositionProblem<'_>,
    free: &[Parameter],
    at: &JointParameters,
    position_std_m: f64,
) -> DMatrix<f64> {
    let (_, jacobian) = problem.linearize(at, free);
    jacobian.transpose() * &jacobian / position_std_m.powi(2)
}

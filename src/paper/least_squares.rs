//! Least squares on landmark positions: the optimum for isotropic Gaussian noise, and the reference for the paper's
//! methods.
//!
//! Levenberg-Marquardt in prior-scaled parameters (no prior enters), with the analytic Jacobians of
//! [`PositionProblem`].

use nalgebra::{DMatrix, DVector};

use armcal_belief::calib::PositionProblem;
use armcal_belief::calib::Solution;
use armcal_belief::model::{JointParameters, Parameter};
use armcal_core::numeric::{Damping, LeastSquares, Proposal, StopRule, minimize};

const DAMPING: Damping = Damping { first: 1e-6, min: 1e-15, max: 1e12, down: 0.1, up: 10.0, min_after_rejection: 0.0 };
/// Stop rule: the solver ends at a step of this length in prior sigma.
const STOP: StopRule = StopRule { step_length: 1e-9, ..StopRule::after(200) };

/// Sum of squared distances between observed and surveyed landmarks, m^2.
pub(crate) fn sum_of_squares_m2(problem: &PositionProblem<'_>, at: &JointParameters) -> f64 {
    let mut sum = 0.0;
    problem.each(at, |o| sum += o.residual_m.norm_squared());
    sum
}

/// Minimizes the sum of squared distances over `free` from `guess`, m^2.
#[must_use]
pub fn least_squares(problem: &PositionProblem<'_>, free: &[Parameter], guess: &JointParameters) -> Solution {
    let scale = DVector::from_iterator(free.len(), free.iter().map(|p| p.prior_std(problem.robot)));
    let mut descent = Descent::new(problem, free, scale, *guess);
    let cost_initial = descent.cost_m2;
    let outcome = minimize(&mut descent, &DAMPING, &STOP).outcome();
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
    normal: DMatrix<f64>,
    gradient: DVector<f64>,
    trial: JointParameters,
    trial_cost_m2: f64,
    evaluations: usize,
}

impl<'a> Descent<'a> {
    fn new(problem: &'a PositionProblem<'a>, free: &'a [Parameter], scale: DVector<f64>, at: JointParameters) -> Self {
        let cost_m2 = sum_of_squares_m2(problem, &at);
        let (normal, gradient) = (DMatrix::zeros(0, 0), DVector::zeros(0));
        let mut descent = Self {
            problem,
            free,
            scale,
            at,
            cost_m2,
            normal,
            gradient,
            trial: at,
            trial_cost_m2: cost_m2,
            evaluations: 1,
        };
        descent.linearize();
        descent
    }

    fn linearize(&mut self) {
        let (residuals, mut jacobian) = self.problem.linearize(&self.at, self.free);
        for (column, scale) in self.scale.iter().enumerate() {
            jacobian.column_mut(column).scale_mut(*scale);
        }
        (self.normal, self.gradient) = (jacobian.transpose() * &jacobian, jacobian.transpose() * residuals);
    }
}

impl LeastSquares for Descent<'_> {
    fn cost(&self) -> f64 {
        self.cost_m2
    }

    fn propose(&mut self, damping: f64) -> Option<Proposal> {
        let mut damped = self.normal.clone();
        for k in 0..damped.nrows() {
            damped[(k, k)] *= 1.0 + damping;
        }
        let step = -damped.cholesky()?.solve(&self.gradient);
        self.trial = self.at;
        for ((parameter, step), scale) in self.free.iter().zip(step.iter()).zip(self.scale.iter()) {
            self.trial.set(*parameter, self.at.get(*parameter) + step * scale);
        }
        Some(Proposal { length: step.norm(), predicted_gain: f64::INFINITY })
    }

    fn trial_cost(&mut self) -> Option<f64> {
        self.trial_cost_m2 = sum_of_squares_m2(self.problem, &self.trial);
        self.evaluations += 1;
        Some(self.trial_cost_m2)
    }

    fn accept(&mut self) {
        (self.at, self.cost_m2) = (self.trial, self.trial_cost_m2);
        self.linearize();
    }
}

/// Fisher information of landmark positions with isotropic Gaussian noise of `position_std_m` per axis, at `at`, by
/// `free` in their own units: `J^T J / sigma^2`. Its inverse bounds the covariance of every unbiased estimator (Cramer
/// and Rao).
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

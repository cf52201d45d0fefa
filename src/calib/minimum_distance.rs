//! The paper's proposed method: least sum of distances between seen and surveyed landmarks, by BOBYQA.
//!
//! Parameters are rescaled by their initial uncertainty (the paper's preconditioning), so that all need steps of about
//! one; bounds keep them within what a sensor of that datasheet can be. Powell (2009); port of PRIMA.

use super::problem::{JointParameters, Parameter, PositionProblem};

/// How a solver ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolveOutcome {
    Converged,
    /// The budget of evaluations ran out, or a parameter came to rest on its bound.
    Stalled,
    /// The data leave the problem without a minimum.
    Degenerate,
}

impl SolveOutcome {
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Stalled => "stalled",
            Self::Degenerate => "degenerate",
        }
    }
}

/// A method's answer.
#[derive(Clone, Debug)]
pub struct Solution {
    pub parameters: JointParameters,
    pub outcome: SolveOutcome,
    pub evaluations: usize,
    /// The method's objective at the first guess and at the end, in its own unit (here m).
    pub cost_initial: f64,
    pub cost_final: f64,
}

/// Half-width of the search box in units of prior sigma; beyond it a sensor is broken, not out of calibration.
const BOUND_SIGMAS: f64 = 6.0;
/// First and last trust-region radius, in prior sigma.
const RHO_BEGIN: f64 = 0.5;
const RHO_END: f64 = 1e-7;
/// The paper's authors allow as many.
const MAX_EVALUATIONS: usize = 10_000;

/// Minimizes [`PositionProblem::sum_of_distances_m`] over `free`, from `guess`; the other parameters stay there.
#[must_use]
pub fn minimum_distance(problem: &PositionProblem<'_>, free: &[Parameter], guess: &JointParameters) -> Solution {
    let scale: Vec<f64> = free.iter().map(|p| p.prior_std(problem.robot)).collect();
    let at = |x: &[f64]| {
        let mut parameters = *guess;
        for ((parameter, &scaled), std) in free.iter().zip(x).zip(&scale) {
            parameters.set(*parameter, guess.get(*parameter) + scaled * std);
        }
        parameters
    };
    let mut config = bobyqa::Config::new(free.len());
    config.rho_begin = RHO_BEGIN;
    config.rho_end = RHO_END;
    config.max_fun = MAX_EVALUATIONS;
    let (lower, upper) = (vec![-BOUND_SIGMAS; free.len()], vec![BOUND_SIGMAS; free.len()]);
    let mut x = vec![0.0; free.len()];
    let cost_initial = problem.sum_of_distances_m(&at(&x));
    let result = bobyqa::bobyqa(|x| problem.sum_of_distances_m(&at(x)), &mut x, &lower, &upper, config);
    let on_bound = x.iter().any(|v| v.abs() > BOUND_SIGMAS * 0.999);
    let outcome = match result.status {
        bobyqa::Status::Converged if !on_bound && result.found_finite() => SolveOutcome::Converged,
        bobyqa::Status::Converged | bobyqa::Status::MaxFunReached if result.found_finite() => SolveOutcome::Stalled,
        _ => SolveOutcome::Degenerate,
    };
    Solution { parameters: at(&x), outcome, evaluations: result.n_eval, cost_initial, cost_final: result.f }
}

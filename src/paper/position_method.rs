//! The interface of the paper's methods: the choice of equation, and the solver's result.

use crate::least_squares::{least_squares, sum_of_squares_m2};
use crate::minimum_variance::VarianceObjective;
use crate::search::{self, PositionSearch, SearchOptions};
use armcal_belief::calib::PositionProblem;
use armcal_belief::calib::Solution;
use armcal_belief::model::{JointParameters, Parameter};

/// An equation over landmark positions in the base frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PositionMethod {
    /// Sum of distances to known landmarks, m (the paper's proposed method).
    MinimumDistance,
    /// Sum over landmarks of the trace of the covariance of their positions, m^2; needs no map.
    MinimumVariance,
    /// Sum of squared distances to known landmarks, m^2, by Levenberg-Marquardt; no part of the paper.
    LeastSquares,
}

impl PositionMethod {
    /// Minimizes the method's objective over `free` (gains and offsets) from `guess`; the other parameters keep their
    /// value.
    #[must_use]
    pub fn solve(
        self,
        problem: &PositionProblem<'_>,
        free: &[Parameter],
        guess: &JointParameters,
        options: &SearchOptions,
    ) -> Solution {
        self.solve_watched(&PositionSearch { problem, free, guess, options }, &mut |_| {})
    }

    /// Solves like [`Self::solve`], and passes the objective of every evaluation to `watch`, in order.
    #[must_use]
    pub fn solve_watched(self, search: &PositionSearch<'_>, watch: &mut dyn FnMut(f64)) -> Solution {
        let PositionSearch { problem, free, guess, .. } = *search;
        match self {
            Self::MinimumDistance => {
                let objective = |at: &JointParameters| problem.sum_of_distances_m(at);
                search::minimize(search, objective, watch)
            }
            Self::MinimumVariance => {
                let mut variance = VarianceObjective::new(problem);
                search::minimize(search, |at| variance.trace_m2(at), watch)
            }
            Self::LeastSquares => {
                let solution = least_squares(problem, free, guess);
                watch(solution.cost_final);
                solution
            }
        }
    }

    /// The method's objective at `at`, in its unit.
    #[must_use]
    pub fn cost(self, problem: &PositionProblem<'_>, at: &JointParameters) -> f64 {
        match self {
            Self::MinimumDistance => problem.sum_of_distances_m(at),
            Self::MinimumVariance => VarianceObjective::new(problem).trace_m2(at),
            Self::LeastSquares => sum_of_squares_m2(problem, at),
        }
    }
}

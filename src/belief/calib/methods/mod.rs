//! The methods that the paper names, on one interface: positions of landmarks in, gain and offset of each joint out.
//!
//! `minimum_distance` and `minimum_variance` are the paper's equations, `search` how both are minimized: BOBYQA in a
//! box, from one start or several. `least_squares` is the reference that Gaussian noise asks for. `joint_limits` needs
//! no camera: the nominal end stops of each joint against its readings there. The interface is
//! [`PositionMethod::solve`].

pub(crate) mod calibration;
pub(crate) mod end_stops;
pub(crate) mod gripper_tag;
mod joint_limits;
mod least_squares;
mod minimum_distance;
mod minimum_variance;
pub(crate) mod observability;
pub(crate) mod position_problem;
mod search;
#[cfg(test)]
mod tests;

pub use gripper_tag::{MountEstimate, mount_by_gripper_tag};
pub use joint_limits::{EndStopFit, fit_stops};
pub use least_squares::{fisher_information, least_squares};
pub use minimum_distance::minimum_distance;
pub use minimum_variance::{Gauge, VarianceObjective, determined_by_variance};
pub use observability::{Unobservable, free_parameters};
pub use position_problem::PositionProblem;
pub use search::{Interpolation, PositionSearch, Scaling, SearchOptions};

use crate::calib::parameters::{JointParameters, Parameter};
use armcal_core::numeric::Outcome;

/// A method's answer.
#[derive(Clone, Debug)]
pub struct Solution {
    pub parameters: JointParameters,
    pub outcome: Outcome,
    pub evaluations: usize,
    /// The method's objective at the first guess and at the end, in its own unit: m for minimum distance, m^2 for
    /// minimum variance and least squares, rad^2 for joint limits.
    pub cost_initial: f64,
    pub cost_final: f64,
}

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
    /// Minimizes the method's objective over `free` (gains and offsets) from `guess`; all else stays there.
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

    /// The same, telling `watch` the objective of every evaluation in order.
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
            Self::LeastSquares => least_squares::sum_of_squares_m2(problem, at),
        }
    }
}

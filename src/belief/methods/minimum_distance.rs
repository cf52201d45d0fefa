//! The paper's proposed method: least sum of distances between seen and surveyed landmarks, over all landmarks, by
//! BOBYQA.

use crate::methods::position_method::PositionMethod;
use crate::methods::search::SearchOptions;
use crate::model::parameters::{JointParameters, Parameter};
use crate::positions::position_problem::PositionProblem;
use crate::positions::solution::Solution;

/// Minimizes [`PositionProblem::sum_of_distances_m`] over `free`, from `guess`; the other parameters stay there.
#[must_use]
pub fn minimum_distance(problem: &PositionProblem<'_>, free: &[Parameter], guess: &JointParameters) -> Solution {
    PositionMethod::MinimumDistance.solve(problem, free, guess, &SearchOptions::default())
}

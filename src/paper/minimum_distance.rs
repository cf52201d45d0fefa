//! The paper's proposed method: least sum of distances between observed and surveyed landmarks, over all landmarks, by
//! BOBYQA.

use crate::position_method::PositionMethod;
use crate::search::SearchOptions;
use armcal_belief::calib::PositionProblem;
use armcal_belief::calib::Solution;
use armcal_belief::model::{JointParameters, Parameter};

/// Minimizes [`PositionProblem::sum_of_distances_m`] over `free`, from `guess`; the other parameters stay there.
#[must_use]
pub fn minimum_distance(problem: &PositionProblem<'_>, free: &[Parameter], guess: &JointParameters) -> Solution {
    PositionMethod::MinimumDistance.solve(problem, free, guess, &SearchOptions::default())
}

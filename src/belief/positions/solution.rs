//! Result of a method's solver.

use crate::model::parameters::JointParameters;
use armcal_core::numeric::Outcome;

/// Result of a method's solver.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Parameters; those that were not estimated keep the initial guess.
    pub parameters: JointParameters,
    /// Outcome of the solver.
    pub outcome: Outcome,
    /// Number of evaluations of the objective over all starts; iterations with `bundle`.
    pub evaluations: usize,
    /// Objective at the first guess, in the method's unit: m for minimum distance, m^2 for minimum variance and least
    /// squares, rad^2 for joint limits.
    pub cost_initial: f64,
    /// Objective at the end, in the same unit.
    pub cost_final: f64,
}

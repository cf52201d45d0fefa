//! What a method's solver found.

use crate::model::parameters::JointParameters;
use armcal_core::numeric::Outcome;

/// A method's answer.
#[derive(Clone, Debug)]
pub struct Solution {
    /// What was not searched for keeps the guess.
    pub parameters: JointParameters,
    /// How the solver ended.
    pub outcome: Outcome,
    /// Of the objective, over all starts; iterations of `bundle`.
    pub evaluations: usize,
    /// The method's objective at the first guess and at the end, in its own unit: m for minimum distance, m^2 for
    /// minimum variance and least squares, rad^2 for joint limits.
    pub cost_initial: f64,
    /// See `cost_initial`.
    pub cost_final: f64,
}

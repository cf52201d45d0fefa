//! What a method's solver found.

use crate::calib::parameters::JointParameters;
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

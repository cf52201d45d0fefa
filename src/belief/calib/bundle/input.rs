//! What `bundle` estimates from.

use nalgebra::{DMatrix, DVector};

use crate::calib::bundle::model::{Hyperparameters, Model};
use crate::calib::parameters::JointParameters;
use crate::calib::views::view::View;
use armcal_core::robot::Robot;

/// What to estimate from.
#[derive(Clone)]
pub struct BundleInput<'a> {
    pub robot: &'a Robot,
    pub views: &'a [View],
    pub model: Model,
    pub scales: Hyperparameters,
    /// Where the search begins, and the reference of the terms.
    pub guess: JointParameters,
    /// Of the joints' parameters, where there is more than the datasheet: mean and information (inverse covariance).
    /// Six rows more are the camera mount's, about where `robot` has it.
    pub joint_prior: Option<(DVector<f64>, DMatrix<f64>)>,
    pub evidence: HyperparameterMode,
}

/// Whether the scales are fitted or taken as given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HyperparameterMode {
    Fitted,
    Given,
}

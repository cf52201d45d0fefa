//! What `bundle` estimates from.

use nalgebra::{DMatrix, DVector};

use crate::calib::bundle::model::{Hyperparameters, Model};
use crate::calib::parameters::JointParameters;
use crate::calib::views::view::View;
use armcal_core::robot::Robot;

/// What to estimate from.
#[derive(Clone)]
pub struct BundleInput<'a> {
    /// Nominal arm with its tags; their poses are priors.
    pub robot: &'a Robot,
    /// Fitted views.
    pub views: &'a [View],
    /// Which parameters have a column.
    pub model: Model,
    /// Standard deviations of priors and noise, at the start.
    pub scales: Hyperparameters,
    /// Where the search begins, and the reference of the terms.
    pub guess: JointParameters,
    /// Of the joints' parameters, where there is more than the datasheet: mean and information (inverse covariance).
    /// Six rows more are the camera mount's, about where `robot` has it.
    pub joint_prior: Option<(DVector<f64>, DMatrix<f64>)>,
    /// Whether those are fitted.
    pub evidence: HyperparameterMode,
}

/// Whether the scales are fitted or taken as given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HyperparameterMode {
    /// By the evidence of the data.
    Fitted,
    /// As in [`BundleInput::scales`].
    Given,
}

//! Settings of the online estimator.

use crate::follow::constants::settings::WRONG_BY;
use crate::model::blocks::Shown;
use crate::model::estimated::Model;
use crate::model::parameters::JointParameters;
use crate::model::scales::{Hyperparameters, TIME_JITTER_STD_S};
use crate::solve::model_for_views::{Scope, model_of};
use armcal_core::robot::Robot;

/// Settings of the online estimator.
#[derive(Clone, Debug)]
pub struct OnlineSettings {
    /// Parameters with a column; `None`: all that a dive may change.
    pub model: Option<Model>,
    /// Noise and prior scales, which stay fixed; `None`: they are tuned.
    pub scales: Option<Hyperparameters>,
    /// Initial guess, and the reference of the terms; `None`: the datasheet, under the first view's conditions.
    pub guess: Option<JointParameters>,
    /// Drift of sensors between views.
    pub drift: DriftModel,
    /// Search for faults if a view does not fit.
    pub faults: FaultSearch,
}

/// Search for faults if a view does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultSearch {
    /// Views that do not fit are taken in without a search.
    Off,
    /// Slips, failed sensors, moved tags and a moved camera are distinguished and reported.
    On,
}

/// Drift of sensors between views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriftModel {
    /// No drift: the estimate tends to that of the batch of all views.
    Stationary,
    /// Drift by the datasheet at first, then tuned by the views.
    Tuned,
}

impl Default for OnlineSettings {
    fn default() -> Self {
        Self { model: None, scales: None, guess: None, drift: DriftModel::Tuned, faults: FaultSearch::On }
    }
}

/// Returns the model of all parameters that a dive may change.
#[must_use]
pub fn online_model(robot: &Robot) -> Model {
    let gripper_tag = robot.gripper_tag.is_some();
    let shown = Shown { motion: true, gripper_tag, by_camera: &|camera| camera == 0 };
    model_of(robot, &Scope { warmed: true, dived: true, from_both_sides: &|_| true, shown })
}

/// Returns the datasheet's scales for a whole dive. Effects that only a dive shows may exceed the datasheet by half,
/// and images of a moving arm have their own time error.
pub(crate) fn dive_scales(robot: &Robot) -> Hyperparameters {
    let datasheet = Hyperparameters::datasheet(robot);
    Hyperparameters {
        offset_std_rad_per_k: WRONG_BY * datasheet.offset_std_rad_per_k,
        offset_std_rad_per_mpa: WRONG_BY * datasheet.offset_std_rad_per_mpa,
        time_jitter_std_s: TIME_JITTER_STD_S,
        ..datasheet
    }
}

//! What an online estimator is told beforehand.

use crate::follow::constants::settings::WRONG_BY;
use crate::model::blocks::Shown;
use crate::model::estimated::Model;
use crate::model::parameters::JointParameters;
use crate::model::scales::{Hyperparameters, TIME_JITTER_STD_S};
use crate::solve::model_for_views::{Scope, model_of};
use armcal_core::robot::Robot;

/// How an online estimator works.
#[derive(Clone, Debug)]
pub struct OnlineSettings {
    /// Which parameters have a column; `None`: all that a dive may change.
    pub model: Option<Model>,
    /// Sizes of noise and priors, if they are known; then they stay.
    pub scales: Option<Hyperparameters>,
    /// Where the search begins, and the reference of the terms; `None`: the datasheet, under the first view's
    /// conditions.
    pub guess: Option<JointParameters>,
    /// Whether sensors change between views.
    pub drift: DriftModel,
    /// Whether explanations are looked for where a view does not fit.
    pub faults: FaultSearch,
}

/// Whether explanations are looked for where a view does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultSearch {
    /// Views that do not fit are taken in as they are.
    Off,
    /// Slips, failed sensors, moved tags and a moved camera are told apart and told of.
    On,
}

/// Whether sensors change between views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriftModel {
    /// Nothing changes: the belief tends to that of the batch of all views.
    Stationary,
    /// By the datasheet at first, then by what the views say.
    Tuned,
}

impl Default for OnlineSettings {
    fn default() -> Self {
        Self { model: None, scales: None, guess: None, drift: DriftModel::Tuned, faults: FaultSearch::On }
    }
}

/// All that a dive may change.
#[must_use]
pub fn online_model(robot: &Robot) -> Model {
    let gripper_tag = robot.gripper_tag.is_some();
    let shown = Shown { motion: true, gripper_tag, by_camera: &|camera| camera == 0 };
    model_of(robot, &Scope { warmed: true, dived: true, from_both_sides: &|_| true, shown })
}

/// The datasheet's scales for a whole dive: what only a dive shows may be wrong by half, and images of a moving arm
/// have a time of their own.
pub(crate) fn dive_scales(robot: &Robot) -> Hyperparameters {
    let datasheet = Hyperparameters::datasheet(robot);
    Hyperparameters {
        offset_std_rad_per_k: WRONG_BY * datasheet.offset_std_rad_per_k,
        offset_std_rad_per_mpa: WRONG_BY * datasheet.offset_std_rad_per_mpa,
        time_jitter_std_s: TIME_JITTER_STD_S,
        ..datasheet
    }
}

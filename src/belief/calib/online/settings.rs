//! What an online estimator is told beforehand.

use crate::calib::bundle::model::{Hyperparameters, Model, shape_kinds};
use crate::calib::parameters::ParameterKind;
use armcal_core::robot::Robot;

/// How much larger an effect may be than its datasheet's figure.
const WRONG_BY: f64 = 1.5;
/// Of an image's stamp about the camera's clock, with what sensors of moving joints are late by. Assumed.
const TIME_JITTER_STD_S: f64 = 0.005;

/// How an online estimator works.
#[derive(Clone, Debug)]
pub struct OnlineSettings {
    /// Which parameters have a column; `None`: all that a dive may change.
    pub model: Option<Model>,
    /// Sizes of noise and priors, if they are known; then they stay.
    pub scales: Option<Hyperparameters>,
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
        Self { model: None, scales: None, drift: DriftModel::Tuned, faults: FaultSearch::On }
    }
}

/// All that a dive may change.
#[must_use]
pub fn online_model(robot: &Robot) -> Model {
    let gripper_joints = robot.gripper_tag.map_or(0, |tag| tag.mount.n_joints);
    let last = gripper_joints.max(robot.camera.mount.n_joints);
    let joint = |joint: usize| {
        let spec = &robot.sensors[joint];
        if joint >= last || (spec.gain_std <= 0.0 && spec.offset_std_rad <= 0.0) {
            return Vec::new();
        }
        let always = [ParameterKind::OffsetPerK, ParameterKind::GainPerK, ParameterKind::OffsetPerMpa];
        let mut kinds = vec![ParameterKind::Gain, ParameterKind::Offset];
        kinds.extend(always.into_iter().chain([ParameterKind::HalfBacklash]));
        if spec.linearity_std_rad > 0.0 {
            kinds.extend(shape_kinds());
        }
        kinds
    };
    Model {
        joints: (0..robot.n_joints()).map(joint).collect(),
        n_links: 0,
        n_compliant: 0,
        mount: robot.camera.mount_std_m > 0.0 || robot.camera.mount_std_rad > 0.0,
        lens: false,
        tags: true,
        gripper_tag: robot.gripper_tag.is_some(),
        time_offset: true,
    }
}

/// The datasheet's scales for a whole dive: what only a dive shows may be wrong by two, and images of a moving arm have
/// a time of their own.
pub(crate) fn dive_scales(robot: &Robot) -> Hyperparameters {
    let datasheet = Hyperparameters::datasheet(robot);
    Hyperparameters {
        offset_std_rad_per_k: WRONG_BY * datasheet.offset_std_rad_per_k,
        offset_std_rad_per_mpa: WRONG_BY * datasheet.offset_std_rad_per_mpa,
        time_jitter_std_s: TIME_JITTER_STD_S,
        ..datasheet
    }
}

//! Fit of mount and map only: the baseline that a calibration of joints has to beat.
//!
//! The joints stay at the datasheet; camera mount and tags are estimated about their priors from the same views. The
//! joints' errors count as an error of each view, whose scale the evidence fits. The first fit is about the datasheet's
//! gain and offset, the next ones about the fit before, until the scale settles. So the datasheet does not bias it.
//!
//! Plain least squares is the second baseline: sensors as good as their datasheets, and an isotropic error of each view
//! (or noise of the positions) for the rest. The datasheet's arm itself is the third.

pub(crate) use crate::explain::constants::baseline::N_BASELINES;
use crate::explain::constants::baseline::{MAX_PASSES, SETTLED};
use crate::explain::model_selection::CAMERA_ERROR_STD;
use crate::model::blocks::{Block, Shown};
use crate::model::estimated::Model;
use crate::model::parameters::JointParameters;
use crate::model::scales::Hyperparameters;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::model_for_views::{has_views, reference};
use crate::views::view::{TagObservation, View};
use armcal_core::robot::Robot;

/// Fit of mount and map only, with the scales of errors from all views.
pub(crate) struct Baseline {
    model: Model,
    /// Scales by the evidence, for the joints' errors.
    scales: Hyperparameters,
    /// Scales for plain least squares.
    plain: Hyperparameters,
}

impl Baseline {
    /// Fits the scales of errors to all views; `None` if the views determine nothing.
    pub(crate) fn new(robot: &Robot, views: &[View]) -> Option<Self> {
        let (mut baseline, usual) = (Self::start(robot, views), Hyperparameters::datasheet(robot));
        for _ in 0..MAX_PASSES {
            let fitted = baseline.estimate(robot, views, &baseline.scales, HyperparameterMode::Fitted)?;
            let mut next = fitted.scales().clone();
            for (std_rad, usual_rad) in next.joint_std_rad.iter_mut().zip(&usual.joint_std_rad) {
                *std_rad = std_rad.max(*usual_rad);
            }
            let mut joints = next.joint_std_rad.iter().zip(&baseline.scales.joint_std_rad).take(robot.n_joints());
            let has_settled = joints.all(|(now, before)| *now > SETTLED * before);
            baseline.scales = next;
            if has_settled {
                break;
            }
        }
        if let Some(plain) = baseline.estimate(robot, views, &baseline.plain, HyperparameterMode::Fitted) {
            baseline.plain = plain.scales().clone();
            baseline.plain.joint_std_rad = usual.joint_std_rad;
        }
        Some(baseline)
    }

    /// Baseline before any view.
    fn start(robot: &Robot, views: &[View]) -> Self {
        let shown = Shown { motion: false, gripper_tag: false, by_camera: &|camera| has_views(views, camera) };
        let blocks = Block::all(robot).filter(|block| block.is_told(robot, &shown));
        let model = Model::of_blocks(robot.n_joints(), blocks);
        let mut scales = Hyperparameters::datasheet(robot);
        let has_corners = views.iter().flat_map(|view| &view.tags).any(TagObservation::is_in_pixels);
        let camera_error_std = has_corners.then_some(CAMERA_ERROR_STD);
        let plain = Hyperparameters { camera_error_std, ..scales.clone() };
        for (std_rad, spec) in scales.joint_std_rad.iter_mut().zip(&robot.sensors) {
            *std_rad = std_rad.max(spec.offset_std_rad.hypot(spec.gain_std * spec.half_range_rad));
        }
        Self { model, scales, plain }
    }

    /// Estimates the arm from `views` under each of the baselines that determine it.
    pub(crate) fn fit(&self, robot: &Robot, views: &[View]) -> [Option<Robot>; N_BASELINES] {
        let by = |scales| Some(self.estimate(robot, views, scales, HyperparameterMode::Given)?.as_found(robot));
        [Some(robot.clone()), by(&self.plain), by(&self.scales)]
    }

    fn estimate<'a>(
        &self,
        robot: &'a Robot,
        views: &'a [View],
        scales: &Hyperparameters,
        evidence: HyperparameterMode,
    ) -> Option<Estimate<'a>> {
        estimate(&BundleInput {
            robot,
            views,
            model: self.model.clone(),
            scales: scales.clone(),
            guess: JointParameters { reference: reference(views), ..JointParameters::default() },
            joint_prior: None,
            evidence,
        })
    }
}

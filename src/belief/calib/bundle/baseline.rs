//! Mount and map alone: what a calibration of joints has to beat.
//!
//! The joints stay at the datasheet; camera mount and tags are estimated about their priors from the same views. What
//! the joints are off is an error of each view, whose size the evidence fits: first about the datasheet's own gain and
//! offset, then about what the fit before found, until that stays, so that the datasheet does not hold it up.

use crate::calib::bundle::estimate::{Estimate, estimate};
use crate::calib::bundle::input::{BundleInput, HyperparameterMode};
use crate::calib::bundle::model::{Hyperparameters, Model, further_mounts, is_loose, reference};
use crate::calib::parameters::JointParameters;
use crate::calib::views::view::View;
use armcal_core::robot::Robot;

/// Mount and map alone, with the sizes of errors that all views tell.
pub(crate) struct Baseline {
    model: Model,
    scales: Hyperparameters,
}

/// Passes over the sizes of errors; each brings exact sensors down by a factor of three.
const MAX_PASSES: usize = 8;
/// A size that stays above this share of the one before has settled.
const SETTLED: f64 = 0.8;

impl Baseline {
    /// `None` where the views determine nothing.
    pub(crate) fn new(robot: &Robot, views: &[View]) -> Option<Self> {
        let (mut baseline, usual) = (Self::start(robot, views), Hyperparameters::datasheet(robot));
        for _ in 0..MAX_PASSES {
            let mut next = baseline.estimate(robot, views, HyperparameterMode::Fitted)?.scales().clone();
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
        Some(baseline)
    }

    /// Before any view.
    fn start(robot: &Robot, views: &[View]) -> Self {
        let model = Model {
            joints: vec![Vec::new(); robot.n_joints()],
            n_links: 0,
            n_compliant: 0,
            mount: is_loose(&robot.camera),
            further_mounts: further_mounts(robot, views),
            lens: false,
            tags: true,
            gripper_tag: false,
            time_offset: false,
            walk: None,
        };
        let mut scales = Hyperparameters::datasheet(robot);
        for (std_rad, spec) in scales.joint_std_rad.iter_mut().zip(&robot.sensors) {
            *std_rad = std_rad.max(spec.offset_std_rad.hypot(spec.gain_std * spec.half_range_rad));
        }
        Self { model, scales }
    }

    /// The arm by `views`.
    pub(crate) fn fit(&self, robot: &Robot, views: &[View]) -> Option<Robot> {
        Some(self.estimate(robot, views, HyperparameterMode::Given)?.as_found(robot))
    }

    fn estimate<'a>(&self, robot: &'a Robot, views: &'a [View], evidence: HyperparameterMode) -> Option<Estimate<'a>> {
        estimate(&BundleInput {
            robot,
            views,
            model: self.model.clone(),
            scales: self.scales.clone(),
            guess: JointParameters { reference: reference(views), ..JointParameters::default() },
            joint_prior: None,
            evidence,
        })
    }
}

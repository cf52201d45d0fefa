//! Request and result of view planning.

use crate::file::calibration::Calibration;
use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::clearance::ClearanceModel;
use crate::plan::visibility::VisibilityModel;
use crate::solve::covariance::ParameterCovariance;
use armcal_core::robot::Robot;
use armcal_core::routine::CaptureSettings;
use armcal_core::streams::{CaptureSet, JointAngles};

/// Poses in the order of visits.
#[derive(Clone, Debug)]
pub struct PosePlan {
    /// Poses in the order of visits, held-out views included.
    pub poses: Vec<PlannedPose>,
    /// Predicted root mean square tool error at the targets after a fit of all poses, m, as `bundle` predicts it at the
    /// believed arm.
    pub predicted_tool_error_m: f64,
    /// Predicted root mean square tool error at the targets before any of these views, m.
    pub tool_error_before_m: f64,
    /// Number of fitted views, in this order, after which the predicted tool error is below
    /// `capture.stop_at_tool_error_m`. `None` without that limit, or if these views do not reach it.
    pub needed: Option<usize>,
    /// Arm time, s: motion from rest to rest, settling (1 s assumed) and the dwell.
    pub arm_time_s: f64,
    /// Number of candidates to choose from.
    pub candidates: usize,
    /// Number of configurations drawn to find the candidates.
    pub tried: usize,
}

/// A planned view.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedPose {
    /// Use of the view: for the fit, or held out.
    pub set: CaptureSet,
    /// Believed angles, rad.
    pub angles: JointAngles,
    /// Index of each visible tag of the survey, and the probability that the camera sees it.
    pub tags: Vec<(usize, f64)>,
    /// Predicted root mean square tool error over the task's targets once this view and those visited before it are
    /// fitted, m.
    pub predicted_tool_error_m: f64,
}

/// A captured view on which the belief is based.
#[derive(Clone, Debug, PartialEq)]
pub struct CapturedView {
    /// Believed angles, rad.
    pub angles: JointAngles,
    /// Indices of the detected tags of the survey.
    pub tags: Vec<usize>,
}

/// Inputs of view planning.
pub struct PoseRequest<'a> {
    /// Nominal arm, with the tags of the survey.
    pub robot: &'a Robot,
    /// The arm and its environment.
    pub clearance: &'a ClearanceModel<'a>,
    /// Joint errors for which the margin is kept.
    pub bounds: &'a JointErrorBounds,
    /// Conditions under which a tag counts as seen.
    pub visibility: &'a VisibilityModel,
    /// Criterion, margin, dwell and limits of the capture.
    pub capture: &'a CaptureSettings,
    /// Number of fitted views still to be chosen.
    pub n_fit: usize,
    /// Number of held-out views still to be chosen.
    pub n_held_out: usize,
    /// The interim estimate; `None`: the datasheets.
    pub belief: Option<&'a Calibration>,
    /// Fitted views of the interim estimate. They share the survey's error with the views to come, so their information
    /// is recomputed from `prior`; the interim estimate then gives only the noise. Empty: its covariance is used.
    pub taken: &'a [CapturedView],
    /// Prior of the estimate before the first of `taken`; `None`: the datasheets.
    pub prior: Option<&'a Calibration>,
    /// Present covariance of the sensors, if it differs from that of `belief` and `prior`.
    pub known: Option<&'a ParameterCovariance>,
    /// Observed over predicted number of detections of each tag of the robot; 1: as predicted.
    pub detection_rate: &'a [f64],
    /// Poses without a captured view; no pose near them is chosen again.
    pub failed: &'a [JointAngles],
    /// Joint angles of the arm at the task's targets.
    pub task: &'a [JointAngles],
    /// Tool positions of the task, base frame, m. No capture pose is near them, so that the task tests configurations
    /// that are not fitted.
    pub targets_m: &'a [[f64; 3]],
    /// Believed angles from which the first path starts.
    pub start: &'a JointAngles,
}

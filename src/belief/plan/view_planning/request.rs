//! Request and result of view planning.

use crate::file::calibration::Calibration;
use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::clearance::ClearanceModel;
use crate::plan::visibility::VisibilityModel;
use crate::solve::covariance::ParameterCovariance;
use armcal_core::robot::Robot;
use armcal_core::routine::CaptureSettings;
use armcal_core::streams::{CaptureSet, JointAngles};

/// Poses in the order of their visit.
#[derive(Clone, Debug)]
pub struct PosePlan {
    /// In the order of visits, held-out views among them.
    pub poses: Vec<PlannedPose>,
    /// Root mean square tool error at the targets, m, after a fit of all poses; that of `bundle` at the believed arm.
    pub predicted_tool_error_m: f64,
    /// The same before any of them.
    pub tool_error_before_m: f64,
    /// Fitted views, in this order, after which the tool error is predicted to be below `capture.stop_at_tool_error_m`;
    /// `None` without that limit, or where these views do not reach it.
    pub needed: Option<usize>,
    /// Time of the arm, s: motion from rest to rest, settling (1 s assumed) and the dwell.
    pub arm_time_s: f64,
    /// Number of configurations that the choice was from.
    pub candidates: usize,
    /// Number of configurations drawn to find the candidates.
    pub tried: usize,
}

/// A planned view.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedPose {
    /// Whether the fit may use it.
    pub set: CaptureSet,
    /// Believed.
    pub angles: JointAngles,
    /// Tags of the survey (index) and the probability that the camera sees them there.
    pub tags: Vec<(usize, f64)>,
    /// Root mean square over the task's targets, once this view and those visited before it are fitted.
    pub predicted_tool_error_m: f64,
}

/// A captured view that the belief rests on.
#[derive(Clone, Debug, PartialEq)]
pub struct CapturedView {
    /// Believed.
    pub angles: JointAngles,
    /// Tags of the survey (index) that were seen.
    pub tags: Vec<usize>,
}

/// Inputs of view planning.
pub struct PoseRequest<'a> {
    /// Nominal arm, with the tags of the survey.
    pub robot: &'a Robot,
    /// The arm and what is around it.
    pub clearance: &'a ClearanceModel<'a>,
    /// Joint errors for which the margin is kept.
    pub bounds: &'a JointErrorBounds,
    /// Conditions under which a tag counts as seen.
    pub visibility: &'a VisibilityModel,
    /// Criterion, margin, dwell and limits of the capture.
    pub capture: &'a CaptureSettings,
    /// Views for the fit that are still to be chosen, and for the verdict.
    pub n_fit: usize,
    /// Views for the verdict that are still to be chosen.
    pub n_held_out: usize,
    /// The interim estimate; `None`: the datasheets.
    pub belief: Option<&'a Calibration>,
    /// Fitted views of the interim estimate. They share the survey's error with the views to come, so their information
    /// is recomputed from `prior`; the interim estimate then gives only the noise. Empty: its covariance is used.
    pub taken: &'a [CapturedView],
    /// Prior of the estimate before the first of `taken`; `None`: the datasheets.
    pub prior: Option<&'a Calibration>,
    /// What is known of the sensors by now, if that is not what `belief` and `prior` say.
    pub known: Option<&'a ParameterCovariance>,
    /// Observed over predicted number of detections of each tag of the robot; 1: as predicted.
    pub detection_rate: &'a [f64],
    /// Poses without a captured view; no pose near them is chosen again.
    pub failed: &'a [JointAngles],
    /// Joint angles of the arm at the task's targets.
    pub task: &'a [JointAngles],
    /// Tool positions of the task. No capture pose is near them, so that the task tests configurations that are not
    /// fitted.
    pub targets_m: &'a [[f64; 3]],
    /// Believed angles from which the first path starts.
    pub start: &'a JointAngles,
}

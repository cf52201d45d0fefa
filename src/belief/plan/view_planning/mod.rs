//! Chooses calibration poses: visible, reachable, clear, and the most telling for the task and the arm's time.
//!
//! `candidates` draws poses that see enough tags and keep clear (`aim`: some by the camera's inverse kinematics). What is not known
//! of the arm is one covariance (`unknowns`), what a view tells of it a rank-6 update (`look`, `criterion`). `pick` takes the best,
//! `tour` orders them, `forecast` says what tool error they will leave, `stop` when that is enough. The measure of worth is the
//! predicted tool variance at the task's targets, the test-pose criterion of Klimchik et al. (2014), or another to compare with.

mod camera_ik;
mod candidates;
mod criterion;
#[cfg(test)]
mod fixture;
mod forecast;
mod parameter_prior;
mod pool;
mod selection;
mod stop_reason;
#[cfg(test)]
mod tests;
mod view_information;
mod visit_order;
use rand_chacha::ChaCha8Rng;

use crate::calib::Calibration;
use crate::plan::PlanError;
use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::clearance::ClearanceModel;
use crate::plan::visibility::VisibilityModel;
use armcal_core::robot::Robot;
use armcal_core::routine::CaptureSettings;
use armcal_core::streams::{CaptureSet, JointAngles};

pub use pool::PosePool;
pub use stop_reason::{CaptureState, StopReason};

/// Poses in the order of their visit.
#[derive(Clone, Debug)]
pub struct PosePlan {
    pub poses: Vec<PlannedPose>,
    /// Root mean square tool error at the targets, m, once all of them are fitted; that of `bundle` at the believed arm.
    pub predicted_tool_error_m: f64,
    /// The same before any of them.
    pub tool_error_before_m: f64,
    /// Fitted views, in this order, after which `capture.stop_at_tool_error_m` is predicted to be reached; `None` where it is not
    /// asked for, or these do not reach it.
    pub needed: Option<usize>,
    /// Time of the arm, s: motion from rest to rest, settling (2 s assumed) and the dwell.
    pub arm_time_s: f64,
    pub candidates: usize,
    pub tried: usize,
}

/// A view to come.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedPose {
    pub set: CaptureSet,
    /// Believed.
    pub angles: JointAngles,
    /// Tags of the survey (index) and the probability that the camera sees them there.
    pub tags: Vec<(usize, f64)>,
    /// Root mean square over the task's targets, once this view and those visited before it are fitted.
    pub predicted_tool_error_m: f64,
}

/// A view that the belief rests on already.
#[derive(Clone, Debug, PartialEq)]
pub struct CapturedView {
    /// Believed.
    pub angles: JointAngles,
    /// Tags of the survey (index) that were seen.
    pub tags: Vec<usize>,
}

/// What the choice is made for.
pub struct PoseRequest<'a> {
    pub robot: &'a Robot,
    pub clearance: &'a ClearanceModel<'a>,
    pub bounds: &'a JointErrorBounds,
    pub visibility: &'a VisibilityModel,
    pub capture: &'a CaptureSettings,
    /// Views for the fit that are still to be chosen, and for the verdict.
    pub n_fit: usize,
    pub n_held_out: usize,
    /// The running estimate; `None`: the datasheets.
    pub belief: Option<&'a Calibration>,
    /// Fitted views that the running estimate rests on. The survey's error in them is the one in those to come, so they are
    /// counted anew from what came before them; the running estimate then gives sizes of noise only. Empty: its covariance is
    /// taken as it is.
    pub taken: &'a [CapturedView],
    /// What the estimate started from before the first of `taken`; `None`: the datasheets.
    pub prior: Option<&'a Calibration>,
    /// Of each tag of the robot, by what share fewer of its predicted sightings came true than should have: 1 is as predicted.
    pub detection_rate: &'a [f64],
    /// Poses that were tried in vain: nothing near them is chosen again.
    pub failed: &'a [JointAngles],
    /// Joint angles of the arm at the task's targets.
    pub task: &'a [JointAngles],
    /// Tool positions of the task, kept free of capture poses so that the task tests what the fit has not seen.
    pub targets_m: &'a [[f64; 3]],
    pub start: &'a JointAngles,
}

/// More candidates than this gain little.
const CANDIDATES_PER_POSE: usize = 20;
const MIN_CANDIDATES: usize = 300;

/// Chooses `n_fit` views for the fit and `n_held_out` for the verdict.
///
/// # Errors
/// [`PlanError::NoUsefulPose`], [`PlanError::TooFewPoses`], [`PlanError::TooFewTags`].
pub fn choose_poses(request: &PoseRequest<'_>, rng: &mut ChaCha8Rng) -> Result<PosePlan, PlanError> {
    let wanted = request.n_fit + request.n_held_out;
    PosePool::gather(request, (wanted * CANDIDATES_PER_POSE).max(MIN_CANDIDATES), rng)?.choose(request, rng)
}

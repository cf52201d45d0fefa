//! View planning: the calibration views with the most information for the task and the arm's time.
//!
//! `candidates` draws poses that see enough tags and keep the margin, some by inverse kinematics of the camera
//! (`camera_ik`). `parameter_prior` is the covariance of the parameters; a view is a rank-6 update of it
//! (`view_information`, `criterion`). `selection` chooses views, `visit_order` orders them, `forecast` predicts the
//! tool error, `stop_reason` ends the capture. The default objective is the test-pose criterion of Klimchik et al.
//! (2014).

pub(crate) mod camera_ik;
mod candidates;
mod criterion;
#[cfg(test)]
pub(crate) mod fixture;
mod forecast;
mod parameter_prior;
mod pool;
mod request;
mod selection;
mod stop_reason;
#[cfg(test)]
mod tests;
mod view_information;
mod visit_order;

pub use pool::{PosePool, choose_poses};
pub use request::{CapturedView, PlannedPose, PosePlan, PoseRequest};
pub use stop_reason::{CaptureState, StopReason};

//! Landmarks by their positions: what methods on positions and `bundle` share.
//!
//! `position_problem` has residuals and Jacobians; `solution` is what a solver found, `unobservable` what the data
//! leave open, `mount_estimate` the camera mount by a tag on the gripper.

pub(crate) mod mount_estimate;
pub(crate) mod position_problem;
pub(crate) mod solution;
pub(crate) mod unobservable;

pub use mount_estimate::MountEstimate;
pub use position_problem::{PositionProblem, TagResidual};
pub use solution::Solution;
pub use unobservable::Unobservable;

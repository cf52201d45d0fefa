//! Positions of landmarks: the part that methods on positions and `bundle` share.
//!
//! `position_problem` has residuals and Jacobians, `solution` the result of a solver. `unobservable` lists undetermined
//! parameters, and `mount_estimate` is the camera mount from a tag on the gripper.

pub(crate) mod mount_estimate;
pub(crate) mod position_problem;
pub(crate) mod solution;
pub(crate) mod unobservable;

pub use mount_estimate::MountEstimate;
pub use position_problem::{PositionProblem, TagResidual};
pub use solution::Solution;
pub use unobservable::Unobservable;

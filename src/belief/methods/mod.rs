//! Methods other than `bundle`: positions of landmarks or end stops in, gain and offset of each joint out.
//!
//! `calibration_method` is what a method on positions has to answer; the paper's are a crate of their own above this
//! one. `calibration` makes a calibration of such an answer, with the mount by the `gripper_tag`. `joint_limits` needs
//! no camera: the nominal end stops of each joint against its readings there (`end_stops`).

pub(crate) mod calibration;
pub(crate) mod calibration_method;
pub(crate) mod constants;
pub(crate) mod end_stops;
pub(crate) mod gripper_tag;
mod joint_limits;
pub(crate) mod observability;
#[cfg(test)]
mod tests;

pub use calibration_method::{CalibrationMethod, PositionSolution, PositionSolver};
pub use gripper_tag::mount_by_gripper_tag;
pub use observability::free_parameters;

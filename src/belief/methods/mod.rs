//! Methods other than `bundle`: they estimate gain and offset of each joint from positions of landmarks or from end
//! stops.
//!
//! `calibration_method` is the interface of a method on positions; the paper's methods are a crate of their own above
//! this one. `calibration` makes a calibration of such a result, with the mount by the `gripper_tag`. `joint_limits`
//! needs no camera: it compares the nominal end stops of each joint with its readings there (`end_stops`).

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

//! Joint quantities of fixed capacity, with their unit in the type: angles are not counts.
//!
//! An array has one value per joint, base first. It lives on the stack, so that physics and residual loops do not
//! allocate. Raw readings (`JointCounts`) become angles (`JointAngles`) through a sensor model only.

mod joint_array;

pub use joint_array::{Counts, JointAngles, JointArray, JointCounts, MAX_JOINTS, Radians};

//! Forward kinematics, Jacobians and inverse kinematics of a serial chain, from the URDF's figures.
//!
//! Pure geometry: no sensors, no masses. Angles in, poses in the base frame out. Nothing here allocates; the chain
//! holds at most `MAX_JOINTS` joints. Oracle: Pinocchio (tests/oracle).

mod chain;
mod inverse;
mod link_correction;

pub use chain::{Attachment, Chain, ChainJoint, JointLimits, LinkPoses};
pub use inverse::{IkError, IkGoal, IkSettings, solve_position};
pub use link_correction::{LinkCorrection, LinkCorrections};

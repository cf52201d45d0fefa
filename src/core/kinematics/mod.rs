//! Forward kinematics, Jacobians and inverse kinematics of a serial chain, from the URDF's figures.
//!
//! No sensors; masses only where the arm bends under them (`gravity`). Input are angles, output are poses in the base
//! frame. Nothing here allocates; the chain holds at most `MAX_JOINTS` joints. Oracle: Pinocchio (tests/oracle).

mod chain;
mod gravity;
mod inverse;
mod link_correction;
mod link_poses;

pub use chain::{Chain, ChainJoint, JointKind, JointLimits};
pub use gravity::{AboutAxes, ArmLoads, LinkLoad, Sag};
pub use inverse::{IkError, IkGoal, IkSettings, solve_position};
pub use link_correction::{LinkCorrection, LinkCorrections};
pub use link_poses::{Attachment, LinkPoses};

//! Joint error bounds: the largest difference of true and believed joint angles.
//!
//! `joint_bounds`: from the datasheet, or from the covariance of an estimate (`estimate_bounds`); `ensemble`: arms
//! sampled from the belief.

pub(crate) mod ensemble;
mod estimate_bounds;
pub(crate) mod joint_bounds;

pub use ensemble::{ArmEnsemble, link_ends};
pub use joint_bounds::{Elapsed, JointErrorBounds, UnknownScale};

//! How far a joint may be from where it is believed to be.
//!
//! `joint_bounds`: by the datasheet, or by an estimate's covariance (`estimate_bounds`); `ensemble`: arms drawn from the
//! belief.

pub(crate) mod ensemble;
mod estimate_bounds;
pub(crate) mod joint_bounds;

pub use ensemble::{ArmEnsemble, link_ends};
pub use joint_bounds::{Elapsed, JointErrorBounds, UnknownScale};

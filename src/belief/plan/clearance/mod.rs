//! Clearance between the arm and its environment at one configuration.
//!
//! `model` is the arm with its environment, and `shapes` their collision shapes. `separation` is the distance of two
//! shapes. `pair` names the tested pairs, `pair_distance` the distance that each needs. `self_collision` finds the
//! pairs of links that can come near each other. `sight` finds shapes that block a line of sight.

pub(crate) mod model;
pub(crate) mod pair;
pub(crate) mod pair_distance;
mod self_collision;
pub(crate) mod separation;
pub(crate) mod shapes;
pub(crate) mod sight;

pub use model::{ClearanceModel, ClosestPair, SELF_MARGIN_REDUCTION_M};
pub use self_collision::{always_near, clear_angles, sample_self_pairs};

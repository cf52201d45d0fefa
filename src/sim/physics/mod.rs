//! The arm on its vehicle with its contacts, moved step by step by one of two engines.
//!
//! [`ArmPhysics`] hands each step to the `engine` that `[world.physics]` names: `featherstone` has our own equations of
//! motion, `rapier` the multibody of that library. Each joint is held by its oil column, an implicit spring of the
//! hydraulics. The `contact_guard` excludes contacts while all clearances are large enough.

mod arm_physics;
mod contact_guard;
mod engine;
mod featherstone;
mod pair_filter;
mod rapier;

pub(crate) use arm_physics::ArmPhysics;
pub(crate) use engine::{Drive, PhysicsInput};

#[cfg(test)]
mod tests;

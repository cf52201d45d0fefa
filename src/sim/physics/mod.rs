//! The arm on its vehicle with its contacts, moved step by step by an engine.
//!
//! [`ArmPhysics`] hands each step to an `engine`: `featherstone` has equations of motion of our own. Each joint is held
//! by its oil column, an implicit spring of the hydraulics. The `contact_guard` tells when nothing can touch.

mod arm_physics;
mod contact_guard;
mod engine;
mod featherstone;
mod pair_filter;

pub(crate) use arm_physics::ArmPhysics;
pub(crate) use engine::{Drive, PhysicsInput};

#[cfg(test)]
mod tests;

//! The arm on its vehicle with its contacts: the multibody's state, moved step by step.
//!
//! `dynamics` has the equations of motion and their integrator; rapier's collision pipeline finds the contacts. Each
//! joint is held by its oil column, an implicit spring of the hydraulics.

mod arm_physics;
mod contact_guard;
mod contacts;

pub(crate) use arm_physics::{ArmPhysics, Drive, PhysicsInput};

#[cfg(test)]
mod tests;

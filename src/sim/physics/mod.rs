//! The arm on its vehicle, and what it touches: the multibody's state, moved step by step.
//!
//! The equations of motion and their integrator are ours (`dynamics`); rapier's collision pipeline finds the contacts. Each
//! joint hangs on its oil column, which the hydraulics give as an implicit spring.

mod arm_physics;
mod contact_guard;
mod contacts;

pub(crate) use arm_physics::{ArmPhysics, Drive, PhysicsInput};

#[cfg(test)]
mod tests;

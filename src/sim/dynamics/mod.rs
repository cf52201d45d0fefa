//! Rigid-body dynamics of arm and vehicle as one system, in water.
//!
//! [`Multibody`] has the nominal masses and the water's added masses; [`Multibody::equations`] gives the joint-space
//! inertia and the bias forces of one state (composite rigid bodies and recursive Newton-Euler, Featherstone 2008,
//! chapters 5, 6 and 9), on a base that moves as prescribed or floats free. `integrate` takes the steps, linearly
//! implicit in the loads about the joints. It allocates nothing. Oracles compare it with Pinocchio.

mod base_force;
mod body;
mod carried_body;
mod equations;
mod integrate;
mod joint_load;
mod spatial;
mod system;

pub(crate) use body::WaterProperties;
pub use body::{Body, HullDrag, Surface};
pub use equations::{BaseCoupling, Environment, EquationInput, Equations, Multibody};
pub use integrate::{ContactRow, Stage, StepInput, SystemState};
pub use joint_load::JointLoad;
pub use spatial::{Force, Inertia, Motion};
pub use system::{Coordinates, MAX_DOF, Symmetric};

#[cfg(test)]
mod tests;

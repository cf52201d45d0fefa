//! Our own engine: `dynamics` has the equations of motion and their integrator of second order. Rapier's collision
//! pipeline finds the contacts, which are springs and dampers in the equations.

mod arm;
mod contacts;

pub(super) use arm::Featherstone;

//! The engine of our own: `dynamics` has the equations of motion and their integrator of second order; rapier's
//! collision pipeline finds the contacts, which are springs and dampers within the equations.

mod arm;
mod contacts;

pub(super) use arm::Featherstone;

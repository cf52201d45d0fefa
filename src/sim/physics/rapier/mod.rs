//! Rapier's multibody as an engine: reduced coordinates, links as rigid bodies, in base axes on a fixed root.
//!
//! Oil columns, stuck friction and end stops are implicit springs and dampers of its joints, apart from its iterative
//! solver, which has contacts alone to resolve. All else (gravity, water, the base's motion) comes as `link_load`s,
//! wrenches on each link, because a root that is moved gives its links no inertia. The step is of first order.

mod arm;
mod link_load;
mod setup;

pub(super) use arm::RapierArm;

//! Rapier's multibody as an engine: reduced coordinates, links as rigid bodies, in base axes on a fixed root.
//!
//! Oil columns, stuck friction and end stops are implicit springs and dampers of its joints. Its iterative solver
//! resolves only contacts. All other forces (gravity, water, the base's motion) are `link_load`s, wrenches on each
//! link, because a moving root exerts no inertial forces on its links. The step is of first order.

mod arm;
mod link_load;
mod setup;

pub(super) use arm::RapierArm;

//! Arms that speak ROS, without an installation of it: ROS 2 over DDS, and ROS 1 or 2 behind a rosbridge.
//!
//! `connection` reads arm.toml: which topics carry what, and the limits of the guard. `wire` is what a connection
//! carries, `ros2` that over DDS, `rosbridge` over WebSocket; `topics` and `messages` serve both. [`LiveArm`] is an
//! `Arm` on any wire: it paces a session by the arm's own readings and stops when `guard` says so; `nudge` has its
//! first set-points, and `tag_check` compares the tags in view with the datasheet before them. [`ImageSearch`] looks
//! for tags in a wire's images.
//! `discover` proposes an arm.toml from what a domain has.
//! [`serve`] puts any `Arm`, such as the simulated one, behind the topics of a connection.
//! `memory` ends a program that peers of its domain make grow.
//! None of this is a safety device.
#![warn(missing_docs)]

mod connection;
mod discover;
mod error;
mod guard;
mod image_search;
mod leaps;
mod live_arm;
mod memory;
mod messages;
mod nudge;
mod ros2;
mod rosbridge;
mod server;
mod tag_check;
#[cfg(test)]
mod tests;
mod topics;
mod wire;

pub use connection::{
    CommandType, Commands, Connection, Deadman, GuardLimits, Rosbridge, ServiceMapping, StopWays, arm_schema,
};
pub use discover::{Domain, ProposedConnection, Seen, SeenService, SeenTopic, propose_connection};
pub use error::LiveError;
pub use guard::StopReason;
pub use image_search::{ImageSearch, TagFinder};
pub use live_arm::{LiveArm, Survey};
pub use memory::MemoryWatch;
pub use nudge::{Nudge, NudgeProblem};
pub use ros2::{Ros2Wire, WatchedWire, look_around};
pub use rosbridge::RosbridgeWire;
pub use server::{Pace, Served, serve};
pub use tag_check::TagCheck;
pub use wire::{Heard, Wire};

/// The ROS 2 distribution that this build speaks with: it decides the layout of identifiers on the network.
pub const ROS_DISTRIBUTION: &str = "humble";

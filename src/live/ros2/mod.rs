//! ROS 2 over DDS, without ROS: `node` joins a domain, `raw` carries messages as bytes, that all are decoded and
//! checked as those of recordings are, `trigger` is the service that stops an arm, `stopper` stops it, `wire` is an arm
//! behind topics, `watched` one that is lost when the program grows, `graph` looks at what others have in the domain.

mod graph;
mod node;
mod raw;
mod stopper;
mod trigger;
mod watched;
mod wire;

pub use graph::look_around;
pub(crate) use node::{Node, Reader, Writer};
pub(crate) use trigger::{TriggerRequest, TriggerResponse, service_mapping};
pub use watched::WatchedWire;
pub use wire::Ros2Wire;

/// Largest number of messages of one topic that are taken at once; more wait for the next turn.
const MAX_TAKEN: usize = 1000;

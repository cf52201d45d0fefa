//! ROS 1 or 2 behind a rosbridge (protocol 2): JSON over WebSocket.
//!
//! `handshake` opens a WebSocket, `link` keeps it on a thread of its own, `protocol` has what is said over it, `json`
//! the spelling of messages there, `wire` is an arm behind topics. A message becomes the bytes that DDS would have
//! brought, and is read and checked as those are.

mod handshake;
mod json;
mod link;
mod protocol;
mod wire;

#[cfg(test)]
pub(crate) use handshake::accept_key;
#[cfg(test)]
pub(crate) use protocol::{Listener, Said};
pub use wire::RosbridgeWire;

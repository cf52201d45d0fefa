//! Belief: estimates and plans from messages of the arm alone.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod calib;
pub mod judge;
mod measure;
pub mod model;
pub mod plan;
pub mod say;
pub mod session;
#[cfg(test)]
mod shared;
pub mod tagmap;
pub mod verify;

//! Belief: estimates and plans from messages of the arm alone.
#![forbid(unsafe_code)]

pub mod calib;
pub mod plan;
pub mod session;
pub mod tagmap;
pub mod verify;

//! BELIEF: what an arm can tell of itself.
#![forbid(unsafe_code)]

pub mod calib;
pub mod plan;
pub mod session;
pub mod tagmap;
pub mod verify;

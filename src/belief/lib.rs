//! Estimates and plans from the messages of the arm only.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod batch;
pub mod calib;
mod checks;
mod explain;
mod file;
#[cfg(test)]
mod fixture;
mod follow;
pub mod judge;
mod measure;
mod methods;
pub mod model;
pub mod plan;
mod positions;
pub mod say;
pub mod session;
#[cfg(test)]
mod shared;
mod solve;
pub mod tagmap;
pub mod verify;
mod views;

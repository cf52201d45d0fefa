//! One run of a routine in simulation, from checked files to scored figures.
//!
//! `RunInputs` is everything read beforehand; `execute` drives the closed loop, writes the streams, scores, and leaves
//! in the output folder what `Keep` says. It has no clock of its own: seconds come from the watcher.

mod describe;
mod error;
mod execution;
mod inputs;
mod scatter;

pub use error::{Failure, RunError, Stage};
pub use execution::{Finished, Keep, execute};
pub use inputs::RunInputs;
pub use scatter::corner_scatter_px;

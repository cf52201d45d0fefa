//! One run of a routine, from checked files to figures.
//!
//! `RunInputs` holds everything that is read beforehand. `execute` drives the closed loop in simulation, writes the
//! streams, scores, and leaves the files of `Keep` in the output folder. `execute_on` does so with an arm whose truth
//! is unknown. This module has no clock: seconds come from the watcher.

mod describe;
mod error;
mod execution;
mod inputs;
mod scatter;
mod scene;
#[cfg(feature = "sim")]
mod simulated;

pub use error::{Failure, RunError, Stage};
pub use execution::{Finished, Keep, RunOutput, execute_on};
pub use inputs::RunInputs;
pub use scatter::corner_scatter_px;
#[cfg(feature = "sim")]
pub use simulated::execute;

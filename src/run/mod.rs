//! One run of a routine, from checked files to figures.
//!
//! `RunInputs` is everything read beforehand; `execute` drives the closed loop in simulation, writes the streams,
//! scores, and leaves in the output folder what `Keep` says; `execute_on` does so with an arm whose truth nobody
//! knows. There is no clock in here: seconds come from the watcher.

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

//! The library's interface: from measurements to a calibration.
//!
//! `measurements` takes recordings, or readings and tags in memory; `calibrator` holds robot, tags, task and prior, and
//! calibrates. `error` has all its errors. `shared` finds robots and routines by their names.

mod calibrator;
mod error;
pub(crate) mod measurements;
pub(crate) mod shared;

pub use calibrator::Calibrator;
pub use error::CalibrateError;
pub use measurements::{MAX_OIL_C, Measurements, PoseAtRest};
pub use shared::{robot_folder, routine_file, set_shared_folder};

//! Parts shared by simulator and estimator: arm, sensors, optics, messages, recordings, routines.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

// Linked for its symbols: they replace the sine functions of everything that is linked with this crate.
use armcal_libm as _;

pub mod codes;
pub mod document;
pub mod files;
pub mod input;
pub mod joints;
pub mod kind;
pub mod kinematics;
pub mod log;
pub mod numeric;
pub mod optics;
pub mod robot;
pub mod routine;
pub mod schema;
pub mod sensor;
pub mod spatial;
pub mod stats;
pub mod streams;
pub mod text;
pub mod time;
pub mod units;

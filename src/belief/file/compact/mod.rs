//! A calibration in one line of printable ASCII below 512 bytes, for links that carry little (an acoustic modem).
//!
//! `armcal1 ROBOT METHOD VERDICT tTIME eMEDIAN/P95 hHASH rARM JOINT.. #SUM`, see docs/reference/files.md. Corrections
//! are relative to the robot's datasheet, so that the line is valid only with the robot folder that it was made with.
//! `r` shows whether the folder at the other end has the same joints. Sensors with terms make an `armcal2`, which also
//! has a reference and, after each joint's gain and offset, its `terms` in whole steps.

mod content;
mod conversion;
mod error;
mod fields;
mod precision;
mod terms;
#[cfg(test)]
mod terms_tests;
#[cfg(test)]
mod tests;
mod text;

pub use content::{CompactCalibration, CompactJoint, PredictedToolError};
pub use error::CompactError;

//! Views from recordings of real arms, which have no marks.
//!
//! `pairing` finds the joint reading that belongs to a tag message, `clock_shift` the offset between their clocks.
//! `views` merges the detections of an arm at rest into one view. `landmarks` averages a landmark over its frames,
//! `board` a board's corners. `preparation` merges the views of all recordings by their stamps; all are fitted, and
//! cross-validated for the verdict.

mod board;
mod clock_shift;
mod landmarks;
mod pairing;
mod preparation;
mod views;

pub use landmarks::PlainLandmark;
pub use preparation::{ExternalContext, prepare_external};

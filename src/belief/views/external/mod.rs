//! Views from recordings of real arms, which mark nothing.
//!
//! `pairing` finds the joint reading that belongs to a tag message; `views` merges what was seen while the arm stood
//! still into one view; `landmarks` averages a landmark over its frames, `board` a board's corners. Here the views of
//! all recordings come together, by their stamps; all are fitted, and held out in turn for the verdict.

mod board;
mod landmarks;
mod pairing;
mod preparation;
mod views;

pub use landmarks::PlainLandmark;
pub use preparation::{ExternalContext, prepare_external};

//! Truth against belief: the only place that opens truth.mcap, after belief has finished.
//!
//! At each reach mark the tool as believed (from the recording, under the sensors of that moment) is compared with
//! the tool as it was, and the target with where the tool came to rest.

mod margins;
mod scoring;
mod touch;

pub use scoring::{ScoreInput, Scored, score};

//! Truth against belief: the only place that opens truth.mcap, after belief has finished.
//!
//! At each reach mark the tool as believed (from the recording, under the sensors of that moment) is compared with the
//! tool as it was, and the target with where the tool came to rest. `figures` is what comes out of it, for programs.

mod figures;
#[cfg(feature = "sim")]
mod margins;
#[cfg(feature = "sim")]
mod scoring;
#[cfg(feature = "sim")]
mod touch;

pub use figures::{JointScore, MarginSummary, ReachScore, Score, ScoreSide, TargetScore, TaskScore, TouchScore};
#[cfg(feature = "sim")]
pub use scoring::{ScoreInput, Scored, score};

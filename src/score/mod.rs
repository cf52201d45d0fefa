//! Comparison of estimates with the truth: the only place that opens truth.mcap, after the estimation has finished.
//!
//! At each reach mark the estimated tool is compared with the true tool, and the target with the resting tool. The
//! estimate comes from the recording, with the sensors of that moment. `figures` holds the results for programs.

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

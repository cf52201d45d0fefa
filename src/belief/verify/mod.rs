//! Verification of reaches as far as the arm itself can know.
//!
//! `reach_rest` gives the believed tool position at each target. `score` compares it with the truth, which is unknown
//! here.

mod reach_rest;

pub use reach_rest::{Belief, ReachRest, reaches};

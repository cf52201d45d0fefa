//! A session without a watching caller.

use crate::session::Progress;
use armcal_core::streams::Phase;

/// Shows nothing, never stops a run, approves every motion, and has no clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Progress for Unwatched {
    fn update(&mut self, _: Phase, _: usize, _: usize, _: f64) {}

    fn wall_s(&self) -> f64 {
        0.0
    }
}

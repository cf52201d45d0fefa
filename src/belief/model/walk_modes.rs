//! Modes of a random walk of an offset, counted back from the last view.
//!
//! Let u = 0 at the last view and u = 1 at the first. A walk of standard deviation s over all views then has the modes
//! `phi_k(u) = sin((k - 1/2) pi u)`. Their variances are `2 s^2 / ((k - 1/2) pi)^2` (Karhunen and Loeve; Ghanem and
//! Spanos 1991, 2.3). Each is zero at the last view, so that the estimated offset is that of the sensor at the last
//! view.

pub(crate) use crate::model::constants::walk_modes::N_WALK_MODES;
use std::f64::consts::PI;

use armcal_core::time::Stamp;

/// Returns the standard deviation of mode `k` (from 0) of a walk of unit standard deviation.
pub(crate) fn mode_std(k: u8) -> f64 {
    2.0_f64.sqrt() / ((f64::from(k) + 0.5) * PI)
}

/// Returns mode `k` (from 0) in a view that ends at `end`; before the span its value at the first view, after it zero.
pub(crate) fn mode(k: u8, span: [Stamp; 2], end: Stamp) -> f64 {
    let [first, last] = span;
    let back = (last.since_s(end) / last.since_s(first)).clamp(0.0, 1.0);
    ((f64::from(k) + 0.5) * PI * back).sin()
}

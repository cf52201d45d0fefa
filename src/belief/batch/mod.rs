//! A calibration from a recording, as a whole.
//!
//! `marked_calibrations` works through the calibrations that a recording marks; `rounds` is the default method:
//! estimate, explanations, checks, in rounds; `tables` writes what it found. `interim` estimates during a capture.
//! `slips_in_views` holds a calibration by positions against the slips that `bundle` finds.

pub(crate) mod constants;
pub(crate) mod failure_impact;
pub(crate) mod interim;
pub(crate) mod marked_calibrations;
pub(crate) mod rounds;
pub(crate) mod slips_in_views;
pub(crate) mod slips_since;
pub(crate) mod tables;

#[cfg(test)]
pub(crate) mod tests;

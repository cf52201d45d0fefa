//! A complete calibration from a recording.
//!
//! `marked_calibrations` runs the calibrations that a recording marks. `rounds` is the default method: estimate,
//! explanations, checks, in rounds; `tables` writes its results. `interim` estimates during a capture. `slips_in_views`
//! compares a calibration by positions with the slips that `bundle` finds.

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

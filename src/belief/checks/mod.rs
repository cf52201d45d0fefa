//! Checks of one calibration: whether joint sensors explain the views, and how accurate the result is.
//!
//! `consistency` holds all checks of an estimate. `innovations` and `cross_validation` test views that the fit did not
//! use. `observability` and `reservations` cover parameters that the views do not determine. `refusal_conditions` and
//! the decision rule come last, in `assemble`, which fills calibration.toml.

pub(crate) mod assemble;
pub(crate) mod block_measurements;
pub(crate) mod consistency;
pub(crate) mod constants;
pub(crate) mod cross_validation;
pub(crate) mod drawing_report;
pub(crate) mod held_by_prior;
pub(crate) mod innovations;
pub(crate) mod marginal;
pub(crate) mod noise_checks;
pub(crate) mod observability;
pub(crate) mod refusal_conditions;
pub(crate) mod reservations;
pub(crate) mod stated_error;
pub(crate) mod touch_term;

//! May the result be used for its task?
//!
//! `coverage` says how far the tool may be off with a stated probability, `decision` holds that against the task's
//! tolerance, target by target. One covariance gives both figures. `baseline_comparison` tests whether held-out views
//! fit better than without joints.

pub(crate) mod baseline_comparison;
pub(crate) mod constants;
pub(crate) mod coverage;
pub(crate) mod decision;

pub use coverage::{COVERAGE, ErrorDistribution};
pub(crate) use decision::TargetError;
pub use decision::{MAX_RISK, RULE, TargetU95, U95Table};

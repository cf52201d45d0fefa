//! Decision whether the result may be used for its task.
//!
//! `coverage` computes the radius that contains the tool's error with a stated probability. `decision` compares that
//! with the task's tolerance at each target. Both results come from one covariance. `baseline_comparison` tests whether
//! held-out views fit better than without calibrated joints.

pub(crate) mod baseline_comparison;
pub(crate) mod constants;
pub(crate) mod coverage;
pub(crate) mod decision;

pub use coverage::{COVERAGE, ErrorDistribution};
pub(crate) use decision::TargetError;
pub use decision::{MAX_RISK, RULE, TargetU95, U95Table};

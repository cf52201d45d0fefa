//! May the result be used for its task?
//!
//! `coverage` says how far the tool may be off with a stated probability, `decision` holds that against the task's
//! tolerance, target by target. One covariance gives both figures. `finding` is what was found to be other than stated.

mod coverage;
mod decision;
mod finding;

pub use coverage::{COVERAGE, ErrorDistribution};
pub(crate) use decision::TargetError;
pub use decision::{MAX_RISK, RULE, TargetU95, U95Table};
pub use finding::{Finding, FindingKind, FindingUnit};

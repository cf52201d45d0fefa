//! BUNDLE: maximum a posteriori over everything that the measurements depend on.
//!
//! `model` says what has a column, `problem` puts views and priors into form, `linearize` sums the normal equations,
//! `solve` is Levenberg-Marquardt, `evidence` fits sizes, `drawing` and `failure_detection` explain what does not fit.

pub(crate) mod baseline;
mod body_columns;
mod body_twists;
pub(crate) mod calibration;
pub(crate) mod calibration_prior;
mod drawing;
mod drawing_report;
pub(crate) mod estimate;
pub(crate) mod evidence;
mod failure_detection;
mod failure_impact;
mod failure_pattern;
mod failures;
mod innovations;
pub(crate) mod input;
pub(crate) mod linearize;
mod marginal;
pub(crate) mod model;
mod model_selection;
mod noise_checks;
mod observability;
pub(crate) mod outliers;
mod permutation_test;
mod prior_terms;
pub(crate) mod problem;
mod reading_search;
mod reservations;
mod robust_start;
pub(crate) mod schur;
mod score_test;
mod setup;
mod slips;
pub(crate) mod slips_since;
pub(crate) mod solve;
mod stated_error;
mod step_test;
mod tables;
mod tags;
pub(crate) mod time_error;
mod touch_term;
mod verdict;
mod walk;

pub use calibration_prior::{CalibrationPrior, MOUNT_ROWS, PriorConsistency, with_mount_rows};
pub use estimate::{Estimate, LeastSquares, estimate, least_squares};
pub use failures::{Failure, FailureAdjusted, FailureSource, SensorLine, SensorUse};
pub use innovations::{Innovations, JointInnovation};
pub use input::{BundleInput, HyperparameterMode};
pub use model::{MIN_GRIPPER_VIEWS, model_for, reference};
pub use model_selection::{OptionalTerm, Selection, select_model};
pub use observability::{Observability, observability};
pub use outliers::Outlier;
pub use score_test::{GeometryElement, ScoreTestResult};

#[cfg(test)]
pub(crate) mod tests;

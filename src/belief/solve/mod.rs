//! The estimate: maximum a posteriori over everything that the measurements depend on.
//!
//! `input` is the input of a solution, `model_for_views` chooses the columns, and `problem` prepares views and priors.
//! `linearize` sums the normal equations (views marginalised: `schur`), `levenberg_marquardt` solves them. `estimate`
//! runs everything, with outliers and the scales that `evidence` fits; `covariance` gives the effect on the tool at the
//! task's targets (`task_angles`).

pub(crate) mod body_columns;
pub(crate) mod body_motion;
pub(crate) mod body_twists;
pub(crate) mod constants;
pub(crate) mod covariance;
pub(crate) mod details;
pub(crate) mod estimate;
pub(crate) mod evidence;
pub(crate) mod input;
pub(crate) mod levenberg_marquardt;
pub(crate) mod linearize;
pub(crate) mod model_for_views;
pub(crate) mod outliers;
pub(crate) mod prior_terms;
pub(crate) mod problem;
pub(crate) mod robust_start;
pub(crate) mod schur;
pub(crate) mod task_angles;
pub(crate) mod time_error;
pub(crate) mod tool_error;

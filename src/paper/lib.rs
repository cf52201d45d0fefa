//! The methods that the paper names: they estimate gain and offset of each joint from positions of landmarks.
//!
//! `minimum_distance` and `minimum_variance` are the paper's equations; `search` minimizes both by BOBYQA in a box,
//! from one start or several. `least_squares` is the reference for Gaussian noise. Their interface is
//! [`PositionMethod::solve`]; [`calibration_method`] gives them to the estimator. `study` repeats the paper's study.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod calibration_method;
mod constants;
mod least_squares;
mod minimum_distance;
mod minimum_variance;
mod position_method;
mod search;
#[cfg(feature = "study")]
#[doc(hidden)]
pub mod study;
#[cfg(test)]
mod tests;

pub use calibration_method::calibration_method;
pub use least_squares::{fisher_information, least_squares};
pub use minimum_distance::minimum_distance;
pub use minimum_variance::{Gauge, determined_by_variance};
pub use position_method::PositionMethod;
pub use search::{Interpolation, PositionSearch, Scaling, SearchOptions};

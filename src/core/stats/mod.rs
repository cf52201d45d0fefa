//! Statistics shared by simulator and estimator.
//!
//! Named random streams: the seed is a hash of master seed and name, so that adding a sensor does not shift the others.
//! Summaries of samples for reports, the bootstrap's interval of a median, the confidence sequence of a rate, and
//! Wilcoxon's interval of the shift of pairs.

mod bootstrap;
mod chi_square;
mod rate_sequence;
mod rng;
mod signed_rank;
mod student;
mod summary;

pub use bootstrap::{Interval, median_interval};
pub use chi_square::{chi_square_above, chi_square_quantile};
pub use rate_sequence::RateSequence;
pub use rng::stream_rng;
pub use signed_rank::{Location, signed_rank_location};
pub use student::StudentT;
pub use summary::{Summary, quantile};

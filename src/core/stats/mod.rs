//! Statistics shared by truth and belief.
//!
//! Named random streams (seed = hash of master seed and name, so that adding a sensor does not shift the others) and
//! the summaries of samples that reports use, with the bootstrap's interval of a median, that of a
//! rate that is looked at again and again, and Wilcoxon's of how far pairs moved.

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

//! Statistics shared by truth and belief.
//!
//! Named random streams (seed = hash of master seed and name, so that adding a sensor does not shift the others) and
//! the summaries of samples that reports use, with the bootstrap's interval of a median.

mod bootstrap;
mod rng;
mod summary;

pub use bootstrap::{Interval, median_interval};
pub use rng::stream_rng;
pub use summary::{Summary, quantile};

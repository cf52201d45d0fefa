//! How the arm moves between two configurations: the line, its duration, and what the joints leave it by.

pub(crate) mod edge;
pub(crate) mod timing;
pub(crate) mod tracking_error;

pub use edge::{Edge, Path};
pub use timing::Timing;
pub use tracking_error::TrackingErrorBound;

//! Motion between two configurations: the straight line, its duration, and the tracking error of the joints.

pub(crate) mod edge;
pub(crate) mod timing;
pub(crate) mod tracking_error;

pub use edge::{Edge, Path};
pub use timing::Timing;
pub use tracking_error::TrackingErrorBound;

//! Measurements: one file per kind, each with its information on the camera's pose.
//!
//! `corners` of a tag, points of a `board`, a tag's `position` or `pose`; `observation` is any of them, `information`
//! its linearization in the camera's twist. `projection` is the only place that linearizes a projection.
//! `block_measurement` has measurements between blocks.

mod block_measurement;
mod board;
pub(crate) mod constants;
mod corners;
mod information;
mod observation;
mod pose;
mod position;
mod projection;

pub(crate) use block_measurement::BlockMeasurement;
pub(crate) use board::WeightedPoint;
pub(crate) use corners::WeightedCorners;
pub(crate) use information::{LensInformation, PoseInformation, TwistSums};
pub(crate) use observation::{ObservationTerm, WeightedMeasurement};
pub(crate) use pose::right_jacobian_inverse;
pub(crate) use projection::ImagePoint;

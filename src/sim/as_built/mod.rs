//! The arm, its sensors and its tags as built: random errors drawn once per seed.
//!
//! Each file draws the errors of one part, e.g. `potentiometer` or `lens`; `values` joins them.
//! Each effect has a random stream of its own: an added effect does not change the others. Only the score reads the
//! values.

mod attitude;
mod camera_mount;
mod dome_port;
mod draw_joint;
mod encoder;
mod gauges;
mod geometry;
mod joint;
mod lens;
mod normal;
mod pose;
mod potentiometer;
mod resolver;
mod tags;
mod values;

pub use attitude::AttitudeAsBuilt;
pub use gauges::GaugesAsBuilt;
pub use geometry::{GeometryAsBuilt, PlaceError};
pub use joint::{Harmonic, JointAsBuilt, ResolverAsBuilt, WornSpot};
pub use lens::LensAsBuilt;
pub use pose::PlainPose;
pub use tags::TagAsBuilt;
pub use values::AsBuilt;

#[cfg(test)]
mod tests;

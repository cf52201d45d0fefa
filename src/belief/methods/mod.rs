//! The methods that the paper names, on one interface: positions of landmarks in, gain and offset of each joint out.
//!
//! `minimum_distance` and `minimum_variance` are the paper's equations, `search` how both are minimized: BOBYQA in a
//! box, from one start or several. `least_squares` is the reference that Gaussian noise asks for. `joint_limits` needs
//! no camera: the nominal end stops of each joint against its readings there. The interface is
//! [`PositionMethod::solve`].

pub(crate) mod calibration;
pub(crate) mod constants;
pub(crate) mod end_stops;
pub(crate) mod gripper_tag;
mod joint_limits;
mod least_squares;
mod minimum_distance;
mod minimum_variance;
pub(crate) mod observability;
mod position_method;
mod search;
#[cfg(test)]
mod tests;

pub use gripper_tag::mount_by_gripper_tag;
pub use least_squares::{fisher_information, least_squares};
pub use minimum_distance::minimum_distance;
pub use minimum_variance::{Gauge, determined_by_variance};
pub use observability::free_parameters;
pub use position_method::PositionMethod;
pub use search::{Interpolation, PositionSearch, Scaling, SearchOptions};

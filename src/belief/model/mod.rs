//! The estimated quantities: parameters of the joints, blocks in addition to them, and the priors of both.
//!
//! `parameters` are those of a joint's sensor, its link and the arm's compliance; `blocks` are other groups (mounts,
//! lenses, clock, tags). `estimated` says which have columns, `layout` where these are, and `state` holds the values.
//! `prior` has the prior information, `scales` the standard deviations that the data may correct, and
//! `shared_survey_error` the error that the tags of a map share.

pub(crate) mod blocks;
pub(crate) mod constants;
pub(crate) mod estimated;
pub(crate) mod layout;
pub(crate) mod parameters;
pub(crate) mod prior;
pub(crate) mod scales;
pub(crate) mod shared_survey_error;
pub(crate) mod state;
pub(crate) mod walk_modes;

pub use blocks::Block;
pub use estimated::{Model, Walk};
pub use parameters::{JointParameters, Parameter, ParameterKind, WornSpot};
pub use prior::JointPrior;
pub use scales::{Hyperparameters, MAX_CAMERAS, SHAPE_LENGTH};

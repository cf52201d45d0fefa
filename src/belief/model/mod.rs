//! The estimated quantities: parameters of the joints, blocks next to them, and the priors of both.
//!
//! `parameters` are those of a joint's sensor, its link and how the arm bends; `blocks` what else moves together
//! (mounts, lenses, clock, tags). `estimated` says which have columns, `layout` where these are, `state` holds the
//! values, `prior` what is known before, `scales` the sizes that the data may tell, `shared_survey_error` what the tags
//! of a map have in common.

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

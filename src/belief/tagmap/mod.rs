//! BELIEF: where the tags are, from camera views alone.
//!
//! `screen` rejects what cannot be a detection and solves every square both ways; `start` votes relative poses of tags and
//! builds each connected group up from them; `problem`, `sparse` and `adjust` are the bundle adjustment on corner pixels
//! (Triggs et al. 2000); `result` says how good the map is; `scale` finds sizes that are off. `files` reads and writes the
//! formats of TagSLAM and Kalibr and our own, `recording` gets views from recordings. No joint angle enters anywhere.

mod adjust;
mod assemble;
mod attitude;
mod check;
mod groups;
mod incremental_layout;
mod initial_guess;
mod linearize;
mod localize;
mod problem;
mod result;
mod scale;
mod screen;
mod solve;
mod sparse;
mod types;
mod vote;

pub mod files;
pub mod recording;

pub use result::{GroupFrame, MapGroup, MappedTag, RelativeBodyPose, TagMap};
pub use scale::ScaleWarning;
pub use solve::solve;
pub use types::{
    Body, MapDetection, MapInput, MapMode, MapRejection, MapSettings, MapView, NoiseScale, RejectedDetection,
    TagMapError, TagPrior,
};

#[cfg(test)]
mod tests;

//! Tag mapping: poses of tags from camera views only; no joint angle is used.
//!
//! `screen` validates detections and solves each square; `vote`, `initial_guess` and `incremental_layout` lay out
//! groups of tags. `linearize`, `normal_equations`, `sparse` and `adjust` are the bundle adjustment on corner pixels
//! (Triggs et al. 2000). `result` is the map with its accuracy; `scale` finds wrong tag sizes. `checked` returns a map
//! if the views do not contradict its files. For that, `known_places` tries other readings, and `lens_test` and
//! `lens_fit` search for another lens. `odd_tags` searches for wrong sizes and moves, with `columns` of a map without
//! known places (`blind`). `lost_anchor` and `contradictions` find parts that cannot be one map. `tag_mapping` maps the
//! tags of a calibration; `files` reads and writes files of tags and cameras, `recording` reads views from recordings.

mod adjust;
mod assemble;
mod attitude;
mod blind;
mod check;
mod checked;
mod columns;
pub(crate) mod constants;
mod contradictions;
mod groups;
mod incremental_layout;
mod initial_guess;
mod known_places;
mod lens_fit;
mod lens_test;
mod linearize;
mod localize;
mod lost_anchor;
mod normal_equations;
mod odd_tags;
mod problem;
mod result;
mod scale;
mod screen;
mod solve;
mod sparse;
pub(crate) mod tag_mapping;
mod tag_pairs;
mod types;
mod vote;

pub mod files;
pub mod recording;

pub use checked::checked_map;
pub use result::{GroupFrame, MapGroup, MappedTag, RelativeBodyPose, TagMap};
pub use scale::ScaleWarning;
pub use solve::solve;
pub use types::{
    Body, MapDetection, MapInput, MapMode, MapRejection, MapSettings, MapView, NoiseScale, RejectedDetection,
    TagMapError, TagPrior,
};

#[cfg(test)]
mod tests;

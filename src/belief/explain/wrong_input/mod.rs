//! A file that the images contradict: how the tags stand to one another is seen without the arm.
//!
//! `pairs` measures by how much the tags of one view differ from the map; a large mismatch means that map or lens is
//! wrong, and no joint has a part in it. `recording`, `map` and `lens` have other readings of their file; `by_pairs`
//! names the one that makes the mismatch small. `recording` looks at pixels, and at rotations of a single landmark;
//! `positions` at positions without rotations.

pub(crate) mod by_pairs;
pub(crate) mod lens;
pub(crate) mod map;
pub(crate) mod pairs;
pub(crate) mod positions;
pub(crate) mod recording;

use crate::explain::constants::wrong_input::{BETTER, GOOD, MAX_VIEWS, SIZE_TOLERANCE};
use crate::say::wrong_input::{MismatchMeasure, WrongInput};

use crate::views::view::{CaptureData, View};
use armcal_core::robot::{Robot, SurveyedTag};
use by_pairs::{by_distances, by_pairs};
use pairs::mismatch;

/// The input that explains why the views do not fit; `tags` as the map has them.
pub(crate) fn wrong_input(data: &CaptureData, tags: &[SurveyedTag], robot: &Robot) -> Option<WrongInput> {
    let of_first = data.fit.iter().chain(&data.held_out).filter(|view| view.camera == 0);
    let views: Vec<&View> = of_first.take(MAX_VIEWS).collect();
    if let Some(input) = recording::beside_image(robot.camera.lens.resolution_px(), data) {
        let measure = MismatchMeasure::Distances;
        return Some(WrongInput { input, measure, mismatch: 1.0, mismatch_otherwise: None, size_hint: None });
    }
    match mismatch(&views, tags, &robot.camera.lens) {
        Some(pairs) => by_pairs(&views, tags, robot, &pairs),
        None => recording::by_rotations(&views, robot)
            .or_else(|| positions::by_positions(&views, tags, robot))
            .or_else(|| by_distances(&views, tags, robot)),
    }
}

#[cfg(test)]
mod tests;

//! Input files that the images contradict: the images show the tags' relative poses without the arm.
//!
//! `pairs` measures how much the tags of one view differ from the map. A large mismatch means that map or lens is
//! wrong, regardless of the joints. `recording`, `map` and `lens` have other readings of their file; `by_pairs` names
//! the one with a small mismatch. `recording` also tests pixels, and rotations of a single landmark; `positions` tests
//! positions without rotations.

pub(crate) mod by_pairs;
pub(crate) mod lens;
pub(crate) mod map;
pub(crate) mod pairs;
pub(crate) mod positions;
pub(crate) mod recording;

pub(crate) use crate::explain::constants::wrong_input::GOOD;
use crate::explain::constants::wrong_input::{BETTER, MAX_VIEWS, SIZE_TOLERANCE};
use crate::say::wrong_input::{MismatchMeasure, WrongInput};

use crate::views::view::{CaptureData, View};
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_core::robot::{Robot, SurveyedTag};
use by_pairs::{by_distances, by_pairs};
use pairs::mismatch;

/// Wrong input that explains why the views do not fit; `tags`: as in the map.
pub(crate) fn wrong_input(data: &CaptureData, tags: &[SurveyedTag], robot: &Robot) -> Option<WrongInput> {
    let of_first = data.fit.iter().chain(&data.held_out).filter(|view| view.camera == 0);
    let views: Vec<&View> = of_first.take(MAX_VIEWS).collect();
    let camera = StatedCamera { lens: &robot.camera.lens, tag_family: robot.tag_family };
    if let Some(beside) = beside_image(camera.lens, data) {
        return Some(beside);
    }
    match mismatch(&views, tags, camera.lens) {
        Some(pairs) => by_pairs(&views, tags, camera, &pairs),
        None => recording::by_rotations(&views, robot)
            .or_else(|| positions::by_positions(&views, tags, robot))
            .or_else(|| by_distances(&views, tags, robot.tag_family)),
    }
}

/// Stated values of a camera and its scene.
#[derive(Clone, Copy)]
pub(crate) struct StatedCamera<'a> {
    pub lens: &'a CameraModel,
    pub tag_family: TagFamily,
}

/// Wrong input without an arm, for views of one camera; `data` has its corners.
pub(crate) fn wrong_input_of_camera(
    data: &CaptureData,
    tags: &[SurveyedTag],
    camera: StatedCamera<'_>,
) -> Option<WrongInput> {
    let views: Vec<&View> = data.fit.iter().take(MAX_VIEWS).collect();
    let by_pairs = || by_pairs(&views, tags, camera, &mismatch(&views, tags, camera.lens)?);
    beside_image(camera.lens, data).or_else(by_pairs)
}

fn beside_image(lens: &CameraModel, data: &CaptureData) -> Option<WrongInput> {
    let input = recording::beside_image(lens.resolution_px(), data)?;
    let measure = MismatchMeasure::Distances;
    Some(WrongInput { input, measure, mismatch: 1.0, mismatch_otherwise: None, size_hint: None })
}

#[cfg(test)]
mod tests;

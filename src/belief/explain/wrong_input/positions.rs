//! Test for recorded positions without rotations that are those of the camera in the tag's frame.
//!
//! With the map's rotation of a tag such a position gives the camera's position, and all tags of a view must agree on
//! it. The arm by its datasheet gives the camera's position in two cases: a view has one tag, or its tags are turned
//! alike, so that their distances fit both ways.

use nalgebra::{Point3, Vector3};

use super::pairs::distances;
use super::{BETTER, GOOD};
use crate::explain::constants::wrong_input_by_pairs::BAD;
use crate::explain::constants::wrong_input_positions::{MIN_POSITIONS, NEAR_ARM};
use crate::say::wrong_input::{MismatchMeasure, WrongInput, WrongInputKind};
use crate::views::view::{TagMeasurement, TagObservation, View};
use armcal_core::joints::JointAngles;
use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::stats::quantile;

/// Recorded position, its tag's position in the map, and the camera's position if the recorded one is that of the
/// camera in the tag's frame.
struct Positioned {
    in_camera_m: Vector3<f64>,
    tag_m: Vector3<f64>,
    camera_m: Vector3<f64>,
}

/// Wrong direction of positions, by the tags of each view or by the arm.
pub(crate) fn by_positions(views: &[&View], tags: &[SurveyedTag], robot: &Robot) -> Option<WrongInput> {
    let of_view = |view: &&View| view.tags.iter().filter_map(|seen| positioned(seen, tags)).collect::<Vec<_>>();
    let positions: Vec<Vec<Positioned>> = views.iter().map(of_view).collect();
    let by_tags = distances(views, tags).and_then(|pairs| {
        let as_written = pairs.mismatch.max((pairs.ratio - 1.0).abs());
        wrong_direction(MismatchMeasure::Distances, [as_written, disagreement(&positions)?], GOOD)
    });
    by_tags.or_else(|| wrong_direction(MismatchMeasure::Positions, off_the_arm(views, &positions, robot)?, NEAR_ARM))
}

/// Wrong direction if the inverse positions fit and the written ones do not. `good`: mismatch below which they fit.
fn wrong_direction(measure: MismatchMeasure, [as_written, inverse]: [f64; 2], good: f64) -> Option<WrongInput> {
    let is_inverse = as_written > BAD && inverse < good.min(BETTER * as_written);
    let input = WrongInputKind::RecordedDirection;
    let (mismatch, mismatch_otherwise) = (as_written, Some(inverse));
    is_inverse.then_some(WrongInput { input, measure, mismatch, mismatch_otherwise, size_hint: None })
}

fn positioned(seen: &TagObservation, tags: &[SurveyedTag]) -> Option<Positioned> {
    let tag = tags.get(seen.tag_idx).filter(|tag| tag.is_known())?;
    let is_position = matches!(seen.measured, TagMeasurement::Position);
    let base_from_tag = tag.base_from_tag.isometry();
    let camera_m = (base_from_tag * Point3::from(seen.center_in_camera_m)).coords;
    let tag_m = base_from_tag.translation.vector;
    is_position.then_some(Positioned { in_camera_m: seen.center_in_camera_m, tag_m, camera_m })
}

/// Median distance between the camera positions by two tags of a view, over the tags' distance.
fn disagreement(positions: &[Vec<Positioned>]) -> Option<f64> {
    let mut all = Vec::new();
    for of_view in positions {
        for (n, a) in of_view.iter().enumerate() {
            let off = |b: &Positioned| (a.camera_m - b.camera_m).norm() / (a.tag_m - b.tag_m).norm();
            all.extend(of_view[n + 1..].iter().map(off).filter(|off| off.is_finite()));
        }
    }
    quantile(&all, 0.5)
}

/// Median errors against the datasheet's arm, over the distance between camera and tag: of the tag as written, and of
/// the camera if the positions are inverse.
fn off_the_arm(views: &[&View], positions: &[Vec<Positioned>], robot: &Robot) -> Option<[f64; 2]> {
    let mut all = [Vec::new(), Vec::new()];
    for (view, of_view) in views.iter().zip(positions) {
        let angle_rad = |joint: usize| robot.sensors[joint].center_rad + view.travel_rad[joint];
        let camera = robot.tags_from_camera(&JointAngles::from_fn(view.travel_rad.len(), angle_rad));
        for seen in of_view {
            let distance_m = seen.in_camera_m.norm();
            let tag_off_m = ((camera * Point3::from(seen.in_camera_m)).coords - seen.tag_m).norm();
            let camera_off_m = (camera.translation.vector - seen.camera_m).norm();
            all[0].push(tag_off_m / distance_m);
            all[1].push(camera_off_m / distance_m);
        }
    }
    if all[0].len() < MIN_POSITIONS {
        return None;
    }
    Some([quantile(&all[0], 0.5)?, quantile(&all[1], 0.5)?])
}

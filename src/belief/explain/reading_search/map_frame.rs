//! Tag map in another frame than the arm's base: one rigid motion of all tags.
//!
//! The nominal arm gives the base frame position of each view's tags. Weighted least squares finds the motion that
//! takes these positions to the map's (Arun 1987), with weights of a Cauchy loss. It is as accurate as the datasheet:
//! several centimetres. The rest goes to the pose of the first joint, which gets columns with a wide prior.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Vector3};

use crate::explain::constants::reading_search_map_frame::{FRAME_STD, LEAST_M, LEAST_RAD, ROUNDS, WIDTH_M};
use crate::solve::estimate::Estimate;
use crate::solve::input::BundleInput;
use crate::views::view::View;
use armcal_core::joints::JointAngles;
use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::spatial::Pose;

/// Position of a tag by the arm, base frame, and by the map, its own frame.
type Places = (Vector3<f64>, Vector3<f64>);

/// Returns the arm and its views with the tags as the map has them, without later findings on tags.
pub(crate) fn as_given(robot: &Robot, map: &[SurveyedTag], views: &[View]) -> (Robot, Vec<View>) {
    let mut views = views.to_vec();
    for seen in views.iter_mut().flat_map(|view| &mut view.tags).filter(|seen| seen.corners().is_some()) {
        seen.center_in_camera_m *= map[seen.tag_idx].size_m / robot.tags[seen.tag_idx].size_m;
    }
    (Robot { tags: map.to_vec(), ..robot.clone() }, views)
}

/// Returns the arm with the map's tags in its base frame.
pub(crate) fn in_base(robot: &Robot, map_from_base: &Isometry3<f64>) -> Robot {
    let mut robot = robot.clone();
    for tag in &mut robot.tags {
        tag.base_from_tag = Pose::from_isometry(map_from_base.inv_mul(tag.base_from_tag.isometry()));
    }
    robot
}

/// Pose of the base in the map's frame, by the nominal arm; `None` if the views show too few tags.
pub(crate) fn map_from_base(robot: &Robot, views: &[View]) -> Option<Isometry3<f64>> {
    let places: Vec<Places> = views.iter().flat_map(|view| places(robot, view)).collect();
    let mut weights = vec![1.0; places.len()];
    let mut found = aligned(&places, &weights)?;
    for _ in 0..ROUNDS {
        let weight = |(seen, mapped): &Places| {
            let off_m = (found * Point3::from(*seen)).coords - mapped;
            1.0 / (1.0 + off_m.norm_squared() / WIDTH_M.powi(2))
        };
        weights = places.iter().map(weight).collect();
        found = aligned(&places, &weights)?;
    }
    Some(found)
}

/// Returns the angles of a view by the datasheet.
pub(crate) fn angles_by_nominal(robot: &Robot, view: &View) -> JointAngles {
    let angle_rad = |joint: usize| robot.sensors[joint].center_rad + view.travel_rad[joint];
    JointAngles::from_fn(view.travel_rad.len(), angle_rad)
}

fn places(robot: &Robot, view: &View) -> Vec<Places> {
    let base_from_camera = robot.tags_from(robot.camera_at(view.camera), &angles_by_nominal(robot, view));
    let known = view.tags.iter().filter(|seen| robot.tags[seen.tag_idx].is_known());
    let of_tag = |seen: &crate::views::view::TagObservation| {
        let place_m = (base_from_camera * Point3::from(seen.center_in_camera_m)).coords;
        (place_m, robot.tags[seen.tag_idx].base_from_tag.origin().vector())
    };
    known.map(of_tag).collect()
}

/// Motion that takes the first of each pair nearest to the second.
fn aligned(places: &[Places], weights: &[f64]) -> Option<Isometry3<f64>> {
    let sum: f64 = weights.iter().sum();
    let mean = |place: fn(&Places) -> Vector3<f64>| {
        places.iter().zip(weights).map(|(of_tag, weight)| place(of_tag) * *weight).sum::<Vector3<f64>>() / sum
    };
    let (seen_m, mapped_m) = (mean(|of_tag| of_tag.0), mean(|of_tag| of_tag.1));
    let product =
        |((seen, mapped), weight): (&Places, &f64)| (mapped - mapped_m) * (seen - seen_m).transpose() * *weight;
    let products: Matrix3<f64> = places.iter().zip(weights).map(product).sum();
    if places.is_empty() || !products.iter().all(|value| value.is_finite()) {
        return None;
    }
    let svd = products.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut mirror = Matrix3::identity();
    let (least, _) = svd.singular_values.argmin();
    mirror[(least, least)] = (u * v_t).determinant().signum();
    let turn = Rotation3::from_matrix_unchecked(u * mirror * v_t);
    Some(Isometry3::from_parts((mapped_m - turn * seen_m).into(), turn.into()))
}

/// Adds columns for the remaining frame error to `input`.
pub(crate) fn free(input: &mut BundleInput<'_>) {
    input.model.n_links = input.model.n_links.max(1);
    input.scales.link_std[0] = FRAME_STD;
}

/// Pose of the map's frame in the base frame, by an estimate that started from `map_from_base`.
pub(crate) fn base_from_map(found: &Estimate<'_>, map_from_base: &Isometry3<f64>) -> Isometry3<f64> {
    let robot = found.problem.robot;
    let moved = found.parameters().with_links(robot.clone()).chain.first_place();
    (map_from_base * moved * robot.chain.first_place().inverse()).inverse()
}

/// Returns true if the motion is larger than a base error that is estimated or named as such.
pub(crate) fn is_large(base_from_map: &Isometry3<f64>) -> bool {
    base_from_map.translation.vector.norm() > LEAST_M || base_from_map.rotation.angle() > LEAST_RAD
}

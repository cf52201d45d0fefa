//! Permutation test over the views: whether readings and tags are of the same instants.
//!
//! The tags alone give the camera's position in each view. Most joints still move the camera, even with wrong sensors,
//! zeros or columns: similar readings give similar positions. Readings of other instants do not.
//!
//! The statistic is the largest distance correlation of a joint's readings and the camera's position (Szekely, Rizzo
//! and Bakirov 2007). It is compared with that of readings in a random order. The same statistic of the nominal arm's
//! camera positions by these readings shows whether this number of views is enough.

use nalgebra::{DMatrix, Vector3};

use crate::explain::constants::unpaired::{CHANCE_P, LEAST_SPREAD_RAD, MIN_VIEWS, POWER_P};
use crate::explain::constants::wrong_input::{GOOD, MAX_VIEWS};
use crate::explain::permutation_test::p_of_order;
use crate::explain::wrong_input::pairs::{mismatch, posed_tags};
use crate::model::parameters::JointParameters;
use crate::positions::position_problem::PositionProblem;
use crate::say::reading_error::{MisreadReadings, ReadingError};
use crate::views::view::View;
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;

/// Refers to readings of other instants if the tags of each view agree with the map, for views that no sensor, column
/// or mount explains. `None` if the readings belong to the views, or if these are too few to decide.
pub(crate) fn unpaired(robot: &Robot, views: &[View]) -> Option<MisreadReadings> {
    let stride = views.len().div_ceil(MAX_VIEWS).max(1);
    let of_first = views.iter().step_by(stride).filter(|view| view.camera == 0);
    let placed: Vec<(&View, Vector3<f64>)> =
        of_first.filter_map(|view| Some((view, camera_place_m(robot, view)?))).collect();
    let (views, seen_m): (Vec<&View>, Vec<Vector3<f64>>) = placed.into_iter().unzip();
    if views.len() < MIN_VIEWS || !agree_with_map(robot, &views) {
        return None;
    }
    let nominal_m: Vec<Vector3<f64>> = views.iter().map(|view| nominal_place_m(robot, view)).collect();
    let joints = readings(robot, &views);
    if p_of_chance(&joints, &nominal_m) > POWER_P {
        return None;
    }
    let p = p_of_chance(&joints, &seen_m);
    if p < CHANCE_P {
        return None;
    }
    let all: Vec<View> = views.iter().map(|view| (*view).clone()).collect();
    let tag_error_m = PositionProblem::new(robot, &all).rms_m(&JointParameters::default())?;
    let found = ReadingError::Unpaired { views: views.len(), p };
    Some(MisreadReadings { found, alternatives: Vec::new(), tag_error_m, corrected_m: None })
}

/// Returns true if the tags of a view agree with the map's relative poses, or if there is one tag in all.
fn agree_with_map(robot: &Robot, views: &[&View]) -> bool {
    let pairs = mismatch(views, &robot.tags, &robot.camera.lens);
    let first = views.iter().flat_map(|view| &view.tags).next().map(|seen| seen.tag_idx);
    let is_one = || views.iter().flat_map(|view| &view.tags).all(|seen| Some(seen.tag_idx) == first);
    pairs.map_or_else(is_one, |pairs| pairs.mismatch < GOOD)
}

/// Camera position in the tags' frame, m: of those by each tag and each of its poses, the one nearest to all others.
fn camera_place_m(robot: &Robot, view: &View) -> Option<Vector3<f64>> {
    let posed = posed_tags(view, &robot.tags, &robot.camera.lens);
    let places: Vec<Vector3<f64>> = posed.iter().flat_map(|tag| tag.camera_places_m()).collect();
    let far_m = |from: &Vector3<f64>| places.iter().map(|to| (from - to).norm()).sum::<f64>();
    places.iter().min_by(|a, b| far_m(a).total_cmp(&far_m(b))).copied()
}

fn nominal_place_m(robot: &Robot, view: &View) -> Vector3<f64> {
    let angle_rad = |joint: usize| robot.sensors[joint].center_rad + view.travel_rad[joint];
    robot.tags_from_camera(&JointAngles::from_fn(view.travel_rad.len(), angle_rad)).translation.vector
}

/// Readings of the joints that move, one vector per joint.
fn readings(robot: &Robot, views: &[&View]) -> Vec<Vec<f64>> {
    let of_joint = |joint: usize| views.iter().map(|view| view.travel_rad[joint]).collect::<Vec<f64>>();
    let moves = |read: &Vec<f64>| {
        let [least, most] = [f64::min, f64::max].map(|of| read.iter().copied().reduce(of).unwrap_or(0.0));
        most - least > LEAST_SPREAD_RAD
    };
    (0..robot.n_seen_joints()).map(of_joint).filter(moves).collect()
}

/// Probability that readings in a random order match the positions as well.
fn p_of_chance(joints: &[Vec<f64>], places_m: &[Vector3<f64>]) -> f64 {
    let n = places_m.len();
    let of_places = centred(n, |i, k| (places_m[i] - places_m[k]).norm());
    let of_joints: Vec<DMatrix<f64>> = joints.iter().map(|read| centred(n, |i, k| (read[i] - read[k]).abs())).collect();
    p_of_order("permutations/readings and tags", n, |order| {
        let with_places = |of_joint: &DMatrix<f64>| -> f64 {
            (0..n).map(|i| (0..n).map(|k| of_joint[(i, k)] * of_places[(order[i], order[k])]).sum::<f64>()).sum()
        };
        of_joints.iter().map(with_places).fold(0.0, f64::max)
    })
}

/// Distances less the means of their rows and columns, of unit norm.
fn centred(n: usize, distance: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    let all = DMatrix::from_fn(n, n, distance);
    let means: Vec<f64> = all.row_iter().map(|row| row.mean()).collect();
    let mean = all.mean();
    let centred = DMatrix::from_fn(n, n, |i, k| all[(i, k)] - means[i] - means[k] + mean);
    let norm = centred.norm().max(f64::MIN_POSITIVE);
    centred / norm
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::stats::stream_rng;
    use nalgebra::Rotation3;
    use rand::RngExt;
    use rand::seq::SliceRandom;

    /// Positions of a camera that two of three joints carry, and the joints' readings.
    fn drawn(seed: u64, n: usize) -> (Vec<Vec<f64>>, Vec<Vector3<f64>>) {
        let mut rng = stream_rng(seed, "unpaired");
        let joints: Vec<Vec<f64>> =
            (0..3).map(|_| (0..n).map(|_| rng.random_range(-2.5..2.5)).collect::<Vec<f64>>()).collect();
        let place = |k: usize| {
            let lifted = Rotation3::new(Vector3::y() * joints[1][k] * 0.3) * Vector3::x();
            Rotation3::new(Vector3::z() * joints[0][k]) * lifted
        };
        let places = (0..n).map(place).collect();
        (joints, places)
    }

    /// Reversed, scaled and exchanged columns are not chance; a random order is, in nearly all cases.
    #[test]
    fn readings_of_other_instants_are_told_from_readings_that_are_misread() {
        let mut n_chance = 0;
        for seed in 0..20 {
            let (mut joints, places) = drawn(seed, 30);
            joints.rotate_left(1);
            joints[0].iter_mut().for_each(|read| *read *= -57.3);
            joints[2].iter_mut().for_each(|read| *read += 3.0);
            let p = p_of_chance(&joints, &places);
            assert!(p <= POWER_P, "seed {seed}: {p}");
            let mut order: Vec<usize> = (0..30).collect();
            order.shuffle(&mut stream_rng(seed, "another order"));
            let shuffled: Vec<Vec<f64>> = joints.iter().map(|read| order.iter().map(|&k| read[k]).collect()).collect();
            n_chance += usize::from(p_of_chance(&shuffled, &places) >= CHANCE_P);
        }
        assert!(n_chance >= 16, "{n_chance} of 20");
    }
}

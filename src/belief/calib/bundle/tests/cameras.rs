//! Arms with a second camera.

use std::ops::Range;

use nalgebra::Isometry3;

use crate::calib::bundle::estimate::estimate;
use crate::calib::bundle::input::HyperparameterMode;
use crate::calib::bundle::tests::corner_outliers::tool_error;
use crate::calib::bundle::tests::data::{titan_watched_by_two, titan_with_two_cameras};
use crate::calib::bundle::tests::statistics::{assert_honest, case, input, tally};
use crate::calib::views::view::View;
use armcal_core::robot::Robot;

#[test]
fn the_covariance_is_honest_with_a_second_camera() {
    assert_honest(&tally(&titan_with_two_cameras(), 0..100, 20), "with a second camera");
}

/// The titan with two cameras beside each other on its wrist: what its joints are off in a pose is in both their views.
fn stereo() -> Robot {
    let mut robot = titan_with_two_cameras();
    robot.further_cameras[0].mount = robot.camera.mount;
    robot.further_cameras[0].mount.link_from_frame *= Isometry3::translation(0.06, 0.0, 0.0);
    robot
}

/// Root mean square of the tool's error, mm, and mean NEES.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    rms_mm: f64,
    nees: f64,
}

/// By the first camera alone, by both, and by both as if each had seen poses of its own.
fn compared(robot: &Robot, n_seeds: u64) -> [Errors; 3] {
    let mut sums = [Errors::default(); 3];
    for seed in 0..n_seeds {
        let case = case(robot, seed, 20);
        let alone: Vec<View> = case.views.iter().map(|view| View { n_cameras: 1, ..view.clone() }).collect();
        let first: Vec<View> = alone.iter().filter(|view| view.camera == 0).cloned().collect();
        for (sum, views) in sums.iter_mut().zip([&first, &case.views, &alone]) {
            let found = estimate(&input(&case, views, HyperparameterMode::Fitted)).expect("solved");
            let [square_m2, nees] = tool_error(&case, &found, seed);
            sum.rms_mm += 1e6 * square_m2 / n_seeds as f64;
            sum.nees += nees / n_seeds as f64;
        }
    }
    sums.map(|sum| Errors { rms_mm: sum.rms_mm.sqrt(), ..sum })
}

#[test]
fn what_two_cameras_see_of_one_pose_is_not_counted_twice() {
    one_pose_counts_once(12, 1.7..4.5, [1.0, 0.3]);
}

#[test]
#[ignore = "second tier: 100 seeds, 44 s"]
fn what_two_cameras_see_of_one_pose_is_not_counted_twice_over_100_seeds() {
    one_pose_counts_once(100, 2.4..3.8, [0.97, 0.5]);
}

/// Limits of NEES by both, of their error over that of one camera, and of the NEES that counting twice adds.
fn one_pose_counts_once(n_seeds: u64, limits: Range<f64>, [most_rms, least_more]: [f64; 2]) {
    for (robot, what) in [
        (stereo(), "beside each other"),
        (titan_with_two_cameras(), "on two links"),
        (titan_watched_by_two(), "standing still"),
    ] {
        let [one, both, alone] = compared(&robot, n_seeds);
        println!("{what}: one camera {one:?}, both {both:?}, as if of other poses {alone:?}");
        assert!(both.rms_mm < most_rms * one.rms_mm, "{what}: {both:?} {one:?}");
        assert!(limits.contains(&both.nees), "{what}: {both:?}");
        assert!(alone.nees > both.nees + least_more, "{what}: {alone:?} {both:?}");
    }
}

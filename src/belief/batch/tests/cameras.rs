//! Arms with a second camera.

use std::ops::Range;

use nalgebra::{Isometry3, SVector};

use crate::batch::tests::corner_outliers::tool_error;
use crate::batch::tests::data::{normal, rng, titan_watched_by_two, titan_with_two_cameras};
use crate::batch::tests::statistics::{assert_honest, case, input, tally};
use crate::model::blocks::Block;
use crate::model::scales::Hyperparameters;
use crate::solve::estimate::estimate;
use crate::solve::input::HyperparameterMode;
use crate::views::view::View;
use armcal_core::robot::Robot;

#[test]
fn the_covariance_is_honest_with_a_second_camera() {
    assert_honest(&tally(&titan_with_two_cameras(), 0..100, 20), "with a second camera");
}

/// The titan with two cameras next to each other on its wrist: both share the joint errors of a pose.
fn stereo() -> Robot {
    let mut robot = titan_with_two_cameras();
    robot.further_cameras[0].mount = robot.camera.mount;
    robot.further_cameras[0].mount.link_from_frame *= Isometry3::translation(0.06, 0.0, 0.0);
    robot
}

/// Root mean square tool error, mm, and mean NEES.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    rms_mm: f64,
    nees: f64,
}

/// Errors with the first camera only, with both, and with both as if each had its own poses.
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

/// Checks the ratios for both cameras: NEES, error over that of one camera, and the NEES that counting twice adds.
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

/// The titan with two cameras; robot.toml knows the second lens only within its sigmas.
fn with_other_second_lens(known: &Robot, seed: u64) -> Robot {
    let mut rng = rng(seed, "second lens");
    let mut robot = known.clone();
    let std = Block::Lens(1).drawn_std(known, &Hyperparameters::datasheet(known));
    let lens = &mut robot.further_cameras[0].lens;
    let drawn = lens.intrinsics();
    *lens = lens.with_intrinsics(std::array::from_fn(|k| drawn[k] + std[k] * normal(&mut rng)));
    robot
}

/// Checks the lens's eight numbers: shares within one and two sigmas of the truth over all seeds, and mean NEES.
#[test]
fn the_lens_of_a_second_camera_is_a_block() {
    const SEEDS: Range<u64> = 5000..5040;
    let known = titan_with_two_cameras();
    let (mut within, mut nees) = ([0.0; 2], 0.0);
    for seed in SEEDS {
        let real = with_other_second_lens(&known, seed);
        let mut case = case(&real, seed, 20);
        case.robot = &known;
        let mut input = input(&case, &case.views, HyperparameterMode::Fitted);
        input.model.blocks.insert(Block::Lens(1));
        let found = estimate(&input).expect("solved");
        let at = found.problem.layout.at(Block::Lens(1)).expect("it has columns");
        let covariance = found.posterior.covariance.fixed_view::<8, 8>(at, at).into_owned();
        let (lens, truth) = (found.lens(1).intrinsics(), real.further_cameras[0].lens.intrinsics());
        let off = SVector::<f64, 8>::from_fn(|k, _| lens[k] - truth[k]);
        for (k, sigmas) in [1.0, 2.0].into_iter().enumerate() {
            within[k] += (0..8).filter(|&n| off[n].abs() < sigmas * covariance[(n, n)].sqrt()).count() as f64;
        }
        nees += off.dot(&covariance.cholesky().expect("positive definite").solve(&off));
    }
    let n = 8.0 * SEEDS.count() as f64;
    let [one, two] = within.map(|count| count / n);
    let nees = 8.0 * nees / n;
    println!("lens of a second camera: {one:.2} within one sigma, {two:.2} within two, NEES {nees:.2} of 8");
    // The 8 numbers of one lens, among 320, are not independent of each other; a chi-square of 8 degrees has a variance
    // of 16.
    assert!((0.6..0.76).contains(&one) && two > 0.92 && (6.1..9.9).contains(&nees), "{one} {two} {nees}");
}

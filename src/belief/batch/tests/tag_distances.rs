//! Measured distances between tags: their effect on the map, and wrong ones.

use nalgebra::DVector;

use crate::batch::tests::data::{normal, rng, titan};
use crate::batch::tests::statistics::{Case, case, input};
use crate::checks::block_measurements::length_innovations;
use crate::model::blocks::Block;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::HyperparameterMode;
use armcal_core::robot::Robot;
use armcal_core::robot::geometry::TagDistance;

/// Number of views: few, so that a tape measures better than they do.
const N_VIEWS: usize = 6;
const SEEDS: std::ops::Range<u64> = 7100..7140;
const STD_M: f64 = 5e-4;
/// Error of a wrong distance, m.
const OFF_M: f64 = 0.04;
/// Sigma of the survey, m: so large that the views decide.
const SURVEY_STD_M: f64 = 0.03;

fn roughly_surveyed() -> Robot {
    let mut robot = titan();
    robot.tags.iter_mut().for_each(|tag| tag.position_std_m = SURVEY_STD_M);
    robot
}

/// Indices of two tags of the first view, and the distance between them, m.
fn two_tags(case: &Case<'_>) -> ([usize; 2], f64) {
    let seen = &case.views[0].tags;
    let between = [seen[0].tag_idx, seen[seen.len() - 1].tag_idx];
    let [a, b] = between.map(|tag| case.truth.tags[tag].translation.vector);
    (between, (a - b).norm())
}

fn with_tape(robot: &Robot, between: [usize; 2], distance_m: f64) -> Robot {
    let mut robot = robot.clone();
    let tags = between.map(|tag| robot.tags[tag].id);
    robot.geometry.tag_distances.push(TagDistance { tags, distance_m, std_m: STD_M });
    robot
}

/// The estimated distance and its sigma, m.
fn distance_m(found: &Estimate<'_>, between: [usize; 2]) -> [f64; 2] {
    let [a, b] = between.map(|tag| found.tag(tag).0);
    let apart = a.translation.vector - b.translation.vector;
    let mut row = DVector::zeros(found.problem.layout.n);
    for (tag, pose, sign) in [(between[0], a, 1.0), (between[1], b, -1.0)] {
        let at = found.problem.layout.at(Block::Tag(tag)).expect("columns");
        row.fixed_rows_mut::<3>(at).copy_from(&(pose.rotation.inverse() * apart.normalize() * sign));
    }
    [apart.norm(), row.dot(&(&found.posterior.covariance * &row)).sqrt()]
}

#[test]
fn a_taped_distance_is_recovered_within_its_sigma() {
    let robot = roughly_surveyed();
    let (mut squares, mut within, mut n, mut sigmas) = ([0.0; 2], 0, 0, [0.0; 2]);
    let mut innovations = Vec::new();
    for seed in SEEDS {
        let mut case = case(&robot, seed, N_VIEWS);
        let (between, true_m) = two_tags(&case);
        let taped = with_tape(&robot, between, true_m + STD_M * normal(&mut rng(seed, "tape")));
        for (k, robot) in [&robot, &taped].into_iter().enumerate() {
            case.robot = robot;
            let input = input(&case, &case.views, HyperparameterMode::Fitted);
            let by_views = estimate(&input).expect("solved");
            let lengths = length_innovations(&by_views);
            let found = by_views.with_lengths(&input, &lengths);
            let [estimated_m, std_m] = distance_m(&found, between);
            squares[k] += (estimated_m - true_m).powi(2);
            sigmas[k] += std_m;
            if k == 1 {
                assert!(std_m < STD_M, "seed {seed}: {std_m}");
                within += usize::from((estimated_m - true_m).abs() < std_m);
                n += 1;
                innovations.extend(lengths.iter().map(|of| of.sigmas().powi(2)));
            }
        }
    }
    let [without_mm, with_mm] = squares.map(|sum| 1e3 * (sum / n as f64).sqrt());
    let [std_without_mm, std_with_mm] = sigmas.map(|sum| 1e3 * sum / n as f64);
    let mean = innovations.iter().sum::<f64>() / n as f64;
    println!(
        "{n} seeds: distance {without_mm:.2} mm off rms (sigma {std_without_mm:.2}), taped {with_mm:.2} (sigma \
         {std_with_mm:.2}), {within} within one sigma; mean squared innovation {mean:.2}"
    );
    // Expected: 27 of 40. Fewer than 18 or more than 36 happen by chance once in a thousand times.
    assert!((18..=36).contains(&within), "{within} of {n}");
    assert!(with_mm < 0.7 * without_mm, "{with_mm} {without_mm}");
    assert!(innovations.len() == n && (0.4..2.0).contains(&mean), "{mean} of {}", innovations.len());
}

#[test]
fn a_wrong_distance_is_told_by_everything_else() {
    let robot = roughly_surveyed();
    for seed in SEEDS.take(8) {
        let mut case = case(&robot, seed, 4 * N_VIEWS);
        let (between, true_m) = two_tags(&case);
        let wrong = with_tape(&robot, between, true_m + OFF_M);
        case.robot = &wrong;
        let input = input(&case, &case.views, HyperparameterMode::Fitted);
        let found = estimate(&input).expect("solved");
        let lengths = length_innovations(&found);
        let [innovation] = &lengths[..] else { panic!("one length") };
        assert!(innovation.sigmas() > 6.0, "seed {seed}: {}", innovation.sigmas());
        assert!((innovation.off_m - OFF_M).abs() < 4.0 * innovation.std_m, "seed {seed}: {}", innovation.off_m);
        let [before_m, _] = distance_m(&found, between);
        let [after_m, _] = distance_m(&found.with_lengths(&input, &lengths), between);
        assert_eq!(before_m, after_m, "seed {seed}: a length that does not hold is in the estimate");
    }
}

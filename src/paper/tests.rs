//! Tests on known arms: an arm, its landmarks and its readings come from forward kinematics only, and the methods must
//! return its sensors.

use std::path::Path;

use nalgebra::{Matrix3, Point3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::minimum_variance::variance_covariance;
use crate::*;
use armcal_belief::calib::{CommonErrors, PositionProblem, TagMeasurement, TagObservation, View};
use armcal_belief::model::{JointParameters, Parameter, ParameterKind};
use armcal_core::numeric::Outcome;
use armcal_core::robot::{Robot, load};
use armcal_core::stats::{quantile, stream_rng};
use armcal_core::streams::JointAngles;
use armcal_core::time::SIMULATION_EPOCH;

const N_SEEN: usize = 5;

fn titan() -> Robot {
    load(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4")).expect("the robot reads")
}

fn all_free() -> Vec<Parameter> {
    let kinds = [ParameterKind::Gain, ParameterKind::Offset];
    (0..N_SEEN).flat_map(|joint| kinds.map(|kind| Parameter { joint, kind })).collect()
}

fn first_offset() -> Parameter {
    Parameter { joint: 0, kind: ParameterKind::Offset }
}

/// Gains within 5 %, offsets within 5 deg.
fn drawn_sensors(rng: &mut ChaCha8Rng) -> JointParameters {
    let mut truth = JointParameters::default();
    for joint in 0..6 {
        truth.gain[joint] = 1.0 + rng.random_range(-0.05..0.05);
        truth.offset_rad[joint] = 5.0_f64.to_radians() * rng.random_range(-1.0..1.0);
    }
    truth
}

fn drawn_angles(robot: &Robot, rng: &mut ChaCha8Rng) -> JointAngles {
    JointAngles::from_fn(6, |j| {
        let limits = robot.chain.joints()[j].limits;
        limits.map_or(0.0, |l| rng.random_range(l.lower_rad..l.upper_rad))
    })
}

/// `n` views of all tags, with isotropic noise of `noise_m` per axis.
fn views(robot: &Robot, truth: &JointParameters, n: u32, noise_m: f64, rng: &mut ChaCha8Rng) -> Vec<View> {
    let view = |pose_idx| {
        let angles = drawn_angles(robot, rng);
        let camera_from_base = robot.chain.link_poses(&angles).frame(&robot.camera.mount).inverse();
        let travel_rad = JointAngles::from_fn(6, |j| {
            (angles[j] - robot.sensors[j].center_rad - truth.offset_rad[j]) / truth.gain[j]
        });
        let mut seen = |(tag_idx, tag): (usize, &armcal_core::robot::SurveyedTag)| {
            let exact = camera_from_base * Point3::from(tag.base_from_tag.origin().vector());
            let noise = Vector3::from_fn(|_, _| noise_m * Distribution::<f64>::sample(&StandardNormal, rng));
            TagObservation {
                id: tag.id,
                tag_idx,
                center_in_camera_m: exact.coords + noise,
                measured: TagMeasurement::Position,
            }
        };
        let tags = robot.tags.iter().enumerate().map(&mut seen).collect();
        View { tags, ..View::of_reading(pose_idx, SIMULATION_EPOCH, travel_rad) }
    };
    (0..n).map(view).collect()
}

/// Distance between the estimated and the true tool, root mean square over random poses, m.
fn tool_error_m(robot: &Robot, truth: &JointParameters, believed: &JointParameters, seed: u64) -> f64 {
    let mut rng = stream_rng(seed, "poses of the tool");
    let n = 200;
    let squares: f64 = (0..n)
        .map(|_| {
            let angles = drawn_angles(robot, &mut rng);
            let taken_for = JointAngles::from_fn(6, |j| {
                let center = robot.sensors[j].center_rad;
                let travel = (angles[j] - center - truth.offset_rad[j]) / truth.gain[j];
                center + believed.gain[j] * travel + believed.offset_rad[j]
            });
            let tool = |at: &JointAngles| robot.chain.link_poses(at).frame(&robot.tool.mount).translation.vector;
            (tool(&angles) - tool(&taken_for)).norm_squared()
        })
        .sum();
    (squares / f64::from(n)).sqrt()
}

fn anchored(truth: &JointParameters) -> JointParameters {
    JointParameters { offset_rad: { [truth.offset_rad[0], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] }, ..Default::default() }
}

#[test]
fn without_noise_every_method_finds_the_sensors() {
    let robot = titan();
    let without_gauge: Vec<Parameter> = all_free().into_iter().filter(|p| *p != first_offset()).collect();
    let mut worst_m = [0.0_f64; 3];
    for seed in 0..20 {
        let mut rng = stream_rng(seed, "methods");
        let truth = drawn_sensors(&mut rng);
        let views = views(&robot, &truth, 20, 0.0, &mut rng);
        let problem = PositionProblem::new(&robot, &views);
        let options = SearchOptions::default();
        let solved = [
            PositionMethod::MinimumDistance.solve(&problem, &all_free(), &JointParameters::default(), &options),
            PositionMethod::LeastSquares.solve(&problem, &all_free(), &JointParameters::default(), &options),
            PositionMethod::MinimumVariance.solve(&problem, &without_gauge, &anchored(&truth), &options),
        ];
        for (worst, solution) in worst_m.iter_mut().zip(&solved) {
            assert_eq!(solution.outcome, Outcome::Converged, "seed {seed}");
            *worst = worst.max(tool_error_m(&robot, &truth, &solution.parameters, seed));
        }
    }
    eprintln!("worst of 20 seeds, m: {worst_m:?}");
    assert!(worst_m[0] < 1e-5 && worst_m[1] < 1e-8 && worst_m[2] < 1e-5, "{worst_m:?}");
}

/// The objectives as the paper's text defines them: `E[..]` with the divisor m - 1, and plain distances.
#[test]
fn objectives_are_the_papers_equations() {
    let robot = titan();
    let mut rng = stream_rng(3, "equations");
    let truth = drawn_sensors(&mut rng);
    let mut views = views(&robot, &truth, 12, 0.01, &mut rng);
    // Some landmarks are seen less often, one once.
    for (n, view) in views.iter_mut().enumerate() {
        view.tags.retain(|tag| tag.tag_idx != 2 && (tag.tag_idx != 5 || n == 4) && (tag.tag_idx + n) % 3 != 0);
    }
    let problem = PositionProblem::new(&robot, &views);
    for at in [JointParameters::default(), truth] {
        let mut clouds = vec![Vec::new(); robot.tags.len()];
        for view in &views {
            let angles = JointAngles::from_fn(6, |j| {
                robot.sensors[j].center_rad + at.gain[j] * view.travel_rad[j] + at.offset_rad[j]
            });
            let base_from_camera = robot.chain.link_poses(&angles).frame(&robot.camera.mount);
            for tag in &view.tags {
                clouds[tag.tag_idx].push((base_from_camera * Point3::from(tag.center_in_camera_m)).coords);
            }
        }
        let (mut variance, mut distance) = (0.0, 0.0);
        for (cloud, tag) in clouds.iter().zip(&robot.tags) {
            let m = cloud.len() as f64;
            distance += cloud.iter().map(|z| (z - tag.base_from_tag.origin().vector()).norm()).sum::<f64>();
            if cloud.len() > 1 {
                let mean = cloud.iter().sum::<Vector3<f64>>() / m;
                let c: Matrix3<f64> = cloud.iter().map(|z| (z - mean) * (z - mean).transpose()).sum();
                variance += c.trace() / (m - 1.0);
            }
        }
        let found = [PositionMethod::MinimumVariance, PositionMethod::MinimumDistance].map(|m| m.cost(&problem, &at));
        assert!((found[0] - variance).abs() < 1e-12 * variance, "{found:?} {variance}");
        assert!((found[1] - distance).abs() < 1e-12 * distance, "{found:?} {distance}");
    }
}

#[test]
fn minimum_variance_is_exactly_blind_to_the_first_offset_and_to_nothing_else() {
    let robot = titan();
    for seed in 0..20 {
        let mut rng = stream_rng(seed, "gauge");
        let truth = drawn_sensors(&mut rng);
        let views = views(&robot, &truth, 10, 0.01, &mut rng);
        let problem = PositionProblem::new(&robot, &views);
        let at = |parameter, step: f64| {
            let mut moved = truth;
            moved.set(parameter, truth.get(parameter) + step);
            PositionMethod::MinimumVariance.cost(&problem, &moved)
        };
        let cost = at(first_offset(), 0.0);
        for step in 1..=36 {
            let change = at(first_offset(), 5.0_f64.to_radians() * f64::from(step)) - cost;
            assert!(change.abs() < 1e-13 * cost, "{change} of {cost}");
        }
        for parameter in all_free().into_iter().filter(|p| *p != first_offset()) {
            assert!((at(parameter, 0.1) / cost - 1.0).abs() > 0.1, "{parameter:?}");
        }
        let (left, blind) = determined_by_variance(&problem, &all_free(), &JointParameters::default());
        assert_eq!((left.len(), blind.len()), (9, 1));
        assert_eq!(blind[0].parameter, first_offset());
    }
}

/// One joint never moved: its gain is equivalent to an offset, and one of the two remains. A landmark in only one view
/// adds no information.
#[test]
fn what_the_views_leave_without_effect_is_held_and_named() {
    let robot = titan();
    let mut rng = stream_rng(1, "rank");
    let truth = drawn_sensors(&mut rng);
    let mut views = views(&robot, &truth, 15, 0.0, &mut rng);
    let names = |views: &[View]| -> Vec<Parameter> {
        let problem = PositionProblem::new(&robot, views);
        let (_, blind) = determined_by_variance(&problem, &all_free(), &JointParameters::default());
        blind.iter().map(|u| u.parameter).collect()
    };
    for view in &mut views {
        view.travel_rad[3] = 0.4;
    }
    let held = names(&views);
    assert!(held.len() == 2 && held[0] == first_offset() && held[1].joint == 3, "{held:?}");
    assert_eq!(names(&views[..1]).len(), 10);
}

/// The scatter over many draws agrees with the sandwich: the mean squared normalised error of each parameter is 1.
#[test]
fn covariances_of_minimum_variance_are_those_of_many_draws() {
    let robot = titan();
    let without_gauge: Vec<Parameter> = all_free().into_iter().filter(|p| *p != first_offset()).collect();
    let mut robot = robot;
    (robot.camera.mount_std_m, robot.camera.mount_std_rad) = (0.0, 0.0);
    let errors = CommonErrors::priors(&robot);
    let draws: u64 = 150;
    let mut chi_square = 0.0;
    for seed in 0..draws {
        let mut rng = stream_rng(seed, "sandwich");
        let truth = drawn_sensors(&mut rng);
        let views = views(&robot, &truth, 60, 0.005, &mut rng);
        let problem = PositionProblem::new(&robot, &views);
        let guess = anchored(&truth);
        let options = SearchOptions { rho_end: 1e-5, ..SearchOptions::default() };
        let solution = PositionMethod::MinimumVariance.solve(&problem, &without_gauge, &guess, &options);
        let (covariance, _) = variance_covariance(&problem, &without_gauge, &solution.parameters, &errors);
        for parameter in &without_gauge {
            let error = solution.parameters.get(*parameter) - truth.get(*parameter);
            chi_square += (error / covariance.std(*parameter).expect("estimated")).powi(2);
        }
    }
    let mean = chi_square / (draws as f64 * without_gauge.len() as f64);
    assert!((0.85..1.35).contains(&mean), "{mean}");
}

#[test]
fn several_starts_are_the_same_draws_each_time_and_never_worse() {
    let robot = titan();
    let mut rng = stream_rng(5, "starts");
    let truth = drawn_sensors(&mut rng);
    let views = views(&robot, &truth, 8, 0.02, &mut rng);
    let problem = PositionProblem::new(&robot, &views);
    let solve = |n_starts| {
        let options = SearchOptions { n_starts, ..SearchOptions::default() };
        PositionMethod::MinimumVariance.solve(&problem, &all_free(), &JointParameters::default(), &options)
    };
    let (one, four, again) = (solve(1), solve(4), solve(4));
    assert!(four.cost_final <= one.cost_final && four.evaluations > one.evaluations);
    assert_eq!((four.parameters, four.cost_final), (again.parameters, again.cost_final));
}

/// The search in raw numbers has the same sensors: `k1` in rad per count, `k2` at the reading zero.
#[test]
fn raw_units_reach_less_in_more_evaluations() {
    let robot = titan();
    let mut errors_m = [Vec::new(), Vec::new()];
    let mut evaluations = [0, 0];
    for seed in 0..8 {
        let mut rng = stream_rng(seed, "raw");
        let truth = drawn_sensors(&mut rng);
        let views = views(&robot, &truth, 15, 0.0, &mut rng);
        let problem = PositionProblem::new(&robot, &views);
        for (n, scaling) in [Scaling::PriorSigma, Scaling::Raw].into_iter().enumerate() {
            let options = SearchOptions { scaling, ..SearchOptions::default() };
            let solution =
                PositionMethod::MinimumDistance.solve(&problem, &all_free(), &JointParameters::default(), &options);
            evaluations[n] += solution.evaluations;
            errors_m[n].push(tool_error_m(&robot, &truth, &solution.parameters, seed));
        }
    }
    let median = |errors: &[f64]| quantile(errors, 0.5).expect("samples");
    eprintln!("{evaluations:?} {errors_m:?}");
    assert!(evaluations[1] > 3 * evaluations[0] && median(&errors_m[1]) > 10.0 * median(&errors_m[0]));
}

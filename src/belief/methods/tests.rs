//! Calibration of arms with known sensor errors at their end stops.

use std::path::Path;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::methods::joint_limits::fit_stops;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::views::view::EndStopReading;
use armcal_core::robot::{Robot, load};
use armcal_core::stats::stream_rng;

const N_SEEN: usize = 5;

fn titan() -> Robot {
    load(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4")).expect("the robot reads")
}

fn all_free() -> Vec<Parameter> {
    let kinds = [ParameterKind::Gain, ParameterKind::Offset];
    (0..N_SEEN).flat_map(|joint| kinds.map(|kind| Parameter { joint, kind })).collect()
}

/// Draws gains within 5 %, offsets within 5 deg.
fn drawn_sensors(rng: &mut ChaCha8Rng) -> JointParameters {
    let mut truth = JointParameters::default();
    for joint in 0..6 {
        truth.gain[joint] = 1.0 + rng.random_range(-0.05..0.05);
        truth.offset_rad[joint] = 5.0_f64.to_radians() * rng.random_range(-1.0..1.0);
    }
    truth
}

fn reading(robot: &Robot, truth: &JointParameters, joint: usize, angle_rad: f64, off_rad: f64) -> EndStopReading {
    let center = robot.sensors[joint].center_rad;
    let travel_rad = (angle_rad + off_rad - center - truth.offset_rad[joint]) / truth.gain[joint];
    EndStopReading { joint, angle_rad, travel_rad }
}

fn stops_rad(robot: &Robot, joint: usize) -> [f64; 2] {
    let limits = robot.chain.joints()[joint].limits.expect("limits");
    [limits.lower_rad, limits.upper_rad]
}

#[test]
fn two_exact_stops_or_several_give_the_sensors() {
    let robot = titan();
    for seed in 0..20 {
        let truth = drawn_sensors(&mut stream_rng(seed, "stops"));
        for between in [vec![], vec![0.3, 0.5, 0.9]] {
            let mut readings = Vec::new();
            for joint in 0..N_SEEN {
                let [low, high] = stops_rad(&robot, joint);
                let angles = [0.0, 1.0].into_iter().chain(between.clone()).map(|t| low + t * (high - low));
                readings.extend(angles.map(|angle| reading(&robot, &truth, joint, angle, 0.0)));
            }
            let found = fit_stops(&robot, &readings, &JointParameters::default()).expect("two stops each");
            for joint in 0..N_SEEN {
                let at = &found.solution.parameters;
                assert!((at.gain[joint] - truth.gain[joint]).abs() < 1e-12);
                assert!((at.offset_rad[joint] - truth.offset_rad[joint]).abs() < 1e-12);
            }
            assert!(found.solution.cost_final < 1e-24 && found.solution.cost_initial > 1e-4);
            let expected: f64 =
                readings.iter().map(|r| (robot.sensors[r.joint].center_rad + r.travel_rad - r.angle_rad).powi(2)).sum();
            assert!((found.solution.cost_initial - expected).abs() < 1e-12 * expected);
            // The last joint turns without end: it has no stops.
            assert_eq!(found.left_out.len(), 2);
            assert!(found.left_out.iter().all(|u| u.parameter.joint == 5));
        }
    }
}

/// Stops deviate from their nominal angle by half a degree; errors within the stated deviation are as frequent as for a
/// normal distribution.
#[test]
fn stops_off_their_drawing_show_in_the_deviations() {
    let robot = titan();
    let (mut within, mut n) = (0, 0);
    for seed in 0..200 {
        let mut rng = stream_rng(seed, "stops off");
        let truth = drawn_sensors(&mut rng);
        let mut readings = Vec::new();
        for joint in 0..N_SEEN {
            for angle in stops_rad(&robot, joint) {
                let off: f64 = StandardNormal.sample(&mut rng);
                // Each stop is read twice with the same error.
                readings.extend([reading(&robot, &truth, joint, angle, 0.0087 * off); 2]);
            }
        }
        let found = fit_stops(&robot, &readings, &JointParameters::default()).expect("two stops each");
        for parameter in all_free() {
            let error = found.solution.parameters.get(parameter) - truth.get(parameter);
            within += u32::from(error.abs() < found.covariance.std(parameter).expect("fitted"));
            n += 1;
        }
    }
    let share = f64::from(within) / f64::from(n);
    assert!((0.63..0.73).contains(&share), "{share}");
}

#[test]
fn joints_without_two_stops_are_named_and_none_at_all_is_refused() {
    let robot = titan();
    let truth = drawn_sensors(&mut stream_rng(2, "stops"));
    let at = |joint, end: usize| reading(&robot, &truth, joint, stops_rad(&robot, joint)[end], 0.0);
    let guess = JointParameters::default();
    let none = fit_stops(&robot, &[], &guess).expect_err("nothing to fit");
    let one = fit_stops(&robot, &[at(1, 0), at(1, 0), at(2, 1)], &guess).expect_err("one stop each");
    let found = fit_stops(&robot, &[at(1, 0), at(1, 1), at(2, 1)], &guess).expect("one joint");
    assert_eq!(found.covariance.parameters.len(), 2);
    assert_eq!(found.solution.parameters.gain[2], 1.0);
    assert!(found.left_out.iter().any(|u| u.parameter.joint == 2));
    let dead = EndStopReading { travel_rad: at(3, 0).travel_rad, ..at(3, 1) };
    let dead = fit_stops(&robot, &[at(3, 0), dead], &guess).expect_err("a dead sensor");
    let mut words = vec![none, one, dead];
    words.extend(found.left_out.into_iter().map(|left| left.reason));
    insta::assert_snapshot!("end_stops", words.join("\n"));
}

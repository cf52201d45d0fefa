//! Arms that depart from their nominal model within robot.toml's sigmas: the error predicted with priors is the true
//! error.

use std::ops::Range;

use nalgebra::{Isometry3, Matrix3, Vector3, Vector6};

use crate::batch::tests::data::{Truth, normal, rng, titan};
use crate::batch::tests::sag::revised;
use crate::batch::tests::score_test::{input, views_of_changed};
use crate::explain::drawing::Drawing;
use crate::model::parameters::JointParameters;
use crate::solve::covariance::ParameterCovariance;
use armcal_core::joints::{JointAngles, MAX_JOINTS};
use armcal_core::kinematics::LinkCorrection;
use armcal_core::robot::Robot;
use armcal_core::sensor::ConditionChange;
use armcal_core::spatial::exp;
use armcal_core::stats::quantile;

/// The true arm, with another tool point and another lens; its links and the frame of the survey come from [`truth`].
fn real_arm(robot: &Robot, seed: u64) -> Robot {
    let mut rng = rng(seed, "within sigmas: arm");
    let mut real = robot.clone();
    let tool = Vector3::from_fn(|_, _| robot.geometry.tool_position_std_m * normal(&mut rng));
    real.tool.mount.link_from_frame.translation.vector += tool;
    let priors = robot.camera.lens_priors;
    let by_focal = priors.focal_std * normal(&mut rng);
    let mut lens = robot.camera.lens.intrinsics();
    for (k, value) in lens.iter_mut().enumerate() {
        *value += match k {
            0 | 1 => *value * by_focal,
            2 | 3 => priors.center_std_px * normal(&mut rng),
            _ => priors.distortion_std * normal(&mut rng),
        };
    }
    real.camera.lens = robot.camera.lens.with_intrinsics(lens);
    real
}

fn change_truth(robot: &Robot, truth: &mut Truth, seed: u64) {
    let mut rng = rng(seed, "within sigmas: truth");
    let std = [robot.geometry.link_position_std_m, robot.geometry.link_rotation_std_rad];
    let mut three = |std: f64| Vector3::from_fn(|_, _| std * normal(&mut rng));
    for place in &mut truth.parameters.links.places[..robot.n_joints()] {
        *place = LinkCorrection { shift_m: three(std[0]), turn_rad: three(std[1]) };
    }
    let (shift, turn) = (three(std[0]), three(std[1]));
    let frame: Isometry3<f64> = exp(&Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z));
    truth.tags.iter_mut().for_each(|tag| *tag = frame * *tag);
}

/// Travels at which the tool error is evaluated.
fn task(robot: &Robot, seed: u64) -> Vec<JointAngles> {
    let mut rng = rng(seed, "within sigmas: task");
    let half = |j: usize| robot.sensors[j].half_range_rad.min(1.3);
    (0..12).map(|_| JointAngles::from_fn(robot.n_joints(), |j| 0.25 * half(j) * normal(&mut rng))).collect()
}

/// Joint angles at these readings.
fn angles(robot: &Robot, sensors: &JointParameters, travel_rad: &JointAngles) -> JointAngles {
    let still = ConditionChange::default();
    JointAngles::from_fn(robot.n_joints(), |j| {
        sensors.correction(j).angle_rad(&robot.sensors[j], travel_rad[j], &still, 0.0)
    })
}

fn tool_m(robot: &Robot, sensors: &JointParameters, travel_rad: &JointAngles) -> Vector3<f64> {
    let arm = sensors.with_links(robot.clone());
    arm.chain.frame(&angles(robot, sensors, travel_rad), &arm.tool.mount).translation.vector
}

struct Errors {
    /// Squared distances of the tool over the task, m^2.
    squares_m2: Vec<f64>,
    /// Normalized estimation error squared: with only the data, and with priors.
    nees: [f64; 2],
    is_revised: bool,
}

fn errors(robot: &Robot, seed: u64) -> Errors {
    let real = real_arm(robot, seed);
    let mut sensors = JointParameters::default();
    let (views, model) = views_of_changed(robot, &real, seed, |truth| {
        change_truth(robot, truth, seed);
        sensors = truth.parameters;
    });
    let as_drawn = input(robot, &views, &model);
    let (drawing, found) = revised(&as_drawn);
    let (task, believed) = (task(robot, seed), found.parameters());
    let at: Vec<JointAngles> = task.iter().map(|travel_rad| angles(robot, &believed, travel_rad)).collect();
    let known = believed.with_links(robot.clone());
    let of_sensors = believed.sensors(&known);
    // The reference for the tool is the sensors' curves, without the errors from view to view.
    let by_data = ParameterCovariance {
        parameters: found.joint_parameters().to_vec(),
        matrix: found.joint_covariance(),
        residual_std_rad: Some([0.0; MAX_JOINTS]),
    };
    let by_priors = found.prior_impact(&at, 0.0).covariances_m2;
    let (mut squares_m2, mut nees) = (Vec::new(), [0.0; 2]);
    for ((travel_rad, at), by_priors) in task.iter().zip(&at).zip(&by_priors) {
        let error = tool_m(robot, &believed, travel_rad) - tool_m(&real, &sensors, travel_rad);
        let data: Matrix3<f64> = by_data.tool_position_m2(&known, &of_sensors, at);
        squares_m2.push(error.norm_squared());
        for (sum, covariance) in nees.iter_mut().zip([data, data + by_priors]) {
            *sum += error.dot(&(covariance.try_inverse().expect("regular") * error)) / task.len() as f64;
        }
    }
    Errors { squares_m2, nees, is_revised: drawing != Drawing::default() }
}

#[test]
fn the_error_with_priors_is_the_error() {
    errors_are_as_predicted(5, 1.4..4.8);
}

#[test]
#[ignore = "second tier: 24 seeds, 12 s"]
fn the_error_with_priors_is_the_error_over_24_seeds() {
    errors_are_as_predicted(24, 2.2..3.8);
}

fn errors_are_as_predicted(n_seeds: u64, nees_limits: Range<f64>) {
    let robot = titan();
    let all: Vec<Errors> = (0..n_seeds).map(|seed| errors(&robot, seed)).collect();
    let mean = |of: &dyn Fn(&Errors) -> f64| all.iter().map(of).sum::<f64>() / n_seeds as f64;
    let [by_data, with_priors] = [0, 1].map(|k| mean(&|errors| errors.nees[k]));
    let m: Vec<f64> = all.iter().flat_map(|errors| errors.squares_m2.iter().map(|m2| m2.sqrt())).collect();
    let [median, p95] = [0.5, 0.95].map(|q| 1e3 * quantile(&m, q).expect("values"));
    let n_revised = all.iter().filter(|errors| errors.is_revised).count();
    println!(
        "tool error {median:.2}, {p95:.2} mm; NEES by data {by_data:.2}, with priors {with_priors:.2}; revised \
         {n_revised} of {n_seeds}"
    );
    assert!(nees_limits.contains(&with_priors), "{with_priors}");
    assert!(by_data > 1.5 * with_priors, "{by_data}, {with_priors}");
}

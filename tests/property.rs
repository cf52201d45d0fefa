//! Properties for any input: analytic Jacobians are derivatives, and no result depends on the order of equal elements.

use armcal::calib::{PositionProblem, associate, calibrate};
use armcal::kinematics::{IkGoal, IkSettings, JointLimits, solve_position};
use armcal::model::{JointParameters, Parameter, ParameterKind};
use armcal::routine::Method;
use armcal::stats::stream_rng;
use armcal::streams::{CaptureSet, JointAngles, Message};
use nalgebra::{DVector, Matrix2x3, Vector3};
use rand::RngExt;
use rand::seq::SliceRandom;

use crate::support::synthetic::{TrueArm, add_noise};
use crate::support::titan;

/// Step of central differences in rad (or of a gain): truncation h^2 and rounding 1e-16/h are both about 1e-10.
const STEP: f64 = 1e-5;
/// Tolerance of central differences with that step for positions of a few m, with room for the third derivative.
const DIFFERENCE_TOLERANCE: f64 = 1e-8;

#[test]
fn point_jacobian_is_the_derivative_of_the_tool_point() {
    let robot = titan();
    let mut rng = stream_rng(1, "point_jacobian");
    let tool_m = |angles: &JointAngles| robot.chain.link_poses(angles).frame(&robot.tool.mount).translation.vector;
    for _ in 0..10 {
        let angles = JointAngles::from_fn(6, |_| rng.random_range(-3.0..3.0));
        let poses = robot.chain.link_poses(&angles);
        for joint in 0..6 {
            let [mut low, mut high] = [angles; 2];
            (low[joint], high[joint]) = (low[joint] - STEP, high[joint] + STEP);
            let numeric = (tool_m(&high) - tool_m(&low)) / (2.0 * STEP);
            let analytic = poses.point_jacobian(joint, &tool_m(&angles));
            assert!((numeric - analytic).amax() < DIFFERENCE_TOLERANCE, "joint {joint} at {angles:?}");
        }
    }
}

#[test]
fn linearize_is_the_derivative_of_its_residuals() {
    let robot = titan();
    let mut rng = stream_rng(1, "linearize");
    let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
    let data = associate(&arm.recording(&arm.shots(CaptureSet::Fit, 6, &mut rng)), &robot);
    let problem = PositionProblem::new(&robot, &data.fit);
    let all: Vec<Parameter> = (0..robot.n_joints())
        .flat_map(|joint| [ParameterKind::Gain, ParameterKind::Offset].map(|kind| Parameter { joint, kind }))
        .collect();
    for _ in 0..5 {
        let mut at = JointParameters::default();
        for &parameter in &all {
            at.set(parameter, at.get(parameter) + rng.random_range(-0.1..0.1));
        }
        let (residuals, jacobian) = problem.linearize(&at, &all);
        assert_eq!(residuals.len(), 3 * problem.n_observations());
        for (column, &parameter) in all.iter().enumerate() {
            let at_step = |step: f64| -> DVector<f64> {
                let mut moved = at;
                moved.set(parameter, at.get(parameter) + step);
                problem.linearize(&moved, &[]).0
            };
            let numeric = (at_step(STEP) - at_step(-STEP)) / (2.0 * STEP);
            let off = (numeric - jacobian.column(column)).amax();
            assert!(off < DIFFERENCE_TOLERANCE, "{}: {off}", parameter.name(&robot));
        }
        // The distances of the residuals are the paper's objective.
        let sum: f64 = residuals.as_slice().chunks(3).map(|r| Vector3::from_column_slice(r).norm()).sum();
        assert!((sum - problem.sum_of_distances_m(&at)).abs() < 1e-9 * sum);
    }
}

#[test]
fn lens_jacobian_is_the_derivative_of_the_projection() {
    /// Tolerance, px/m: third derivatives at 0.2 m are about 1e5 px/m3, times h^2 / 6, plus rounding of 1e3 px.
    const TOLERANCE_PX_M: f64 = 1e-4;
    let lens = titan().camera.lens;
    let mut rng = stream_rng(1, "lens");
    for _ in 0..20 {
        let (angle, turn) = (rng.random_range(0.01..1.35_f64), rng.random_range(0.0..std::f64::consts::TAU));
        let direction = Vector3::new(angle.sin() * turn.cos(), angle.sin() * turn.sin(), angle.cos());
        let point_m = direction * rng.random_range(0.2..3.0);
        let (_, analytic) = lens.project_with_jacobian(&point_m).expect("in view");
        let mut numeric = Matrix2x3::zeros();
        for axis in 0..3 {
            let step = Vector3::ith(axis, STEP);
            let [low, high] = [point_m - step, point_m + step].map(|p| lens.project(&p).expect("in view"));
            numeric.set_column(axis, &((high - low) / (2.0 * STEP)));
        }
        assert!((numeric - analytic).amax() < TOLERANCE_PX_M, "{point_m}: {}", (numeric - analytic).amax());
    }
}

#[test]
fn pixels_round_trip_over_the_whole_image() {
    /// Tolerance, px: Newton's method ends at 1e-15 rad; 400 px/rad and rounding at 1e3 px.
    const TOLERANCE_PX: f64 = 1e-9;
    let lens = titan().camera.lens;
    for u in (0..1224).step_by(51) {
        for v in (0..1024).step_by(33) {
            let pixel = nalgebra::Vector2::new(f64::from(u), f64::from(v));
            let Some(direction) = lens.unproject(&pixel) else { continue };
            let back = lens.project(&(direction.into_inner() * 1.7)).expect("in view");
            assert!((back - pixel).amax() < TOLERANCE_PX, "{pixel}");
        }
    }
}

/// Inverse kinematics finds a pose with the same tool position, for the tool position of any pose.
#[test]
fn inverse_kinematics_reaches_what_forward_kinematics_gives() {
    const TOLERANCE_M: f64 = 1e-6;
    /// Least share of random goals and starts that succeed; 0.65 do. The others end in a corner of the limits, and
    /// planning tries another start.
    const SHARE: f64 = 0.5;
    let robot = titan();
    let mut rng = stream_rng(1, "inverse");
    let turn = JointLimits { lower_rad: -std::f64::consts::PI, upper_rad: std::f64::consts::PI };
    let limits: Vec<JointLimits> = robot.chain.joints().iter().map(|j| j.limits.unwrap_or(turn)).collect();
    let settings = IkSettings { limits, locked: vec![false; 6], tolerance_m: TOLERANCE_M, max_iterations: 200 };
    let mut reached = 0;
    for _ in 0..200 {
        let mut draw = || {
            JointAngles::from_fn(6, |j| rng.random_range(settings.limits[j].lower_rad..settings.limits[j].upper_rad))
        };
        let (wanted, start) = (draw(), draw());
        let tool_m = |angles: &JointAngles| robot.chain.link_poses(angles).frame(&robot.tool.mount).translation.vector;
        let goal = IkGoal { position_m: tool_m(&wanted) };
        let Ok(found) = solve_position(&robot.chain, &robot.tool.mount, &goal, &start, &settings) else { continue };
        reached += 1;
        assert!((tool_m(&found) - goal.position_m).norm() < TOLERANCE_M);
        for (angle, limits) in found.iter().zip(&settings.limits) {
            assert!((limits.lower_rad..=limits.upper_rad).contains(angle), "{found:?}");
        }
    }
    eprintln!("{reached} of 200 reached");
    assert!(f64::from(reached) > SHARE * 200.0, "{reached}");
}

/// Messages of one log time, and tags of one image, may be in any order.
#[test]
fn calibration_does_not_depend_on_the_order_of_messages_and_tags() {
    let robot = titan();
    let mut rng = stream_rng(1, "order");
    let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
    let mut shots = arm.shots(CaptureSet::Fit, 12, &mut rng);
    shots.extend(arm.shots(CaptureSet::HeldOut, 4, &mut rng));
    add_noise(&mut shots, 0.3, &mut rng);
    let recording = arm.recording(&shots);
    let mut shuffled = recording.clone();
    shuffled.messages.shuffle(&mut rng);
    for (_, message) in &mut shuffled.messages {
        if let Message::Detections(detections) = message {
            detections.tags.reverse();
        }
    }
    for method in [Method::MinimumDistance, Method::Bundle] {
        let [mut a, mut b] = [&recording, &shuffled].map(|r| calibrate(r, &robot, method).expect("calibrated"));
        // The hash covers the messages in their order.
        a.messages_hash.clear();
        b.messages_hash.clear();
        assert_eq!(a, b, "{method}");
    }
}

/// A sensor with a thousand times finer counts is the same sensor.
#[test]
fn counts_rescaled_by_a_thousand_change_nothing() {
    const FACTOR: f64 = 1000.0;
    let robot = titan();
    let mut fine_robot = robot.clone();
    for sensor in &mut fine_robot.sensors {
        for value in [
            &mut sensor.offset_counts,
            &mut sensor.counts_per_rad,
            &mut sensor.wrap_counts,
            &mut sensor.noise_std_counts,
        ] {
            *value *= FACTOR;
        }
    }
    let mut rng = stream_rng(2, "scale");
    let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
    let mut shots = arm.shots(CaptureSet::Fit, 14, &mut rng);
    shots.extend(arm.shots(CaptureSet::HeldOut, 4, &mut rng));
    add_noise(&mut shots, 0.3, &mut rng);
    let recording = arm.recording(&shots);
    let mut fine = recording.clone();
    for (_, message) in &mut fine.messages {
        if let Message::JointSensors(sample) = message {
            sample.counts.iter_mut().for_each(|counts| *counts *= FACTOR);
        }
    }
    // Relative tolerances: rounding of travels from words a thousand times as large; BOBYQA stops within 1e-7 of a
    // prior's sigma.
    for (method, tolerance) in [(Method::MinimumDistance, 1e-6), (Method::Bundle, 1e-9)] {
        let a = calibrate(&recording, &robot, method).expect("calibrated");
        let b = calibrate(&fine, &fine_robot, method).expect("calibrated");
        for (a, b) in a.joint.iter().zip(&b.joint) {
            let (gain_a, gain_b) = (a.gain_over_datasheet.expect("a gain"), b.gain_over_datasheet.expect("a gain"));
            assert!((gain_a - gain_b).abs() < tolerance, "{method}, {}: {gain_a} {gain_b}", a.name);
            let off = (a.offset_rad - b.offset_rad).abs();
            assert!(off < tolerance * a.offset_rad.abs().max(a.offset_std_rad), "{method}, {}: {off}", a.name);
        }
    }
}

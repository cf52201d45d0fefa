//! Comparison with samples: parameters drawn from the covariance, the tool by forward kinematics.

use nalgebra::DVector;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::model::parameters::JointParameters;
use crate::solve::tool_error::*;
use armcal_core::sensor::Terms;
use armcal_core::spatial::skew;
use armcal_core::stats::stream_rng;
use armcal_core::streams::MAX_JOINTS;
use armcal_core::time::SIMULATION_EPOCH;

fn titan() -> Robot {
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
    armcal_core::robot::load(&folder).expect("the robot reads")
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn reference() -> Conditions {
    Conditions { oil_c: Some(20.0), pressure_pa: Some(1e7), stamp: Some(SIMULATION_EPOCH) }
}

fn some_terms() -> JointParameters {
    let mut at = JointParameters { reference: reference(), ..JointParameters::default() };
    for joint in 0..5 {
        at.gain[joint] = 1.0 + 0.01 * joint as f64;
        at.offset_rad[joint] = 0.02;
        at.terms[joint] = Terms { offset_rad_per_k: 3e-4, gain_per_k: 2e-5, ..Terms::default() };
        at.terms[joint].nonlinearity_rad[1] = 3e-3;
    }
    at
}

/// Returns standard deviations with similar effects at the tool.
fn std_of(kind: ParameterKind) -> f64 {
    match kind {
        ParameterKind::Gain => 1e-3,
        ParameterKind::Offset | ParameterKind::Shape(_) => 5e-4,
        ParameterKind::OffsetPerK => 5e-5,
        ParameterKind::GainPerK => 3e-5,
        ParameterKind::OffsetPerMpa => 2e-4,
        ParameterKind::DriftPerH => 3e-4,
        ParameterKind::HalfBacklash => 1e-3,
        ParameterKind::StepBefore(_) | ParameterKind::WalkMode(_) | ParameterKind::Bump(_) => 1e-2,
        ParameterKind::LinkShift(_) => 1e-3,
        ParameterKind::LinkTurn(_) => 5e-4,
        ParameterKind::Compliance | ParameterKind::MountCompliance(_) => 2e-6,
        ParameterKind::ToolLoad => 50.0,
    }
}

/// Returns a correlated covariance of all parameters of the first five joints.
fn covariance(rng: &mut ChaCha8Rng) -> ParameterCovariance {
    let parameters: Vec<Parameter> =
        (0..5).flat_map(|joint| ParameterKind::all().map(move |kind| Parameter { joint, kind })).collect();
    let n = parameters.len();
    let root = DMatrix::from_fn(n, n, |row, column| {
        std_of(parameters[row].kind) * (if row == column { 0.8 } else { 0.6 * normal(rng) / (n as f64).sqrt() })
    });
    ParameterCovariance { parameters, matrix: &root * root.transpose(), residual_std_rad: Some([0.0; MAX_JOINTS]) }
}

#[test]
fn the_pose_covariance_is_that_of_drawn_parameters() {
    let mut robot = titan();
    // The last joint is not estimated: the datasheet's variance is added by hand below.
    robot.sensors[5].temperature_std_rad_per_k = 4e-4;
    let mut rng = stream_rng(4, "tool error");
    let covariance = covariance(&mut rng);
    let root = covariance.matrix.clone().cholesky().expect("positive").l();
    let (at, spec5) = (some_terms(), robot.sensors[5].clone());
    let sensors = at.sensors(&robot);
    let conditions =
        Conditions { oil_c: Some(35.0), pressure_pa: Some(1.6e7), stamp: Some(SIMULATION_EPOCH.plus_s(7200.0)) };
    let departure = conditions.departure_from(&reference());
    for _ in 0..3 {
        let angles = JointAngles::from_fn(6, |j| {
            robot.sensors[j].center_rad + rng.random_range(-0.9..0.9) * robot.sensors[j].half_range_rad
        });
        let counts = sensors.counts_under(&angles, &conditions);
        let center = robot.chain.link_poses(&angles).frame(&robot.tool.mount);
        let (mut sum, n) = (Matrix6::zeros(), 20_000);
        for _ in 0..n {
            let drawn: DVector<f64> = &root * DVector::from_fn(root.nrows(), |_, _| normal(&mut rng));
            let mut other = at;
            for (parameter, step) in covariance.parameters.iter().zip(drawn.iter()) {
                other.set(*parameter, other.get(*parameter) + step);
            }
            other.gain[5] += spec5.gain_std * normal(&mut rng);
            other.offset_rad[5] += spec5.offset_std_rad * normal(&mut rng);
            other.terms[5].offset_rad_per_k += spec5.temperature_std_rad_per_k * normal(&mut rng);
            let moved = robot.chain.link_poses(&other.sensors(&robot).angles_under(&counts, &conditions));
            let tool = moved.frame(&robot.tool.mount);
            let by = tool.translation.vector - center.translation.vector;
            let turn = (tool.rotation * center.rotation.inverse()).scaled_axis();
            let error = Vector6::new(by.x, by.y, by.z, turn.x, turn.y, turn.z);
            sum += error * error.transpose() / f64::from(n);
        }
        let predicted = covariance.tool_pose(&robot, &sensors, &angles, &conditions);
        for row in 0..6 {
            for column in 0..6 {
                let scale = (predicted[(row, row)] * predicted[(column, column)]).sqrt();
                let apart = (predicted[(row, column)] - sum[(row, column)]) / scale;
                // The tolerance covers five standard deviations of a sample covariance, and the second order of the
                // kinematics.
                assert!(apart.abs() < 0.06, "{row} {column}: {apart}\n{predicted}{sum}");
            }
        }
        let position = covariance.tool_position_under_m2(&robot, &sensors, &angles, &conditions);
        assert!((position - predicted.fixed_view::<3, 3>(0, 0)).amax() < 1e-12 * position.amax());
        assert!(departure.oil_k == 15.0 && departure.elapsed_h == 2.0);
    }
}

#[test]
fn residuals_play_and_drift_add_what_they_are() {
    let mut robot = titan();
    robot.sensors.iter_mut().for_each(|spec| spec.drift_std_rad_per_sqrt_h = 1e-3);
    let angles = robot.stowed;
    let empty = |residual_std_rad| ParameterCovariance {
        parameters: Vec::new(),
        matrix: DMatrix::zeros(0, 0),
        residual_std_rad,
    };
    let at = JointParameters { reference: reference(), ..JointParameters::default() };
    let sensors = at.sensors(&robot);
    let poses = robot.chain.link_poses(&angles);
    let tool = poses.frame(&robot.tool.mount).translation.vector;
    let by = |joint: usize| -> Matrix3<f64> { outer(&poses.point_jacobian(joint, &tool)) };
    let position = |covariance: &ParameterCovariance, sensors: &ArmSensors, at: &Conditions| {
        covariance.tool_position_under_m2(&robot, sensors, &angles, at)
    };
    let near = |found: Matrix3<f64>, expected: Matrix3<f64>| {
        assert!((found - expected).amax() < 1e-12 * found.amax().max(1e-9), "{found}{expected}");
    };
    let none = position(&empty(Some([0.0; MAX_JOINTS])), &sensors, &reference());
    let mut only_third = [0.0; MAX_JOINTS];
    only_third[2] = 1e-2;
    near(position(&empty(Some(only_third)), &sensors, &reference()) - none, by(2) * 1e-4);
    let linearity: Matrix3<f64> = (0..6).map(|j| by(j) * robot.sensors[j].linearity_std_rad.powi(2)).sum();
    near(position(&empty(None), &sensors, &reference()) - none, linearity);
    // Four hours of a random walk have twice the standard deviation of one hour.
    let late = Conditions { stamp: Some(SIMULATION_EPOCH.plus_s(4.0 * 3600.0)), ..reference() };
    let drifted: Matrix3<f64> = (0..6).map(|j| by(j) * 4e-6).sum();
    near(position(&empty(Some([0.0; MAX_JOINTS])), &sensors, &late) - none, drifted);
    // The side of the backlash is unknown at the tool.
    let mut with_play = at;
    with_play.terms[1].half_backlash_rad = 2e-3;
    let found = position(&empty(Some([0.0; MAX_JOINTS])), &with_play.sensors(&robot), &reference());
    near(found - none, by(1) * 4e-6);
    let axis = *poses.axis(1);
    let pose = empty(Some([0.0; MAX_JOINTS])).tool_pose(&robot, &with_play.sensors(&robot), &angles, &reference())
        - empty(Some([0.0; MAX_JOINTS])).tool_pose(&robot, &sensors, &angles, &reference());
    near(pose.fixed_view::<3, 3>(3, 3).into_owned(), axis * axis.transpose() * 4e-6);
    near(
        pose.fixed_view::<3, 3>(0, 3).into_owned(),
        skew(&axis) * (tool - poses.joint_origin(1)) * axis.transpose() * 4e-6,
    );
}

/// Without observations, the shape has its prior. It is narrower at the ends of the range, because the functions vanish
/// beyond.
#[test]
fn a_shape_that_nothing_determined_is_as_wide_as_its_prior() {
    let robot = titan();
    let std = armcal_core::sensor::shape_prior(0.3);
    let parameters: Vec<Parameter> = (0..armcal_core::sensor::N_SHAPE as u8)
        .map(|h| Parameter { joint: 0, kind: ParameterKind::Shape(h) })
        .collect();
    let matrix = DMatrix::from_diagonal(&DVector::from_fn(parameters.len(), |h, _| (2e-3 * std[h]).powi(2)));
    let wide = ParameterCovariance { parameters, matrix, residual_std_rad: Some([0.0; MAX_JOINTS]) };
    let none = ParameterCovariance {
        parameters: Vec::new(),
        matrix: DMatrix::zeros(0, 0),
        residual_std_rad: wide.residual_std_rad,
    };
    let sensors = ArmSensors::nominal(&robot);
    for share in [-0.6, -0.2, 0.5] {
        let mut angles = robot.stowed;
        angles[0] = robot.sensors[0].center_rad + share * robot.sensors[0].half_range_rad;
        let poses = robot.chain.link_poses(&angles);
        let tool = poses.frame(&robot.tool.mount).translation.vector;
        let lever_m2 = poses.point_jacobian(0, &tool).norm_squared();
        let more = wide.tool_position_m2(&robot, &sensors, &angles) - none.tool_position_m2(&robot, &sensors, &angles);
        let found_std_rad = (more.trace() / lever_m2).sqrt();
        assert!((found_std_rad / 2e-3 - 1.0).abs() < 0.05, "{share}: {found_std_rad}");
    }
}

//! Rapier's multibody compared with Pinocchio's golden values, Runge-Kutta, and our own equations.

use serde::Deserialize;

use super::*;
use crate::dynamics::{BaseCoupling, Environment, EquationInput, Motion, Multibody};
use crate::physics::engine::Engine;
use crate::physics::featherstone::Featherstone;
use crate::physics::rapier::RapierArm;
use crate::solids::Solids;
use armcal_core::kinematics::{IkGoal, IkSettings, JointLimits, solve_position};
use armcal_core::robot::load_vehicle;
use armcal_core::routine::Scene;

#[derive(Deserialize)]
struct Golden {
    gravity_m_s2: f64,
    gravity_torques: GravityTorques,
    accelerations: Accelerations,
}

#[derive(Deserialize)]
struct GravityTorques {
    cases: Vec<GravityTorque>,
}

#[derive(Deserialize)]
struct GravityTorque {
    q: Vec<f64>,
    gravity_torque: Vec<f64>,
}

#[derive(Deserialize)]
struct Accelerations {
    cases: Vec<Acceleration>,
}

#[derive(Deserialize)]
struct Acceleration {
    q: Vec<f64>,
    qd: Vec<f64>,
    tau: Vec<f64>,
    qdd: Vec<f64>,
}

fn golden() -> Golden {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden/dynamics.json");
    serde_json::from_str(&std::fs::read_to_string(file).expect("the file reads")).expect("as expected")
}

fn rapier_arm(robot: &Robot, water: &WaterSpec, step_s: f64) -> RapierArm {
    let spec = PhysicsSpec { step_s, ..PhysicsSpec::default() };
    let water = WaterProperties::of(water);
    let bodies = robot.bodies.iter().map(|link| Body::link(link, &water)).collect();
    let input = PhysicsInput {
        chain: &robot.chain,
        bodies,
        free_base: None,
        solids: None,
        engine: EngineKind::Rapier,
        spec: &spec,
        angles: robot.stowed,
    };
    RapierArm::new(input).expect("an arm")
}

/// Advances by one step from a state at rest or moving; returns the accelerations.
fn accelerations(arm: &mut RapierArm, case: &Acceleration, gravity_m_s2: f64, step_s: f64) -> Vec<f64> {
    let (q, qd) = (JointAngles::from_slice(&case.q), JointAngles::from_slice(&case.qd));
    arm.place(&q, &qd);
    let base = still(Vector3::new(0.0, 0.0, -gravity_m_s2));
    let load = |j| JointLoad { constant_n_m: case.tau.get(j).copied().unwrap_or(0.0), ..JointLoad::default() };
    arm.step(&drive([&base; 2], &std::array::from_fn(load)));
    (0..q.len()).map(|j| (arm.rates()[j] - qd[j]) / step_s).collect()
}

fn off(found: &[f64], expected: &[f64]) -> f64 {
    let norm = |v: Vec<f64>| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    norm(found.iter().zip(expected).map(|(a, b)| a - b).collect()) / norm(expected.to_vec())
}

#[test]
fn rapiers_gravity_torques_are_those_of_pinocchio() {
    let (robot, file) = (titan(), golden());
    let arm = rapier_arm(&robot, &DRY, 2e-3);
    let gravity = Vector3::new(0.0, 0.0, -file.gravity_m_s2);
    for case in &file.gravity_torques.cases {
        let torques = arm.static_torques(&gravity, &JointAngles::from_slice(&case.q));
        let held: Vec<f64> = torques.iter().map(|torque| -torque).collect();
        assert!(off(&held, &case.gravity_torque) < 1e-9, "{held:?} {:?}", case.gravity_torque);
    }
}

/// Simulates a base that moves in all six directions, in moving water, with drag and added mass. Returns the largest
/// difference of an angle from our own equations with a step of 0.25 ms, rad.
fn swung_in_the_sea(step_s: f64, expected: &[JointAngles]) -> f64 {
    let (robot, mut worst) = (titan(), 0.0_f64);
    let mut arm = rapier_arm(&robot, &SEA, step_s);
    let every = (0.1 / step_s).round() as usize;
    sea_swing(&mut arm, step_s, |i, angles| {
        if (i + 1) % every == 0 {
            worst = worst.max(angles.max_abs_difference(&expected[(i + 1) / every - 1]));
        }
    });
    worst
}

fn sea_swing(arm: &mut dyn Engine, step_s: f64, mut seen: impl FnMut(usize, &JointAngles)) {
    let spec = VehicleMotionSpec {
        rotation_rms_rad: 0.2,
        translation_rms_m: 0.4,
        period_min_s: 2.0,
        period_max_s: 4.0,
        ramp_s: 0.0,
        ..VehicleMotionSpec::default()
    };
    let motion = VehicleMotion::new(&spec, None, Pose::from_position_rpy([1.7, -0.6, 0.1], [0.1, 0.2, -0.4]), 5);
    let sea = crate::vehicle::Sea::new(&SEA, 5);
    let loads = [JointLoad { damping_n_m_s_rad: 20.0, ..JointLoad::default() }; MAX_JOINTS];
    for i in 0..(3.0 / step_s).round() as usize {
        let [t, next] = [i, i + 1].map(|k| k as f64 * step_s);
        let base = [&motion.at(t), &motion.at(next)];
        arm.step(&Drive { base, water: [sea.at(t), sea.at(next)], wrenches: &NO_WRENCHES, loads: &loads });
        seen(i, &arm.angles());
    }
}

const SEA: WaterSpec = WaterSpec {
    density_kg_m3: 1025.0,
    drag_coefficient: 1.2,
    buoyancy_fraction: Some(0.22),
    added_mass_coefficient: 1.0,
    current_m_s: [0.4, -0.2, 0.1],
    wave_height_m: 2.0,
    depth_m: 10.0,
    ..DRY
};

#[test]
fn rapier_converges_to_our_equations_in_a_sea() {
    let robot = titan();
    let spec = PhysicsSpec { step_s: 2.5e-4, ..PhysicsSpec::default() };
    let water = WaterProperties::of(&SEA);
    let bodies = robot.bodies.iter().map(|link| Body::link(link, &water)).collect();
    let (chain, angles, engine) = (&robot.chain, robot.stowed, EngineKind::Featherstone);
    let input = PhysicsInput { chain, bodies, free_base: None, solids: None, engine, spec: &spec, angles };
    let mut expected = Vec::new();
    sea_swing(&mut Featherstone::new(input), 2.5e-4, |i, angles| {
        if (i + 1) % 400 == 0 {
            expected.push(*angles);
        }
    });
    let moved = expected.iter().map(|angles| angles.max_abs_difference(&robot.stowed)).fold(0.0, f64::max);
    let errors = [2e-3, 1e-3, 5e-4, 2.5e-4].map(|step_s| swung_in_the_sea(step_s, &expected));
    eprintln!("free in a sea, moved by {moved:.2} rad: off by {errors:?} rad at 2, 1, 0.5, 0.25 ms");
    assert!(moved > 0.5 && errors[0] < 0.05, "{moved} {errors:?}");
    for pair in errors.windows(2) {
        assert!(pair[0] / pair[1] > 1.7, "of first order at least: {errors:?}");
    }
}

#[test]
fn rapiers_accelerations_are_those_of_pinocchio() {
    let (robot, file) = (titan(), golden());
    let mut worst = Vec::new();
    for step_s in [1e-4, 1e-5, 1e-6] {
        let mut arm = rapier_arm(&robot, &DRY, step_s);
        let cases = file.accelerations.cases.iter();
        worst.push(
            cases
                .map(|case| off(&accelerations(&mut arm, case, file.gravity_m_s2, step_s), &case.qdd))
                .fold(0.0, f64::max),
        );
    }
    eprintln!("accelerations off by {worst:?} at 100, 10, 1 us");
    assert!(worst[0] < 1e-3, "{worst:?}");
    // The error is of first order: a tenth of the step leaves a tenth of the difference.
    for pair in worst.windows(2) {
        assert!((9.0..11.0).contains(&(pair[0] / pair[1])), "{worst:?}");
    }
}

#[test]
fn rapier_swings_the_shaken_pendulum() {
    let total = INERTIA + MASS * LENGTH * LENGTH;
    let exact = runge_kutta(|t, q| MASS * LENGTH * (shake(t) * q.cos() - 9.81 * q.sin()) / total, 0.5, SWING_S);
    let errors = [4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4].map(|step_s| shaken(EngineKind::Rapier, step_s) - exact);
    eprintln!("shaken base: off by {errors:?} rad at 4, 2, 1, 0.5, 0.25 ms");
    assert!(errors[1].abs() < 1e-3, "{errors:?}");
}

/// Returns the solids, and a configuration with the tool 9 cm above the vehicle's toe plate.
fn above_the_plate(robot: &Robot) -> (Solids, JointAngles) {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/vehicles/work-class-front.toml");
    let vehicle = load_vehicle(std::path::Path::new(file)).expect("the vehicle reads");
    let goal = IkGoal { position_m: Vector3::new(1.34, -0.1, -0.90) };
    let any = JointLimits { lower_rad: -3.1, upper_rad: 3.1 };
    let limits = robot.chain.joints().iter().map(|j| j.limits.unwrap_or(any)).collect();
    let settings = IkSettings { limits, locked: vec![false; 6], tolerance_m: 1e-3, max_iterations: 500 };
    let angles = solve_position(&robot.chain, &robot.tool.mount, &goal, &robot.stowed, &settings).expect("in reach");
    (Solids::new(robot, &vehicle, &Scene::default()), angles)
}

/// Index of the joint that swings; springs hold the others.
const SWINGING: usize = 1;

/// Swings an arm at the vehicle about one joint. Returns its momentum about that joint (N m s) just before contact, and
/// the momentum that it loses until it no longer approaches.
fn impact(engine: EngineKind, water: &WaterSpec, step_s: f64) -> [f64; 2] {
    let robot = titan();
    let (solids, angles) = above_the_plate(&robot);
    let water = WaterProperties::of(water);
    let bodies: Vec<Body> = robot.bodies.iter().map(|link| Body::link(link, &water)).collect();
    let spec = PhysicsSpec { step_s, ..PhysicsSpec::default() };
    let equations = Multibody::new(robot.chain.clone(), bodies.clone());
    let chain = &robot.chain;
    let input = PhysicsInput { chain, bodies, free_base: None, solids: Some(&solids), engine, spec: &spec, angles };
    let mut arm = ArmPhysics::new(input).expect("an arm");
    let momentum = |arm: &ArmPhysics| {
        let (angles, rates) = (&arm.angles(), &arm.rates());
        let base = &BaseCoupling::Prescribed(Motion::zero());
        let (around, extra) = (&Environment::still(0.0), &[Force::zero(); MAX_JOINTS + 1]);
        let inertia = equations.equations(&EquationInput { angles, rates, around, base, extra }).inertia;
        (0..6).map(|j| inertia.get(SWINGING, j) * rates[j]).sum::<f64>()
    };
    let mut loads: [JointLoad; MAX_JOINTS] =
        std::array::from_fn(|j| JointLoad::spring(5e6, 5e4, if j < 6 { angles[j] } else { 0.0 }, 0.0));
    loads[SWINGING] = JointLoad::default();
    let base = still(Vector3::zeros());
    arm.push(6, &robot.bodies[6].com_m, &Vector3::new(0.0, 0.0, -300.0), 0.1);
    let mut before = 0.0;
    for _ in 0..(2.0 / step_s) as u32 {
        arm.step(&drive([&base; 2], &loads));
        let mut touches = false;
        arm.for_each_contact(|_, _| touches = true);
        if !touches {
            before = momentum(&arm);
        } else if arm.rates()[SWINGING] * before <= 0.0 {
            return [before, before - momentum(&arm)];
        }
    }
    panic!("it must touch");
}

#[test]
fn the_vehicle_takes_the_same_momentum_from_the_arm_in_both_engines() {
    let sea = WaterSpec { buoyancy_fraction: Some(0.22), ..WaterSpec::default() };
    for (medium, water) in [("dry", DRY), ("wet", sea)] {
        for step_s in [2e-3, 1e-3] {
            let [ours, rapiers] =
                [EngineKind::Featherstone, EngineKind::Rapier].map(|engine| impact(engine, &water, step_s));
            eprintln!("{medium}, {step_s} s: before and lost {ours:.3?} and {rapiers:.3?} N m s");
            let ratio = rapiers[1] / ours[1];
            assert!((0.9..1.1).contains(&ratio), "{medium}, {step_s} s: {ratio}");
        }
    }
}

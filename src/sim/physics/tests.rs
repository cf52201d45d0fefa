//! Moving base compared with equations of motion that were derived by hand.

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

use crate::dynamics::{Body, Force, JointLoad, WaterProperties};
use crate::physics::*;
use crate::spec::{EngineKind, PhysicsSpec, Points, VehicleMotionSpec, WaterSpec};
use crate::vehicle::{BaseState, VehicleMotion, WaterMotion};
use armcal_core::kinematics::{Chain, ChainJoint};
use armcal_core::robot::{GRAVITY_M_S2, LinkBody, Robot, load};
use armcal_core::spatial::Pose;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

mod engines;

const DRY: WaterSpec = WaterSpec {
    density_kg_m3: 0.0,
    drag_coefficient: 0.0,
    buoyancy_fraction: Some(0.0),
    joint_friction_n_m_s_rad: 0.0,
    pressure_bias_std_pa: 0.0,
    pressure_scale_std: 0.0,
    depth_m: 0.0,
    dive_time_s: Points::NONE,
    dive_depth_m: Points::NONE,
    pressure_noise_pa: 0.0,
    added_mass_coefficient: 0.0,
    current_m_s: [0.0; 3],
    wave_height_m: 0.0,
    wave_period_s: 8.0,
    wave_direction_rad: 0.0,
};

fn titan() -> Robot {
    load(std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/titan4"))).expect("the robot reads")
}

/// Returns an arm without collisions.
fn physics(chain: &Chain, bodies: &[LinkBody], step_s: f64, angles: JointAngles) -> ArmPhysics {
    physics_by(EngineKind::Featherstone, chain, bodies, step_s, angles)
}

fn physics_by(engine: EngineKind, chain: &Chain, bodies: &[LinkBody], step_s: f64, angles: JointAngles) -> ArmPhysics {
    let spec = PhysicsSpec { step_s, ..PhysicsSpec::default() };
    let water = WaterProperties::of(&DRY);
    let bodies = bodies.iter().map(|link| Body::link(link, &water)).collect();
    ArmPhysics::new(PhysicsInput { chain, bodies, free_base: None, solids: None, engine, spec: &spec, angles })
        .expect("an arm")
}

/// Advances by one step without loads about the joints, while the base moves from one state to the other.
fn swing(physics: &mut ArmPhysics, from: &BaseState, to: &BaseState) {
    physics.step(&drive([from, to], &[JointLoad::default(); MAX_JOINTS]));
}

const NO_WRENCHES: [Force; MAX_JOINTS + 1] =
    [Force { moment: Vector3::new(0.0, 0.0, 0.0), force: Vector3::new(0.0, 0.0, 0.0) }; MAX_JOINTS + 1];

/// Returns the inputs of a step in still water.
fn drive<'a>(base: [&'a BaseState; 2], loads: &'a [JointLoad; MAX_JOINTS]) -> Drive<'a> {
    let still = WaterMotion { velocity: Vector3::zeros(), acceleration: Vector3::zeros() };
    Drive { base, water: [still; 2], wrenches: &NO_WRENCHES, loads }
}

fn still(gravity: Vector3<f64>) -> BaseState {
    let zero = Vector3::zeros();
    BaseState {
        world_from_vehicle: Pose::identity(),
        world_from_base: Pose::identity(),
        velocity: zero,
        acceleration: zero,
        angular_velocity: zero,
        angular_acceleration: zero,
        gravity,
        vehicle_rate: zero,
        vehicle_specific_force: zero,
    }
}

/// Mass of a bar, kg, with its centre 0.5 m from the joint.
const MASS: f64 = 5.0;
const LENGTH: f64 = 0.5;
const INERTIA: f64 = 0.1;

/// Returns one joint at `origin` about `axis`, the bar along `along`; by an engine with a step (s), from an angle
/// (rad).
fn pendulum(
    origin: Vector3<f64>,
    axis: Unit<Vector3<f64>>,
    along: Vector3<f64>,
    start: (EngineKind, f64, f64),
) -> ArmPhysics {
    let (engine, step_s, angle) = start;
    let joint = ChainJoint {
        name: "j".into(),
        child_link: "bar".into(),
        kind: armcal_core::kinematics::JointKind::Revolute,
        parent_from_joint: Isometry3::translation(origin.x, origin.y, origin.z),
        axis,
        limits: None,
    };
    let body = |name: &str| LinkBody {
        name: name.into(),
        mass_kg: MASS,
        com_m: LENGTH * along,
        inertia_kg_m2: Matrix3::identity() * INERTIA,
        bad_inertia: None,
        visuals: Vec::new(),
        collisions: Vec::new(),
    };
    let bodies = [body("base"), body("bar")];
    physics_by(engine, &Chain::new(vec![joint]), &bodies, step_s, JointAngles::from_slice(&[angle]))
}

/// Integrates `angle'' = f(t, angle)` by classic Runge-Kutta.
fn runge_kutta(f: impl Fn(f64, f64) -> f64, start: f64, end_s: f64) -> f64 {
    let (n, mut q, mut v) = (200_000, start, 0.0);
    let h = end_s / f64::from(n);
    for i in 0..n {
        let t = f64::from(i) * h;
        let k1 = (v, f(t, q));
        let k2 = (v + 0.5 * h * k1.1, f(t + 0.5 * h, q + 0.5 * h * k1.0));
        let k3 = (v + 0.5 * h * k2.1, f(t + 0.5 * h, q + 0.5 * h * k2.0));
        let k4 = (v + h * k3.1, f(t + h, q + h * k3.0));
        q += h / 6.0 * (k1.0 + 2.0 * k2.0 + 2.0 * k3.0 + k4.0);
        v += h / 6.0 * (k1.1 + 2.0 * k2.1 + 2.0 * k3.1 + k4.1);
    }
    q
}

const SWING_S: f64 = 6.0;

/// Simulates a pendulum that hangs from a base shaken by 0.3 m at 0.5 Hz along x.
fn shaken(engine: EngineKind, step_s: f64) -> f64 {
    let mut physics = pendulum(Vector3::zeros(), Vector3::y_axis(), -Vector3::z(), (engine, step_s, 0.5));
    let base = |t_s: f64| {
        let mut base = still(Vector3::new(0.0, 0.0, -9.81));
        base.acceleration.x = shake(t_s);
        base
    };
    for i in 0..(SWING_S / step_s).round() as u32 {
        let t_s = f64::from(i) * step_s;
        swing(&mut physics, &base(t_s), &base(t_s + step_s));
    }
    physics.angles()[0]
}

fn shake(t_s: f64) -> f64 {
    let w = std::f64::consts::TAU * 0.5;
    -0.3 * w * w * (w * t_s).sin()
}

/// A base that moves kinematically exerts no inertial force on a multibody: the pendulum would not notice the shaking.
#[test]
fn a_shaken_base_swings_the_pendulum() {
    // For a turn q about y, the bar's centre is at LENGTH (-sin q, -cos q) in x and z.
    let total = INERTIA + MASS * LENGTH * LENGTH;
    let exact = runge_kutta(|t, q| MASS * LENGTH * (shake(t) * q.cos() - 9.81 * q.sin()) / total, 0.5, SWING_S);
    let unshaken = runge_kutta(|_, q| -MASS * LENGTH * 9.81 * q.sin() / total, 0.5, SWING_S);
    let errors = [4e-3, 2e-3, 1e-3].map(|step_s| shaken(EngineKind::Featherstone, step_s) - exact);
    eprintln!("exact {exact:.6} unshaken {unshaken:.4}, errors at 4, 2, 1 ms {errors:?}");
    for (step_s, error) in [4e-3, 2e-3, 1e-3].iter().zip(errors) {
        eprintln!("plot convergence/pendulum {step_s} {:e}", error.abs());
    }
    assert!((exact - unshaken).abs() > 0.3, "the shaking must matter");
    assert!(errors[1].abs() < 1e-3, "{errors:?}");
    // The error is of second order: half the step leaves a quarter of it.
    for pair in errors.windows(2) {
        assert!((3.5..4.5).contains(&(pair[0] / pair[1])), "{errors:?}");
    }
}

/// On a turntable the bar swings about the outward direction: centrifugal force, and Coriolis' through the joint only.
#[test]
fn a_turning_base_pulls_the_bar_outwards() {
    let (radius, w) = (1.5, 2.0);
    let total = INERTIA + MASS * LENGTH * LENGTH;
    let exact = runge_kutta(|_, q| -MASS * radius * LENGTH * w * w * q.sin() / total, 0.8, 4.0);
    let [coarse, fine] = [4e-3, 2e-3].map(|step_s| {
        let mut physics =
            pendulum(Vector3::x() * radius, Vector3::z_axis(), Vector3::x(), (EngineKind::Featherstone, step_s, 0.8));
        let mut base = still(Vector3::zeros());
        base.angular_velocity.z = w;
        for _ in 0..(4.0 / step_s).round() as u32 {
            swing(&mut physics, &base, &base);
        }
        physics.angles()[0] - exact
    });
    eprintln!("exact {exact:.6} coarse {coarse:.2e} fine {fine:.2e}");
    assert!(fine.abs() < 1e-4, "{fine}");
    assert!((3.5..4.5).contains(&(coarse / fine)), "of second order: {}", coarse / fine);
}

/// Without torque about its axis, a bar keeps its direction in the world, however the base turns about that axis.
#[test]
fn a_base_that_speeds_up_leaves_a_free_bar_behind() {
    let mut physics =
        pendulum(Vector3::zeros(), Vector3::z_axis(), Vector3::x(), (EngineKind::Featherstone, 1e-3, 0.0));
    let base = |t: f64| {
        let mut base = still(Vector3::zeros());
        base.angular_acceleration.z = (2.0 * t).cos();
        base.angular_velocity.z = 0.5 * (2.0 * t).sin();
        base
    };
    for i in 0..2000 {
        let t = f64::from(i) * 1e-3;
        swing(&mut physics, &base(t), &base(t + 1e-3));
    }
    let turned = 0.25 * (1.0 - 4.0_f64.cos());
    assert!((physics.angles()[0] + turned).abs() < 1e-6, "{} against {}", physics.angles()[0], -turned);
}

/// The whole arm falls free on a base that moves in all six directions: d'Alembert's principle in the world frame, with
/// accelerations by differences of poses, must leave no torque about any joint.
#[test]
fn no_torque_is_missing_on_a_moving_base() {
    const STEP_S: f64 = 1e-4;
    /// Limit for torques of several 100 N m: a first-order step of 0.1 ms, and second differences.
    const LIMIT_N_M: f64 = 1.0;
    let robot = titan();
    let spec = VehicleMotionSpec {
        rotation_rms_rad: 0.25,
        translation_rms_m: 0.5,
        period_min_s: 2.0,
        period_max_s: 4.0,
        ramp_s: 0.0,
        ..VehicleMotionSpec::default()
    };
    let mount = Pose::from_position_rpy([1.7, -0.6, 0.1], [0.1, 0.2, -0.4]);
    let motion = VehicleMotion::new(&spec, None, mount, 5);
    let mut physics = physics(&robot.chain, &robot.bodies, STEP_S, robot.stowed);
    let steps = 4000;
    for i in 0..steps {
        let t = f64::from(i) * STEP_S;
        swing(&mut physics, &motion.at(t), &motion.at(t + STEP_S));
    }
    let t = f64::from(steps) * STEP_S;
    let (q, v) = (physics.angles(), physics.rates());
    swing(&mut physics, &motion.at(t), &motion.at(t + STEP_S));
    let after = physics.rates();
    let path = |s: f64| {
        let at = |j: usize| q[j] + v[j] * s + 0.5 * (after[j] - v[j]) / STEP_S * s * s;
        let poses = robot.chain.link_poses(&JointAngles::from_fn(6, at));
        (*motion.at(t + s).world_from_base.isometry(), poses)
    };
    let h = 1e-3;
    let [past, now, next] = [path(-h), path(0.0), path(h)];
    // Angular momentum halfway between two instants.
    let momentum = |body: usize, from: f64, to: f64| {
        let [a, middle, b] = [from, 0.5 * (from + to), to].map(path).map(|p| p.0 * p.1.link(body));
        let rate = (b.rotation * a.rotation.inverse()).scaled_axis() / (to - from);
        let r = middle.rotation.to_rotation_matrix();
        r * robot.bodies[body].inertia_kg_m2 * r.transpose() * rate
    };
    let mut torques = [Vector3::zeros(); 6];
    for body in 1..=6 {
        let com = |p: &(Isometry3<f64>, armcal_core::kinematics::LinkPoses)| {
            ((p.0 * p.1.link(body)) * nalgebra::Point3::from(robot.bodies[body].com_m)).coords
        };
        let acceleration = (com(&next) - com(&now) * 2.0 + com(&past)) / (h * h);
        let mass = robot.bodies[body].mass_kg;
        let force = mass * (acceleration + Vector3::z() * GRAVITY_M_S2);
        let spin = (momentum(body, 0.0, h) - momentum(body, -h, 0.0)) / h;
        for (j, torque) in torques.iter_mut().enumerate().take(body) {
            let origin = (now.0 * nalgebra::Point3::from(now.1.joint_origin(j))).coords;
            *torque += (com(&now) - origin).cross(&force) + spin;
        }
    }
    let missing: Vec<f64> = (0..6).map(|j| (now.0.rotation * now.1.axis(j)).dot(&torques[j])).collect();
    eprintln!("missing torques {missing:.3?} N m at rates {:.2?}", v.to_vec());
    assert!(v.iter().any(|rate| rate.abs() > 0.5), "it must move");
    assert!(missing.iter().all(|torque| torque.abs() < LIMIT_N_M), "{missing:?}");
}

/// Our own engine allocates no memory in a step. Rapier's factors a matrix that it allocates.
#[test]
fn a_step_of_our_own_equations_does_not_allocate() {
    const STEPS: u64 = 50;
    let robot = titan();
    let (base, loads) = (still(Vector3::new(0.0, 0.0, -GRAVITY_M_S2)), [JointLoad::default(); MAX_JOINTS]);
    let count = |engine: EngineKind| {
        let mut physics = physics_by(engine, &robot.chain, &robot.bodies, 0.002, robot.stowed);
        let before = physics.angles();
        physics.step(&drive([&base, &base], &loads));
        let counted = allocation_counter::measure(|| {
            for _ in 0..STEPS {
                physics.step(&drive([&base, &base], &loads));
            }
        });
        assert!(physics.angles() != before, "the arm falls");
        counted.count_total
    };
    let [own, rapiers] = [EngineKind::Featherstone, EngineKind::Rapier].map(count);
    eprintln!("{} allocations a step of rapier's", rapiers / STEPS);
    assert_eq!(own, 0);
    assert!(rapiers > 0, "the counter counts");
}

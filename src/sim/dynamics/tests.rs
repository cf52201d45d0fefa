//! Conservation laws and closed forms; tests/oracle compares with Pinocchio and MuJoCo.

use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};

use crate::dynamics::JointLoad;
use crate::dynamics::*;
use armcal_core::kinematics::{Chain, ChainJoint};
use armcal_core::robot::{PlacedShape, Robot, Shape, load};
use armcal_core::streams::{JointAngles, MAX_JOINTS};

const SEA: WaterProperties = WaterProperties {
    density_kg_m3: 1025.0,
    drag_coefficient: 0.0,
    added_mass_coefficient: 1.0,
    buoyancy_fraction: 0.22,
};
const G: f64 = 9.806_65;

fn titan() -> Robot {
    load(std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/titan4"))).expect("the robot reads")
}

fn at_rest(angles: JointAngles) -> SystemState {
    SystemState {
        rates: JointAngles::from_fn(angles.len(), |_| 0.0),
        angles,
        world_from_base: Isometry3::identity(),
        base_velocity: Motion::zero(),
    }
}

/// Loads on a free-floating system in water at rest.
struct Float<'a> {
    step_s: f64,
    gravity_m_s2: f64,
    /// Torques by time and joint.
    torque_n_m: &'a dyn Fn(f64, usize) -> f64,
    damping_n_m_s_rad: f64,
}

impl Float<'_> {
    fn run(&self, system: &Multibody, state: &mut SystemState, end_s: f64) {
        self.run_seen(system, state, end_s, |_, _| ());
    }

    /// Advances the system, and passes each state with its time to `see`.
    fn run_seen(
        &self,
        system: &Multibody,
        state: &mut SystemState,
        end_s: f64,
        mut seen: impl FnMut(f64, &SystemState),
    ) {
        for i in 0..(end_s / self.step_s).round() as u32 {
            // Torques of the middle of the step.
            let t = (f64::from(i) + 0.5) * self.step_s;
            let loads = std::array::from_fn(|j| JointLoad {
                constant_n_m: (self.torque_n_m)(t, j),
                damping_n_m_s_rad: self.damping_n_m_s_rad,
                ..JointLoad::default()
            });
            let around = |_: Stage, at: &SystemState| {
                let down = at.world_from_base.rotation.inverse() * Vector3::new(0.0, 0.0, -self.gravity_m_s2);
                let surroundings =
                    Environment { gravity: down, base_velocity: at.base_velocity, ..Environment::still(0.0) };
                (surroundings, BaseCoupling::Free)
            };
            let extra = [Force::zero(); MAX_JOINTS + 1];
            let input = StepInput {
                step_s: self.step_s,
                loads: &loads,
                extra: &extra,
                contacts: &[],
                is_free: true,
                around: &around,
            };
            system.step(state, &input);
            seen(f64::from(i + 1) * self.step_s, state);
        }
    }
}

/// Returns true if `t` is a multiple of `every`.
fn is_multiple(t: f64, every: f64) -> bool {
    (t / every - (t / every).round()).abs() < 1e-6
}

const SEA_KG_M3: f64 = 1025.0;

/// Returns the Titan on a vehicle of `mass_kg`, without drag, in water or, at density 0, in air.
fn on_vehicle(robot: &Robot, mass_kg: f64, density_kg_m3: f64) -> Multibody {
    let water = WaterProperties { density_kg_m3, ..SEA };
    let mut bodies: Vec<Body> = robot.bodies.iter().map(|link| Body::link(link, &water)).collect();
    let inertia = Matrix3::from_diagonal(&(Vector3::new(0.5, 0.9, 1.0) * mass_kg));
    let mut vehicle = Body::dry(mass_kg, Vector3::new(-1.7, 0.6, -0.1), &inertia);
    if density_kg_m3 > 0.0 {
        let linear = Matrix3::from_diagonal(&(Vector3::new(0.5, 1.0, 1.5) * mass_kg));
        vehicle.added = Inertia { rotational: inertia * 0.5, coupling: Matrix3::zeros(), linear };
    }
    for body in &mut bodies {
        body.surfaces.clear();
    }
    bodies[0] = vehicle;
    Multibody::new(robot.chain.clone(), bodies)
}

fn equations(
    system: &Multibody,
    angles: &JointAngles,
    rates: &JointAngles,
    around: &Environment,
    base: &BaseCoupling,
) -> Equations {
    system.equations(&EquationInput { angles, rates, around, base, extra: &[Force::zero(); MAX_JOINTS + 1] })
}

/// Returns the momentum about the world's origin in world axes.
fn world_momentum(system: &Multibody, state: &SystemState) -> Force {
    let p = system.momentum(&state.angles, &state.rates, &state.base_velocity);
    let to_world = state.world_from_base.rotation;
    let force = to_world * p.force;
    Force::new(to_world * p.moment + state.world_from_base.translation.vector.cross(&force), force)
}

fn push_about(t: f64, j: usize) -> f64 {
    [200.0, 300.0, 150.0, 40.0, 30.0, 10.0][j.min(5)] * ((1.0 + 0.3 * j as f64) * t).sin()
}

/// An arm that moves on a free vehicle in still water without drag cannot change the total momentum, which includes
/// that of the water moving with the bodies.
#[test]
fn arm_and_free_vehicle_keep_their_momentum() {
    let robot = titan();
    for (medium, density_kg_m3) in [("dry", 0.0), ("wet", SEA_KG_M3)] {
        let system = on_vehicle(&robot, 400.0, density_kg_m3);
        let drift = [4e-3, 2e-3, 1e-3].map(|step_s| {
            let mut state = at_rest(robot.stowed);
            Float { step_s, gravity_m_s2: 0.0, torque_n_m: &push_about, damping_n_m_s_rad: 50.0 }.run_seen(
                &system,
                &mut state,
                4.0,
                |t, at| {
                    if is_multiple(t, 0.04) {
                        let own = system.momentum(&at.angles, &at.rates, &Motion::zero());
                        let (own, left) = (own.moment.norm(), world_momentum(&system, at).moment.norm());
                        eprintln!("plot momentum/{medium}/{step_s} {t:.3} {left:e} {own:e}");
                    }
                },
            );
            let moved = state.angles.max_abs_difference(&robot.stowed);
            assert!(moved > 0.3 && state.world_from_base.rotation.angle() > 0.02, "it moves: {moved}");
            // Compared with the arm's own momentum.
            let own = system.momentum(&state.angles, &state.rates, &Motion::zero());
            let left = world_momentum(&system, &state);
            (left.force.norm() / own.force.norm()).max(left.moment.norm() / own.moment.norm())
        });
        eprintln!("{medium}: momentum left at 4, 2, 1 ms over the arm's own {drift:?}");
        assert!(drift[1] < 1e-4, "{drift:?}");
        assert!(drift[0] / drift[2] > 8.0, "of second order at least: {drift:?}");
    }
}

/// A bar turned about the common centre of mass of a light vehicle turns the vehicle by the ratio of inertias.
#[test]
fn a_light_vehicle_is_rocked_as_predicted() {
    let chain = Chain::new(vec![ChainJoint {
        name: "j".into(),
        child_link: "bar".into(),
        kind: armcal_core::kinematics::JointKind::Revolute,
        parent_from_joint: Isometry3::identity(),
        axis: Vector3::y_axis(),
        limits: None,
    }]);
    let bar = Body::dry(20.0, Vector3::zeros(), &Matrix3::from_diagonal(&Vector3::new(1.0, 8.0, 8.0)));
    let vehicle = Body::dry(100.0, Vector3::zeros(), &(Matrix3::identity() * 30.0));
    let system = Multibody::new(chain, vec![vehicle, bar]);
    let mut state = at_rest(JointAngles::from_slice(&[0.0]));
    let torque = |t: f64, j: usize| if j == 0 { 20.0 * t.cos() } else { 0.0 };
    let float = Float { step_s: 2e-3, gravity_m_s2: 0.0, torque_n_m: &torque, damping_n_m_s_rad: 0.0 };
    float.run_seen(&system, &mut state, 3.0, |t, at| {
        if is_multiple(t, 0.05) {
            // Both from rest under the same torque: 20 cos t on 8 and on 30 kg m2.
            let (vehicle, exact) = (at.world_from_base.rotation.scaled_axis().y, -20.0 / 30.0 * (1.0 - t.cos()));
            eprintln!("plot light-vehicle {t:.3} {vehicle:e} {exact:e} {:e}", at.angles[0]);
        }
    });
    let turned = state.world_from_base.rotation.scaled_axis().y;
    assert!(state.angles[0].abs() > 0.5);
    assert!((turned + 8.0 / 38.0 * state.angles[0]).abs() < 1e-6, "{turned} {}", state.angles[0]);
}

/// The numerical damping is negligible: an undamped fall and swing from the stowed pose on a fixed base keeps its
/// energy.
#[test]
fn an_undamped_swing_keeps_its_energy() {
    let robot = titan();
    let bodies: Vec<Body> =
        robot.bodies.iter().map(|link| Body::dry(link.mass_kg, link.com_m, &link.inertia_kg_m2)).collect();
    let system = Multibody::new(robot.chain.clone(), bodies);
    let around = Environment::still(G);
    let energy = |state: &SystemState| {
        let base = BaseCoupling::Prescribed(Motion::zero());
        let e = equations(&system, &state.angles, &state.rates, &around, &base);
        let rates: Coordinates = std::array::from_fn(|j| if j < 6 { state.rates[j] } else { 0.0 });
        let kinetic = 0.5 * e.inertia.quadratic(&rates);
        let poses = system.chain().link_poses(&state.angles);
        let height = |i: usize, b: &Body| (poses.link(i) * nalgebra::Point3::from(b.com_m)).z * b.mass_kg * G;
        let potential: f64 = system.bodies().iter().enumerate().skip(1).map(|(i, b)| height(i, b)).sum();
        (kinetic, kinetic + potential)
    };
    let lost = [4e-3, 2e-3, 1e-3].map(|step_s| {
        let mut state = at_rest(robot.stowed);
        let start = energy(&state).1;
        let mut peak: f64 = 0.0;
        for i in 1..=(1.0 / step_s) as u32 {
            let fixed = |_: Stage, _: &SystemState| (around, BaseCoupling::Prescribed(Motion::zero()));
            let input = StepInput {
                step_s,
                loads: &[JointLoad::default(); MAX_JOINTS],
                extra: &[Force::zero(); MAX_JOINTS + 1],
                contacts: &[],
                is_free: false,
                around: &fixed,
            };
            system.step(&mut state, &input);
            let (kinetic, total) = energy(&state);
            peak = peak.max(kinetic);
            let t = f64::from(i) * step_s;
            if is_multiple(t, 0.02) {
                eprintln!("plot energy/{step_s} {t:.3} {:e} {kinetic:e}", total - start);
            }
        }
        (energy(&state).1 - start) / peak
    });
    eprintln!("energy gained in 1 s over the peak of its motion, at 4, 2, 1 ms: {lost:?}");
    assert!(lost[1].abs() < 5e-3, "{lost:?}");
    assert!((lost[0] / lost[2]).abs() > 8.0, "{lost:?}");
}

/// A link whose weight the water carries at its centre of mass stays where it is.
#[test]
fn a_neutrally_buoyant_link_hangs_still() {
    let shape = Shape::Cylinder { radius_m: 0.07, length_m: 0.84 };
    let joint = ChainJoint {
        name: "j".into(),
        child_link: "link".into(),
        kind: armcal_core::kinematics::JointKind::Revolute,
        parent_from_joint: Isometry3::identity(),
        axis: Vector3::y_axis(),
        limits: None,
    };
    let link = armcal_core::robot::LinkBody {
        name: "link".into(),
        mass_kg: 13.0,
        com_m: Vector3::new(0.42, 0.0, 0.0),
        inertia_kg_m2: Matrix3::identity() * 0.8,
        bad_inertia: None,
        visuals: Vec::new(),
        collisions: vec![PlacedShape {
            owner_from_shape: Isometry3::new(Vector3::new(0.42, 0.0, 0.0), Vector3::y() * 1.0),
            shape,
            color_rgb: [0; 3],
        }],
    };
    let moved = |buoyancy_fraction: f64| {
        let water = WaterProperties { buoyancy_fraction, drag_coefficient: 1.2, ..SEA };
        let system = Multibody::new(Chain::new(vec![joint.clone()]), vec![Body::none(), Body::link(&link, &water)]);
        let mut state = at_rest(JointAngles::from_slice(&[0.3]));
        for _ in 0..5000 {
            let fixed = |_: Stage, _: &SystemState| (Environment::still(G), BaseCoupling::Prescribed(Motion::zero()));
            let input = StepInput {
                step_s: 2e-3,
                loads: &[JointLoad::default(); MAX_JOINTS],
                extra: &[Force::zero(); MAX_JOINTS + 1],
                contacts: &[],
                is_free: false,
                around: &fixed,
            };
            system.step(&mut state, &input);
        }
        (state.angles[0] - 0.3).abs()
    };
    assert!(moved(1.0) < 1e-9, "{}", moved(1.0));
    assert!(moved(0.9) > 0.1, "a lighter float lets it sink");
}

/// Returns a ball that floats alone in water: density, added mass and drag.
fn ball(mass_kg: f64, radius_m: f64, drag_coefficient: f64) -> Multibody {
    let shape = Shape::Sphere { radius_m };
    let displaced = 1025.0 * 4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3);
    let water = WaterProperties { buoyancy_fraction: displaced / mass_kg, drag_coefficient, ..SEA };
    let link = armcal_core::robot::LinkBody {
        name: "ball".into(),
        mass_kg,
        com_m: Vector3::zeros(),
        inertia_kg_m2: Matrix3::identity() * (0.4 * mass_kg * radius_m * radius_m),
        bad_inertia: None,
        visuals: Vec::new(),
        collisions: vec![PlacedShape { owner_from_shape: Isometry3::identity(), shape, color_rgb: [0; 3] }],
    };
    Multibody::new(Chain::new(Vec::new()), vec![Body::link(&link, &water)])
}

/// A sinking ball: `v = vt tanh(t a / vt)` with `a = (m - md) g / (m + md/2)`, `vt` where drag balances the weight in
/// water.
#[test]
fn a_ball_sinks_at_its_terminal_velocity() {
    let (mass, radius, cd) = (60.0, 0.2, 0.5);
    let system = ball(mass, radius, cd);
    let displaced = system.bodies()[0].displaced_kg;
    // The drag's area is that of the box about the shape.
    let factor = 0.5 * 1025.0 * cd * 4.0 * radius * radius;
    let terminal = ((mass - displaced) * G / factor).sqrt();
    let start = (mass - displaced) * G / (mass + 0.5 * displaced);
    let mut state = at_rest(JointAngles::from_slice(&[]));
    let fall = Float { step_s: 2e-3, gravity_m_s2: G, torque_n_m: &|_, _| 0.0, damping_n_m_s_rad: 0.0 };
    for end_s in [0.1, 0.2, 0.4, 0.8, 10.0] {
        let mut state = at_rest(JointAngles::from_slice(&[]));
        fall.run(&system, &mut state, end_s);
        let exact = terminal * (end_s * start / terminal).tanh();
        let got = -state.base_velocity.linear.z;
        assert!((got / exact - 1.0).abs() < 1e-5, "{end_s} s: {got} {exact}");
    }
    fall.run_seen(&system, &mut state, 10.0, |t, at| {
        if t < 2.001 && is_multiple(t, 0.04) {
            let exact = terminal * (t * start / terminal).tanh();
            eprintln!("plot sphere {t:.3} {:e} {exact:e} {terminal}", -at.base_velocity.linear.z);
        }
    });
    assert!((state.base_velocity.linear.z + terminal).abs() < 1e-9);
}

/// A ball held by accelerating water obeys `(m + md/2) a = (md + md/2) du/dt`, in any orientation.
#[test]
fn accelerating_water_takes_a_ball_along() {
    let system = ball(60.0, 0.2, 0.0);
    let (mass, displaced) = (60.0, system.bodies()[0].displaced_kg);
    let turned =
        Isometry3::from_parts(nalgebra::Translation3::identity(), UnitQuaternion::from_euler_angles(0.3, -0.8, 1.9));
    let acceleration = Vector3::new(0.5, -0.2, 0.1);
    let to_base = turned.rotation.inverse();
    let around = Environment { water_acceleration: to_base * acceleration, ..Environment::still(0.0) };
    let none = JointAngles::from_slice(&[]);
    let mut e = equations(&system, &none, &none, &around, &BaseCoupling::Free);
    let a = Motion::from_slice(&e.inertia.solve(&std::array::from_fn(|i| -e.bias[i]))).linear;
    let expected = to_base * acceleration * (1.5 * displaced / (mass + 0.5 * displaced));
    assert!((a - expected).norm() < 1e-12, "{a} {expected}");
}

/// Steadily moving water changes nothing in its own frame. A spinning, sliding hull of uneven added mass accelerates
/// alike in still water and in a current (Galilei).
#[test]
fn a_current_carries_everything_along() {
    let robot = titan();
    let system = on_vehicle(&robot, 400.0, SEA_KG_M3);
    let rates = JointAngles::from_slice(&[0.3, -0.2, 0.4, 0.5, -0.6, 0.2]);
    let velocity = Motion::new(Vector3::new(0.2, -0.3, 0.5), Vector3::new(0.4, 0.1, -0.2));
    let current = Vector3::new(0.7, -0.4, 0.3);
    let accelerate = |water: Vector3<f64>| {
        let around = Environment {
            base_velocity: Motion::new(velocity.angular, velocity.linear + water),
            water_velocity: water,
            ..Environment::still(G)
        };
        let mut e = equations(&system, &robot.stowed, &rates, &around, &BaseCoupling::Free);
        let a = e.inertia.solve(&std::array::from_fn(|i| -e.bias[i]));
        // In inertial axes: a point's acceleration is that of the components plus w x v.
        let spatial = Motion::from_slice(&a);
        let joints: Vec<f64> = a[6..12].to_vec();
        (spatial.angular, spatial.linear + velocity.angular.cross(&around.base_velocity.linear), joints)
    };
    let (still, carried) = (accelerate(Vector3::zeros()), accelerate(current));
    assert!((still.0 - carried.0).norm() < 1e-9 && (still.1 - carried.1).norm() < 1e-9);
    for (a, b) in still.2.iter().zip(&carried.2) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

/// Turned and moved, a body on which the water has no effect has the inertia of the general method.
#[test]
fn dry_bodies_are_placed_as_wet_ones_are() {
    for (k, link) in titan().bodies.iter().enumerate() {
        let dry = Body::dry(link.mass_kg, link.com_m, &link.inertia_kg_m2);
        assert!(dry.is_dry());
        let turn = UnitQuaternion::from_euler_angles(0.3 * k as f64, -0.8, 1.9);
        let place = Isometry3::from_parts(Vector3::new(0.4, -1.1, 0.2 * k as f64).into(), turn);
        let (found, general) = (dry.placed_dry(&place), dry.rigid.placed(&place));
        let scale = general.rotational.norm();
        for (a, b) in
            [(found.rotational, general.rotational), (found.coupling, general.coupling), (found.linear, general.linear)]
        {
            assert!((a - b).norm() <= 1e-13 * scale.max(1.0), "body {k}: {a} {b}");
        }
    }
    assert!(!Body::in_sea_water(&titan().bodies[1], 0.3).is_dry());
}

//! The arms' equations of motion against Pinocchio (and MuJoCo): `tests/oracle/make_dynamics_golden.py`.

use armcal::robot::Robot;
use armcal::sim::dynamics::{
    BaseCoupling, Body, Coordinates, Environment, EquationInput, Equations, Force, Inertia, MAX_DOF, Motion, Multibody,
};
use armcal::streams::{JointAngles, MAX_JOINTS};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::golden;
use crate::support::root;

const ARMS: [(&str, &str); 2] = [("titan4", "dynamics.json"), ("kraft-predator", "dynamics-kraft-predator.json")];

#[derive(Deserialize)]
struct Dynamics {
    gravity_m_s2: f64,
    gravity_torques: Cases<GravityCase>,
    accelerations: Cases<AccelerationCase>,
    mass_matrices: Cases<MassCase>,
    inverse_dynamics: Cases<InverseCase>,
    flying_accelerations: Flying<FlyingCase>,
    added_mass: Wet<AddedMassCase>,
    moving_water: Wet<MovingWaterCase>,
}

#[derive(Deserialize)]
struct Cases<T> {
    cases: Vec<T>,
}

#[derive(Deserialize)]
struct Flying<T> {
    vehicle: VehicleMass,
    cases: Vec<T>,
}

#[derive(Deserialize)]
struct Wet<T> {
    vehicle: VehicleMass,
    vehicle_added_mass_rows: [[f64; 6]; 6],
    link_names: Vec<String>,
    link_added_mass_rows: Vec<[[f64; 6]; 6]>,
    cases: Vec<T>,
}

#[derive(Deserialize)]
pub(super) struct VehicleMass {
    mass_kg: f64,
    inertia_about_com_kg_m2: [f64; 3],
    com_m: [f64; 3],
}

#[derive(Deserialize)]
struct GravityCase {
    q: Vec<f64>,
    gravity_torque: Vec<f64>,
}

#[derive(Deserialize)]
struct AccelerationCase {
    q: Vec<f64>,
    qd: Vec<f64>,
    tau: Vec<f64>,
    qdd: Vec<f64>,
    qdd_mujoco: Vec<f64>,
}

#[derive(Deserialize)]
struct MassCase {
    q: Vec<f64>,
    mass_matrix_rows: Vec<Vec<f64>>,
}

/// Velocities in base axes.
#[derive(Deserialize)]
pub(super) struct BaseState {
    pub(super) base_quaternion_wxyz: [f64; 4],
    base_linear_velocity: [f64; 3],
    base_angular_velocity: [f64; 3],
}

/// Acceleration of the base in base axes; spatial: the derivative of the velocity's components.
#[derive(Deserialize)]
struct BaseAcceleration {
    base_linear_acceleration_classical: [f64; 3],
    base_linear_acceleration_spatial: [f64; 3],
    base_angular_acceleration: [f64; 3],
}

#[derive(Deserialize)]
struct InverseCase {
    #[serde(flatten)]
    base: BaseState,
    #[serde(flatten)]
    acceleration: BaseAcceleration,
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    tau: Vec<f64>,
    base_force: [f64; 3],
    base_torque: [f64; 3],
}

#[derive(Deserialize)]
struct FlyingCase {
    #[serde(flatten)]
    base: BaseState,
    #[serde(flatten)]
    acceleration: BaseAcceleration,
    q: Vec<f64>,
    qd: Vec<f64>,
    tau: Vec<f64>,
    qdd: Vec<f64>,
}

#[derive(Deserialize)]
struct AddedMassCase {
    #[serde(flatten)]
    free: FlyingCase,
    qdd_fixed_base: Vec<f64>,
}

#[derive(Deserialize)]
struct MovingWaterCase {
    #[serde(flatten)]
    free: FlyingCase,
    qdd_held_base: Vec<f64>,
    water_velocity_m_s: [f64; 3],
    water_acceleration_m_s2: [f64; 3],
}

impl BaseState {
    pub(super) fn rotation(&self) -> UnitQuaternion<f64> {
        let [w, x, y, z] = self.base_quaternion_wxyz;
        UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
    }

    pub(super) fn velocity(&self) -> Motion {
        Motion::new(self.base_angular_velocity.into(), self.base_linear_velocity.into())
    }

    fn surroundings(&self, gravity_m_s2: f64) -> Environment {
        let still = Environment::still(gravity_m_s2);
        let gravity = self.rotation().inverse() * still.gravity;
        Environment { gravity, base_velocity: self.velocity(), ..still }
    }
}

impl BaseAcceleration {
    fn spatial(&self) -> Motion {
        Motion::new(self.base_angular_acceleration.into(), self.base_linear_acceleration_spatial.into())
    }
}

#[derive(Deserialize)]
struct Head {
    joint_names: Vec<String>,
}

/// Robots, with their golden files as `T`.
pub(super) fn arms<T: DeserializeOwned>() -> impl Iterator<Item = (Robot, T)> {
    ARMS.into_iter().map(|(name, file)| {
        let robot = armcal::robot::load(&root().join("robots").join(name)).expect("the robot reads");
        assert_eq!(golden::<Head>(file).joint_names, robot.joint_names());
        (robot, golden(file))
    })
}

/// The links without water, and with the mass that `vehicle` adds to the base link.
pub(super) fn dry(robot: &Robot, vehicle: Option<&VehicleMass>) -> Vec<Body> {
    let mut bodies: Vec<Body> =
        robot.bodies.iter().map(|link| Body::dry(link.mass_kg, link.com_m, &link.inertia_kg_m2)).collect();
    if let Some(vehicle) = vehicle {
        let inertia = Matrix3::from_diagonal(&vehicle.inertia_about_com_kg_m2.into());
        let hull = Body::dry(vehicle.mass_kg, vehicle.com_m.into(), &inertia);
        let base = &bodies[0];
        let mass_kg = base.mass_kg + hull.mass_kg;
        let com_m = (base.com_m * base.mass_kg + hull.com_m * hull.mass_kg) / mass_kg;
        bodies[0] = Body { mass_kg, com_m, rigid: base.rigid + hull.rigid, ..hull };
    }
    bodies
}

fn in_water<T>(robot: &Robot, wet: &Wet<T>, vehicle: Option<&VehicleMass>) -> Multibody {
    let mut bodies = dry(robot, vehicle);
    let names: Vec<_> = robot.bodies.iter().skip(1).map(|link| link.name.clone()).collect();
    assert_eq!(names, wet.link_names);
    bodies[0].added = added(&wet.vehicle_added_mass_rows);
    for (body, rows) in bodies[1..].iter_mut().zip(&wet.link_added_mass_rows) {
        body.added = added(rows);
    }
    Multibody::new(robot.chain.clone(), bodies)
}

/// Added inertia from `rows`, linear before angular as in the files.
fn added(rows: &[[f64; 6]; 6]) -> Inertia {
    let block = |row: usize, column: usize| Matrix3::from_fn(|i, j| rows[row + i][column + j]);
    Inertia { rotational: block(3, 3), coupling: block(3, 0), linear: block(0, 0) }
}

pub(super) fn of(values: &[f64]) -> JointAngles {
    JointAngles::from_slice(values)
}

pub(super) fn equations(
    arm: &Multibody,
    q: &[f64],
    qd: &[f64],
    around: &Environment,
    base: &BaseCoupling,
) -> Equations {
    let (angles, rates, extra) = (&of(q), &of(qd), &[Force::zero(); MAX_JOINTS + 1]);
    arm.equations(&EquationInput { angles, rates, around, base, extra })
}

/// Generalised forces `M x + bias`.
fn forces(equations: &Equations, x: &[f64]) -> Vec<f64> {
    let row = |i: usize| (0..x.len()).map(|j| equations.inertia.get(i, j) * x[j]).sum::<f64>() + equations.bias[i];
    (0..x.len()).map(row).collect()
}

/// Accelerations under `tau` about the joints, with no force on the base.
pub(super) fn accelerations(equations: &Equations, tau: &[f64]) -> Vec<f64> {
    let n = equations.first_joint + tau.len();
    let drive = |i: usize| if i < equations.first_joint { 0.0 } else { tau[i - equations.first_joint] };
    let net: Coordinates = std::array::from_fn(|i| if i < n { drive(i) - equations.bias[i] } else { 0.0 });
    assert!(n <= MAX_DOF);
    let mut inertia = equations.inertia;
    inertia.solve(&net)[..n].to_vec()
}

/// Norm of the difference over the norm of the expected values.
fn off(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    norm(&mut found.iter().zip(expected).map(|(a, b)| a - b)) / norm(&mut expected.iter().copied())
}

/// Generalised vector in the order of the equations: angular, linear, joints.
fn joined(base: &Motion, joints: &[f64]) -> Vec<f64> {
    base.to_array().into_iter().chain(joints.iter().copied()).collect()
}

pub(super) const AT_REST: BaseCoupling =
    BaseCoupling::Prescribed(Motion { angular: Vector3::new(0.0, 0.0, 0.0), linear: Vector3::new(0.0, 0.0, 0.0) });

/// Tolerance for double precision through seven bodies' recursion and a factor of condition 1e5.
const TOLERANCE: f64 = 1e-9;

#[test]
fn gravity_torques_are_those_of_pinocchio() {
    for (robot, file) in arms::<Dynamics>() {
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, None));
        let gravity = Vector3::new(0.0, 0.0, -file.gravity_m_s2);
        assert_eq!(file.gravity_torques.cases.len(), 20);
        let worst = file.gravity_torques.cases.iter().map(|case| {
            // The drives' torques are the opposite of gravity's.
            let held: Vec<f64> = arm.static_torques(&of(&case.q), &gravity).iter().map(|torque| -torque).collect();
            off(&held, &case.gravity_torque)
        });
        report(&robot, "gravity torques", worst, TOLERANCE);
    }
}

/// Prints the largest of `differences`, and checks it against its limit.
pub(super) fn report(robot: &Robot, what: &str, differences: impl Iterator<Item = f64>, limit: f64) {
    let worst = differences.fold(0.0, |worst: f64, value| if value.is_nan() { value } else { worst.max(value) });
    eprintln!("{}, {what}: {worst:.1e}", robot.name);
    assert!(worst < limit, "{}, {what}: {worst}", robot.name);
}

#[test]
fn accelerations_are_those_of_pinocchio_and_mujoco() {
    for (robot, file) in arms::<Dynamics>() {
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, None));
        let around = Environment::still(file.gravity_m_s2);
        assert_eq!(file.accelerations.cases.len(), 100);
        let found =
            |case: &AccelerationCase| accelerations(&equations(&arm, &case.q, &case.qd, &around, &AT_REST), &case.tau);
        let cases = &file.accelerations.cases;
        report(&robot, "accelerations, Pinocchio", cases.iter().map(|case| off(&found(case), &case.qdd)), TOLERANCE);
        report(
            &robot,
            "accelerations, MuJoCo",
            cases.iter().map(|case| off(&found(case), &case.qdd_mujoco)),
            TOLERANCE,
        );
    }
}

#[test]
fn the_joint_space_inertia_is_that_of_pinocchio() {
    for (robot, file) in arms::<Dynamics>() {
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, None));
        let around = Environment::still(file.gravity_m_s2);
        let worst = file.mass_matrices.cases.iter().map(|case| {
            let n = case.q.len();
            let found = equations(&arm, &case.q, &vec![0.0; n], &around, &AT_REST).inertia;
            let entries: Vec<f64> = (0..n * n).map(|i| found.get(i / n, i % n)).collect();
            off(&entries, &case.mass_matrix_rows.concat())
        });
        report(&robot, "joint-space inertia", worst, TOLERANCE);
    }
}

/// One comparison has the base's motion given, the other the force that the base needs for it.
#[test]
fn torques_on_a_moving_base_are_those_of_pinocchios_free_flyer() {
    for (robot, file) in arms::<Dynamics>() {
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, None));
        assert_eq!(file.inverse_dynamics.cases.len(), 50);
        let (mut given, mut free) = (Vec::new(), Vec::new());
        for case in &file.inverse_dynamics.cases {
            let around = case.base.surroundings(file.gravity_m_s2);
            let base = case.acceleration.spatial();
            // Both kinds of acceleration in the file agree.
            let turning = around.base_velocity.angular.cross(&around.base_velocity.linear);
            let classical = Vector3::from(case.acceleration.base_linear_acceleration_classical);
            assert!((classical - turning - base.linear).norm() < 1e-12);
            let prescribed = equations(&arm, &case.q, &case.qd, &around, &BaseCoupling::Prescribed(base));
            given.push(off(&forces(&prescribed, &case.qdd), &case.tau));
            let whole = equations(&arm, &case.q, &case.qd, &around, &BaseCoupling::Free);
            let expected = joined(&Motion::new(case.base_torque.into(), case.base_force.into()), &case.tau);
            free.push(off(&forces(&whole, &joined(&base, &case.qdd)), &expected));
        }
        report(&robot, "torques, base as prescribed", given.into_iter(), TOLERANCE);
        report(&robot, "torques and force on the base", free.into_iter(), TOLERANCE);
    }
}

fn flying_difference(arm: &Multibody, case: &FlyingCase, around: &Environment) -> f64 {
    let found = accelerations(&equations(arm, &case.q, &case.qd, around, &BaseCoupling::Free), &case.tau);
    off(&found, &joined(&case.acceleration.spatial(), &case.qdd))
}

#[test]
fn accelerations_with_a_free_base_are_those_of_pinocchios_free_flyer() {
    for (robot, file) in arms::<Dynamics>() {
        let flying = &file.flying_accelerations;
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, Some(&flying.vehicle)));
        assert_eq!(flying.cases.len(), 50);
        let worst = flying.cases.iter().map(|c| flying_difference(&arm, c, &c.base.surroundings(file.gravity_m_s2)));
        report(&robot, "accelerations, free base", worst, TOLERANCE);
    }
}

#[test]
fn added_mass_moves_as_kirchhoffs_equations_on_pinocchios_jacobians_say() {
    for (robot, file) in arms::<Dynamics>() {
        let wet = &file.added_mass;
        let fixed = in_water(&robot, wet, None);
        let free = in_water(&robot, wet, Some(&wet.vehicle));
        let still = Environment::still(file.gravity_m_s2);
        assert!(wet.cases.len() >= 20);
        let on_fixed = wet.cases.iter().map(|case| {
            let found =
                accelerations(&equations(&fixed, &case.free.q, &case.free.qd, &still, &AT_REST), &case.free.tau);
            off(&found, &case.qdd_fixed_base)
        });
        report(&robot, "added mass, fixed base", on_fixed, TOLERANCE);
        let on_free = wet
            .cases
            .iter()
            .map(|case| flying_difference(&free, &case.free, &case.free.base.surroundings(file.gravity_m_s2)));
        report(&robot, "added mass, free base", on_free, TOLERANCE);
    }
}

#[test]
fn moving_water_carries_added_mass_as_a_frame_that_moves_with_it_says() {
    for (robot, file) in arms::<Dynamics>() {
        let wet = &file.moving_water;
        let arm = in_water(&robot, wet, Some(&wet.vehicle));
        let (mut held, mut free) = (Vec::new(), Vec::new());
        for case in &wet.cases {
            let to_base = case.free.base.rotation().inverse();
            let around = Environment {
                water_velocity: to_base * Vector3::from(case.water_velocity_m_s),
                water_acceleration: to_base * Vector3::from(case.water_acceleration_m_s2),
                ..case.free.base.surroundings(file.gravity_m_s2)
            };
            let at_rest = Environment { base_velocity: Motion::zero(), ..around };
            let found = equations(&arm, &case.free.q, &case.free.qd, &at_rest, &AT_REST);
            held.push(off(&accelerations(&found, &case.free.tau), &case.qdd_held_base));
            free.push(flying_difference(&arm, &case.free, &around));
        }
        report(&robot, "moving water, base held", held.into_iter(), TOLERANCE);
        report(&robot, "moving water, free base", free.into_iter(), TOLERANCE);
    }
}

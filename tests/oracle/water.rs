//! Single bodies in water against closed forms, DOP853 and gz-sim's integration tests:
//! `tests/oracle/make_water_golden.py`.

use armcal::sim::dynamics::{
    BaseCoupling, Body, Environment, Force, Inertia, JointLoad, Motion, Multibody, Stage, StepInput, Surface,
    SystemState,
};
use armcal::streams::{JointAngles, MAX_JOINTS};
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::golden;
use crate::support::titan;

#[derive(Deserialize)]
struct Water {
    gravity_m_s2: f64,
    sinking: Ball,
    coasting: Ball,
    pushed: Ball,
    oscillating_flow: Ball,
    hanging: Hanging,
    ellipsoids: Ellipsoids,
    rising_and_sinking: Floats,
}

#[derive(Deserialize)]
struct Ball {
    mass_kg: f64,
    displaced_kg: f64,
    added_mass_kg: f64,
    drag_n_s2_m2: f64,
    #[serde(default)]
    terminal_speed_m_s: f64,
    #[serde(default)]
    initial_speed_m_s: f64,
    #[serde(default)]
    force_n: f64,
    #[serde(default)]
    flow_amplitude_m_s: f64,
    #[serde(default)]
    flow_rate_rad_s: f64,
    /// Samples of time, position and speed; with an oscillating flow the last two without drag and with it.
    samples: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
struct Hanging {
    mass_kg: f64,
    center_of_buoyancy_above_com_m: f64,
    roll_inertia_with_added_kg_m2: f64,
    initial_roll_rad: f64,
    /// Samples of time, roll and roll rate.
    samples: Vec<[f64; 3]>,
}

#[derive(Deserialize)]
struct Ellipsoids {
    gz_tolerances: EndTolerances,
    cases: Vec<Ellipsoid>,
}

#[derive(Deserialize)]
struct Ellipsoid {
    name: String,
    mass_kg: f64,
    inertia_kg_m2: [f64; 3],
    added_mass_kg: [f64; 3],
    added_inertia_kg_m2: [f64; 3],
    #[serde(flatten)]
    dop853: End,
    gz: End,
}

/// Final state in world axes.
#[derive(Deserialize)]
struct End {
    position_m: [f64; 3],
    angle_rad: f64,
    axis: [f64; 3],
    velocity_m_s: [f64; 3],
    angular_velocity_rad_s: [f64; 3],
}

#[derive(Deserialize)]
struct EndTolerances {
    position_m: f64,
    angle_rad: f64,
    axis: f64,
    velocity_m_s: f64,
    angular_velocity_rad_s: f64,
}

#[derive(Deserialize)]
struct Floats {
    gravity_m_s2: f64,
    cases: Vec<Float>,
}

#[derive(Deserialize)]
struct Float {
    name: String,
    mass_kg: f64,
    volume_m3: f64,
    z_at_1_s_m: f64,
    gz_z_m: f64,
    gz_tolerance_m: f64,
}

/// A free floating body, and the forces on it other than the water's. It carries an arm without mass, held by its
/// dampers, because a chain needs a URDF.
struct Swim<'a> {
    body: Body,
    step_s: f64,
    gravity_m_s2: f64,
    /// Velocity and acceleration of the water by time, world axes.
    flow: &'a dyn Fn(f64) -> [Vector3<f64>; 2],
    /// Force and torque about the body's origin by time, world axes.
    push: &'a dyn Fn(f64) -> [Vector3<f64>; 2],
}

fn no_flow(_: f64) -> [Vector3<f64>; 2] {
    [Vector3::zeros(); 2]
}

impl Swim<'_> {
    fn advance(&self, state: &mut SystemState, from_s: f64, to_s: f64) {
        let chain = titan().chain;
        let mut bodies = vec![Body::none(); chain.n_joints() + 1];
        bodies[0] = self.body.clone();
        let system = Multibody::new(chain, bodies);
        let h = self.step_s;
        for k in 0..((to_s - from_s) / h).round() as u32 {
            let start_s = from_s + f64::from(k) * h;
            // A push with constant direction in the world turns against the body; its direction is that of the middle
            // of the step.
            let half_turn = UnitQuaternion::from_scaled_axis(state.base_velocity.angular * (0.5 * h));
            let to_body = (state.world_from_base.rotation * half_turn).inverse();
            let [force, torque] = (self.push)(start_s + 0.5 * h);
            let mut extra = [Force::zero(); MAX_JOINTS + 1];
            extra[0] = Force::new(to_body * torque, to_body * force);
            let around = |stage: Stage, at: &SystemState| {
                let to_body = at.world_from_base.rotation.inverse();
                let [water_velocity, water_acceleration] =
                    (self.flow)(if stage == Stage::Start { start_s } else { start_s + h }).map(|v| to_body * v);
                let gravity = to_body * Vector3::new(0.0, 0.0, -self.gravity_m_s2);
                let around =
                    Environment { gravity, base_velocity: at.base_velocity, water_velocity, water_acceleration };
                (around, BaseCoupling::Free)
            };
            let loads = [JointLoad { damping_n_m_s_rad: 1.0, ..JointLoad::default() }; MAX_JOINTS];
            let input =
                StepInput { step_s: h, loads: &loads, extra: &extra, contacts: &[], is_free: true, around: &around };
            system.step(state, &input);
        }
        let figures =
            [state.world_from_base.translation.vector, state.base_velocity.linear, state.base_velocity.angular];
        assert!(figures.iter().all(|v| v.norm().is_finite()), "{figures:?}");
    }
}

fn at_rest() -> SystemState {
    let angles = titan().stowed;
    let rates = JointAngles::from_fn(angles.len(), |_| 0.0);
    SystemState { angles, rates, world_from_base: Isometry3::identity(), base_velocity: Motion::zero() }
}

/// A sphere with the file's figures instead of those that a URDF would give it.
fn sphere(ball: &Ball, drag_n_s2_m2: f64) -> Body {
    let mut body = Body::dry(ball.mass_kg, Vector3::zeros(), &(Matrix3::identity() * 0.1));
    body.displaced_kg = ball.displaced_kg;
    body.added = Inertia { linear: Matrix3::identity() * ball.added_mass_kg, ..Inertia::zero() };
    let points_m = [Vector3::zeros(); 3];
    body.surfaces = vec![Surface { points_m, axes: Matrix3::identity(), factors: Vector3::repeat(drag_n_s2_m2 / 3.0) }];
    body
}

/// Largest difference of position and speed along `direction` from columns `column` and `column + 1` of the samples.
fn off(swim: &Swim, ball: &Ball, mut state: SystemState, direction: Vector3<f64>, column: usize) -> f64 {
    let mut worst: f64 = 0.0;
    for pair in ball.samples.windows(2) {
        swim.advance(&mut state, pair[0][0], pair[1][0]);
        let place = state.world_from_base.translation.vector;
        let velocity = state.world_from_base.rotation * state.base_velocity.linear;
        worst = worst.max((place - direction * pair[1][column]).amax());
        worst = worst.max((velocity - direction * pair[1][column + 1]).amax());
    }
    worst
}

/// The world's step, s.
const STEP_S: f64 = 2e-3;
/// Tolerance in m and m/s for a second-order step with time constants of seconds.
const TOLERANCE: f64 = 1e-5;

#[test]
fn a_sphere_sinks_coasts_and_is_pushed_as_the_closed_forms_say() {
    let file: Water = golden("water.json");
    let swim =
        |body: Body, gravity_m_s2: f64, push: &dyn Fn(f64) -> [Vector3<f64>; 2], start: Vector3<f64>, ball: &Ball| {
            let swim = Swim { body, step_s: STEP_S, gravity_m_s2, flow: &no_flow, push };
            let mut state = at_rest();
            state.base_velocity.linear = start;
            let along = if gravity_m_s2 > 0.0 { -Vector3::z() } else { Vector3::x() };
            off(&swim, ball, state, along, 1)
        };
    let sinking = swim(
        sphere(&file.sinking, file.sinking.drag_n_s2_m2),
        file.gravity_m_s2,
        &no_flow,
        Vector3::zeros(),
        &file.sinking,
    );
    let last = file.sinking.samples.last().expect("samples");
    assert!((last[2] / file.sinking.terminal_speed_m_s - 1.0).abs() < 1e-3, "at its terminal speed by then");
    let thrown = Vector3::x() * file.coasting.initial_speed_m_s;
    let coasting = swim(sphere(&file.coasting, file.coasting.drag_n_s2_m2), 0.0, &no_flow, thrown, &file.coasting);
    let push = |_: f64| [Vector3::x() * file.pushed.force_n, Vector3::zeros()];
    let pushed = swim(sphere(&file.pushed, 0.0), 0.0, &push, Vector3::zeros(), &file.pushed);
    eprintln!("sinking, coasting, pushed: off by {sinking:.1e}, {coasting:.1e}, {pushed:.1e} m or m/s");
    assert!(sinking < TOLERANCE && coasting < TOLERANCE && pushed < TOLERANCE);
}

#[test]
fn an_oscillating_flow_takes_a_sphere_along_as_morison_has_it() {
    let ball = golden::<Water>("water.json").oscillating_flow;
    let (amplitude, rate) = (ball.flow_amplitude_m_s, ball.flow_rate_rad_s);
    let flow =
        |t: f64| [Vector3::x() * (amplitude * (rate * t).sin()), Vector3::x() * (amplitude * rate * (rate * t).cos())];
    for (drag, column) in [(0.0, 1), (ball.drag_n_s2_m2, 3)] {
        // The vehicle's axes are turned, which must have no effect.
        let mut state = at_rest();
        state.world_from_base.rotation = UnitQuaternion::from_euler_angles(0.4, -0.9, 2.0);
        let swim = Swim { body: sphere(&ball, drag), step_s: STEP_S, gravity_m_s2: 0.0, flow: &flow, push: &no_flow };
        let worst = if drag > 0.0 {
            // A surface's drag is in its own axes, so these stay with the flow.
            off(&swim, &ball, at_rest(), Vector3::x(), column)
        } else {
            off(&swim, &ball, state, Vector3::x(), column)
        };
        eprintln!("oscillating flow, drag {drag:.1} N s2/m2: off by {worst:.1e} m or m/s");
        assert!(worst < TOLERANCE, "{worst}");
    }
}

#[test]
fn a_neutrally_buoyant_body_stays_and_rolls_as_a_pendulum() {
    let file: Water = golden("water.json");
    let hanging = &file.hanging;
    let total = hanging.roll_inertia_with_added_kg_m2;
    let rigid = 86.289;
    let mut body =
        Body::dry(hanging.mass_kg, Vector3::zeros(), &Matrix3::from_diagonal(&Vector3::new(rigid, 90.0, 50.0)));
    body.displaced_kg = hanging.mass_kg;
    body.center_of_buoyancy_m = Vector3::new(0.0, 0.0, hanging.center_of_buoyancy_above_com_m);
    body.added.rotational = Matrix3::from_diagonal(&Vector3::new(total - rigid, 5.0, 5.0));
    body.added.linear = Matrix3::identity() * 500.0;
    let swim = Swim { body, step_s: STEP_S, gravity_m_s2: file.gravity_m_s2, flow: &no_flow, push: &no_flow };
    let mut state = at_rest();
    state.world_from_base.rotation = UnitQuaternion::from_euler_angles(hanging.initial_roll_rad, 0.0, 0.0);
    let (mut worst, mut moved) = (0.0_f64, 0.0_f64);
    for pair in hanging.samples.windows(2) {
        swim.advance(&mut state, pair[0][0], pair[1][0]);
        let roll = state.world_from_base.rotation.scaled_axis();
        worst = worst.max((roll - Vector3::x() * pair[1][1]).amax());
        worst = worst.max((state.base_velocity.angular - Vector3::x() * pair[1][2]).amax());
        moved = moved.max(state.world_from_base.translation.vector.amax());
    }
    eprintln!("rolling: off by {worst:.1e} rad or rad/s; moved by {moved:.1e} m");
    assert!(worst < 3e-5 && moved < 1e-9, "{worst} {moved}");
}

#[test]
fn spheroids_with_added_mass_end_where_gz_sim_has_them() {
    /// Step, s. The tolerances are gz-sim's, whose own step was 1 ms.
    const STEP_S: f64 = 1e-3;
    let file: Water = golden("water.json");
    let push = |t: f64| {
        let pi = std::f64::consts::PI;
        [
            Vector3::new(2000.0, 2000.0, 0.0) * (3.0 * pi * t).sin(),
            Vector3::new(200.0, 200.0, 0.0) * (2.0 * pi * t).sin(),
        ]
    };
    assert_eq!(file.ellipsoids.cases.len(), 3);
    for case in &file.ellipsoids.cases {
        let diagonal = |values: [f64; 3]| Matrix3::from_diagonal(&values.into());
        let mut body = Body::dry(case.mass_kg, Vector3::zeros(), &diagonal(case.inertia_kg_m2));
        let (linear, rotational) = (diagonal(case.added_mass_kg), diagonal(case.added_inertia_kg_m2));
        body.added = Inertia { linear, rotational, ..Inertia::zero() };
        let swim = Swim { body, step_s: STEP_S, gravity_m_s2: 0.0, flow: &no_flow, push: &push };
        let mut state = at_rest();
        swim.advance(&mut state, 0.0, 1.0);
        let turned = state.world_from_base.rotation;
        for (whose, end) in [("gz-sim", &case.gz), ("DOP853", &case.dop853)] {
            let differences = [
                (state.world_from_base.translation.vector - Vector3::from(end.position_m)).norm(),
                (turned.angle() - end.angle_rad).abs(),
                turned.axis().map_or(f64::NAN, |axis| (axis.into_inner() - Vector3::from(end.axis)).norm()),
                (turned * state.base_velocity.linear - Vector3::from(end.velocity_m_s)).norm(),
                (turned * state.base_velocity.angular - Vector3::from(end.angular_velocity_rad_s)).norm(),
            ];
            let shown = differences.map(|d| format!("{d:.1e}")).join(", ");
            eprintln!("{}, {whose}: position, angle, axis, velocities off by {shown}", case.name);
            let t = &file.ellipsoids.gz_tolerances;
            let limits = [t.position_m, t.angle_rad, t.axis, t.velocity_m_s, t.angular_velocity_rad_s];
            assert!(differences.iter().zip(limits).all(|(d, limit)| *d < limit), "{}: {differences:?}", case.name);
        }
    }
}

#[test]
fn submarines_rise_and_sink_as_gz_sim_has_them() {
    let file = golden::<Water>("water.json").rising_and_sinking;
    for case in &file.cases {
        let mut body = Body::dry(case.mass_kg, Vector3::zeros(), &Matrix3::identity());
        body.displaced_kg = 1000.0 * case.volume_m3;
        let swim = Swim { body, step_s: STEP_S, gravity_m_s2: file.gravity_m_s2, flow: &no_flow, push: &no_flow };
        let mut state = at_rest();
        swim.advance(&mut state, 0.0, 1.0);
        let z = state.world_from_base.translation.vector.z;
        eprintln!("{}: {z:.4} m, gz-sim {} m", case.name, case.gz_z_m);
        assert!((z - case.z_at_1_s_m).abs() < 1e-9 && (z - case.gz_z_m).abs() < case.gz_tolerance_m, "{z}");
    }
}

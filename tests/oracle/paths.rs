//! Whole motions against DOP853 on Pinocchio's dynamics: a falling arm, one on a shaken base, one that rocks a light
//! vehicle.
//!
//! The equations of motion are integrated here by Runge-Kutta 4, so the world's own steps have no influence.

use armcal::sim::dynamics::{BaseCoupling, Environment, Motion, Multibody};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::dynamics::{AT_REST, BaseState, VehicleMass, accelerations, arms, dry, equations, of, report};

#[derive(Deserialize)]
pub(super) struct Paths {
    pub(super) gravity_m_s2: f64,
    pub(super) falling: Falling,
    pub(super) rocking: Rocking,
    pub(super) shaken: Shaken,
}

#[derive(Deserialize)]
pub(super) struct JointSample {
    pub(super) time_s: f64,
    pub(super) q: Vec<f64>,
    pub(super) qd: Vec<f64>,
}

#[derive(Deserialize)]
pub(super) struct Falling {
    pub(super) damping_n_m_s_rad: f64,
    pub(super) samples: Vec<JointSample>,
}

#[derive(Deserialize)]
pub(super) struct Rocking {
    pub(super) vehicle: VehicleMass,
    pub(super) damping_n_m_s_rad: f64,
    pub(super) tau_amplitude_n_m: Vec<f64>,
    pub(super) tau_rate_rad_s: Vec<f64>,
    pub(super) from_rest: Flight,
    pub(super) drifting: Flight,
}

#[derive(Deserialize)]
pub(super) struct Flight {
    pub(super) samples: Vec<FlightSample>,
}

#[derive(Deserialize)]
pub(super) struct FlightSample {
    #[serde(flatten)]
    pub(super) joints: JointSample,
    #[serde(flatten)]
    pub(super) base: BaseState,
    pub(super) base_position_m: [f64; 3],
    pub(super) linear_momentum_kg_m_s: [f64; 3],
    pub(super) angular_momentum_kg_m2_s: [f64; 3],
}

#[derive(Deserialize)]
pub(super) struct Shaken {
    pub(super) damping_n_m_s_rad: f64,
    /// Amplitude, rate, phase; x, y, z, roll, pitch, yaw.
    pub(super) base_motion: Vec<Vec<[f64; 3]>>,
    pub(super) samples: Vec<JointSample>,
}

/// Step of the integrator below, s: the wrist's damper has a time constant of 0.5 ms.
const STEP_S: f64 = 1e-4;
/// Tolerance in rad, rad/s, m, m/s: the oracle's own figures are good to 1e-10, Runge-Kutta's to 1e-9 at this step.
const PATH_TOLERANCE: f64 = 1e-7;

/// Classical Runge-Kutta 4 from `from_s` to `to_s`.
fn integrate(f: &dyn Fn(f64, &[f64]) -> Vec<f64>, state: &mut [f64], from_s: f64, to_s: f64) {
    let steps = ((to_s - from_s) / STEP_S).round() as u32;
    let along = |s: &[f64], d: &[f64], h: f64| s.iter().zip(d).map(|(s, d)| s + h * d).collect::<Vec<f64>>();
    for k in 0..steps {
        let t = from_s + f64::from(k) * STEP_S;
        let k1 = f(t, state);
        let k2 = f(t + 0.5 * STEP_S, &along(state, &k1, 0.5 * STEP_S));
        let k3 = f(t + 0.5 * STEP_S, &along(state, &k2, 0.5 * STEP_S));
        let k4 = f(t + STEP_S, &along(state, &k3, STEP_S));
        for (i, value) in state.iter_mut().enumerate() {
            *value += STEP_S / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
}

fn largest(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    assert!(found.iter().all(|value| value.is_finite()), "{found:?}");
    found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Angles and rates at each sample, integrated from the first; `forward` gives accelerations.
fn joint_path(samples: &[JointSample], forward: impl Fn(f64, &[f64], &[f64]) -> Vec<f64>) -> Vec<f64> {
    let n = samples[0].q.len();
    let mut state = [samples[0].q.clone(), samples[0].qd.clone()].concat();
    let slope = |t: f64, s: &[f64]| [s[n..].to_vec(), forward(t, &s[..n], &s[n..])].concat();
    let mut differences = Vec::new();
    for pair in samples.windows(2) {
        integrate(&slope, &mut state, pair[0].time_s, pair[1].time_s);
        differences.push(largest(&state, &[pair[1].q.clone(), pair[1].qd.clone()].concat()));
    }
    differences
}

#[test]
fn an_arm_falls_as_pinocchio_and_dop853_have_it() {
    for (robot, file) in arms::<Paths>() {
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, None));
        let around = Environment::still(file.gravity_m_s2);
        let damping = file.falling.damping_n_m_s_rad;
        let forward = |_: f64, q: &[f64], qd: &[f64]| {
            let tau: Vec<f64> = qd.iter().map(|rate| -damping * rate).collect();
            accelerations(&equations(&arm, q, qd, &around, &AT_REST), &tau)
        };
        report(&robot, "falling", joint_path(&file.falling.samples, forward).into_iter(), PATH_TOLERANCE);
    }
}

/// Sum of sinusoids: value, first and second derivative.
fn jet(axis: &[[f64; 3]], t: f64) -> [f64; 3] {
    axis.iter().fold([0.0; 3], |[value, first, second], [amplitude, rate, phase]| {
        let (sin, cos) = (rate * t + phase).sin_cos();
        [value + amplitude * sin, first + amplitude * rate * cos, second - amplitude * rate * rate * sin]
    })
}

/// Environment and acceleration of a base that moves by the file.
pub(super) fn shaken_base(motion: &[Vec<[f64; 3]>], t: f64, gravity_m_s2: f64) -> (Environment, BaseCoupling) {
    let jets: Vec<[f64; 3]> = motion.iter().map(|axis| jet(axis, t)).collect();
    let part = |order: usize| Vector3::new(jets[0][order], jets[1][order], jets[2][order]);
    let ([r, dr, ddr], [p, dp, ddp], [y, dy, ddy]) = (jets[3], jets[4], jets[5]);
    let to_base = UnitQuaternion::from_euler_angles(r, p, y).inverse();
    let ((sr, cr), (sp, cp)) = (r.sin_cos(), p.sin_cos());
    let rate = Vector3::new(dr - dy * sp, dp * cr + dy * sr * cp, -dp * sr + dy * cr * cp);
    let slope = Vector3::new(
        ddr - ddy * sp - dy * dp * cp,
        ddp * cr - dp * dr * sr + ddy * sr * cp + dy * (dr * cr * cp - dp * sr * sp),
        -ddp * sr - dp * dr * cr + ddy * cr * cp - dy * (dr * sr * cp + dp * cr * sp),
    );
    let velocity = Motion::new(rate, to_base * part(1));
    let still = Environment::still(gravity_m_s2);
    let around = Environment { gravity: to_base * still.gravity, base_velocity: velocity, ..still };
    (around, BaseCoupling::Prescribed(Motion::new(slope, to_base * part(2) - rate.cross(&velocity.linear))))
}

#[test]
fn an_arm_on_a_shaken_base_swings_as_pinocchio_and_dop853_have_it() {
    for (robot, file) in arms::<Paths>() {
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, None));
        let damping = file.shaken.damping_n_m_s_rad;
        let forward = |t: f64, q: &[f64], qd: &[f64]| {
            let (around, base) = shaken_base(&file.shaken.base_motion, t, file.gravity_m_s2);
            let tau: Vec<f64> = qd.iter().map(|rate| -damping * rate).collect();
            accelerations(&equations(&arm, q, qd, &around, &base), &tau)
        };
        report(&robot, "shaken", joint_path(&file.shaken.samples, forward).into_iter(), PATH_TOLERANCE);
    }
}

/// State: position, quaternion w x y z, angles, then angular and linear velocity in base axes, rates.
fn flight_state(sample: &FlightSample) -> Vec<f64> {
    let velocity = sample.base.velocity().to_array();
    let parts: [&[f64]; 5] =
        [&sample.base_position_m, &sample.base.base_quaternion_wxyz, &sample.joints.q, &velocity, &sample.joints.qd];
    parts.concat()
}

struct Flown {
    rotation: UnitQuaternion<f64>,
    velocity: Motion,
    q: Vec<f64>,
    qd: Vec<f64>,
}

fn flown(state: &[f64]) -> Flown {
    let n = (state.len() - 13) / 2;
    Flown {
        rotation: UnitQuaternion::from_quaternion(Quaternion::new(state[3], state[4], state[5], state[6])),
        velocity: Motion::from_slice(&state[7 + n..13 + n]),
        q: state[7..7 + n].to_vec(),
        qd: state[13 + n..].to_vec(),
    }
}

fn flight_slope(arm: &Multibody, rocking: &Rocking, t: f64, state: &[f64]) -> Vec<f64> {
    let at = flown(state);
    let around = Environment { base_velocity: at.velocity, ..Environment::still(0.0) };
    let drive = |j: usize| {
        rocking.tau_amplitude_n_m[j] * (rocking.tau_rate_rad_s[j] * t).sin() - rocking.damping_n_m_s_rad * at.qd[j]
    };
    let tau: Vec<f64> = (0..at.q.len()).map(drive).collect();
    let acceleration = accelerations(&equations(arm, &at.q, &at.qd, &around, &BaseCoupling::Free), &tau);
    let moves = at.rotation * at.velocity.linear;
    let q = Quaternion::new(state[3], state[4], state[5], state[6]);
    let turns = q * Quaternion::from_imag(at.velocity.angular) * 0.5;
    let parts: [&[f64]; 4] = [moves.as_slice(), &[turns.w, turns.i, turns.j, turns.k], &at.qd, &acceleration];
    parts.concat()
}

/// Linear momentum, and angular momentum about the world's origin.
fn momentum(arm: &Multibody, state: &[f64]) -> [Vector3<f64>; 2] {
    let at = flown(state);
    let found = arm.momentum(&of(&at.q), &of(&at.qd), &at.velocity);
    let linear = at.rotation * found.force;
    let position = Vector3::new(state[0], state[1], state[2]);
    [linear, at.rotation * found.moment + position.cross(&linear)]
}

#[test]
fn an_arm_rocks_a_light_vehicle_as_pinocchio_and_dop853_have_it_and_keeps_the_momentum() {
    /// Tolerance in kg m/s, kg m2/s: momenta are up to 60, with Runge-Kutta's error.
    const MOMENTUM_TOLERANCE: f64 = 1e-6;
    for (robot, file) in arms::<Paths>() {
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, Some(&file.rocking.vehicle)));
        for flight in [&file.rocking.from_rest, &file.rocking.drifting] {
            let slope = |t: f64, s: &[f64]| flight_slope(&arm, &file.rocking, t, s);
            let mut state = flight_state(&flight.samples[0]);
            let (mut path, mut kept, mut moved) = (Vec::new(), Vec::new(), 0.0_f64);
            for pair in flight.samples.windows(2) {
                integrate(&slope, &mut state, pair[0].joints.time_s, pair[1].joints.time_s);
                path.push(largest(&state, &flight_state(&pair[1])));
                let [linear, angular] = momentum(&arm, &state);
                kept.push((linear - Vector3::from(pair[1].linear_momentum_kg_m_s)).amax());
                kept.push((angular - Vector3::from(pair[1].angular_momentum_kg_m2_s)).amax());
                moved = moved.max(flown(&state).rotation.angle());
            }
            eprintln!("{}: the vehicle turns by up to {moved:.2} rad", robot.name);
            assert!(moved > 0.2, "the arm must rock it: {moved}");
            report(&robot, "rocking", path.into_iter(), PATH_TOLERANCE);
            report(&robot, "momentum", kept.into_iter(), MOMENTUM_TOLERANCE);
        }
    }
}

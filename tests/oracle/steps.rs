//! The world's own steps against the motions of `paths`: their error, and its decrease with the square of the step.

use armcal::sim::dynamics::{
    BaseCoupling, Environment, Force, JointLoad, Motion, Multibody, Stage, StepInput, SystemState,
};
use armcal::streams::MAX_JOINTS;
use nalgebra::{Isometry3, Translation3, Vector3};

use super::dynamics::{AT_REST, arms, dry, of};
use super::paths::{FlightSample, JointSample, Paths, Rocking, shaken_base};

/// Steps, s, coarsest first; the world's own is the second.
const STEPS_S: [f64; 4] = [4e-3, 2e-3, 1e-3, 5e-4];

/// Forces on an arm by time.
struct Run<'a> {
    arm: &'a Multibody,
    damping_n_m_s_rad: f64,
    /// Torque by time and joint, N m.
    torque_n_m: &'a dyn Fn(f64, usize) -> f64,
    is_free: bool,
    around: &'a dyn Fn(f64, &SystemState) -> (Environment, BaseCoupling),
}

impl Run<'_> {
    fn advance(&self, state: &mut SystemState, step_s: f64, from_s: f64, to_s: f64) {
        for k in 0..((to_s - from_s) / step_s).round() as u32 {
            let start_s = from_s + f64::from(k) * step_s;
            let load = |j| JointLoad {
                constant_n_m: (self.torque_n_m)(start_s + 0.5 * step_s, j),
                damping_n_m_s_rad: self.damping_n_m_s_rad,
                ..JointLoad::default()
            };
            let around = |stage: Stage, at: &SystemState| {
                let t = if stage == Stage::Start { start_s } else { start_s + step_s };
                (self.around)(t, at)
            };
            let input = StepInput {
                step_s,
                loads: &std::array::from_fn(load),
                extra: &[Force::zero(); MAX_JOINTS + 1],
                contacts: &[],
                is_free: self.is_free,
                around: &around,
            };
            self.arm.step(state, &input);
        }
    }

    /// The largest difference of an angle (rad) at any sample after the first.
    fn off(&self, samples: &[JointSample], step_s: f64) -> f64 {
        let mut state = start(&samples[0]);
        let mut worst: f64 = 0.0;
        for pair in samples.windows(2) {
            self.advance(&mut state, step_s, pair[0].time_s, pair[1].time_s);
            worst = worst.max(state.angles.max_abs_difference(&of(&pair[1].q)));
        }
        worst
    }
}

fn start(sample: &JointSample) -> SystemState {
    SystemState {
        angles: of(&sample.q),
        rates: of(&sample.qd),
        world_from_base: Isometry3::identity(),
        base_velocity: Motion::zero(),
    }
}

/// Prints lines for `plot_checks.py`.
fn plot_steps(what: &str, off: &[f64; 4]) {
    let name = what.replace(", ", "/").replace(' ', "-");
    for (step_s, off) in STEPS_S.iter().zip(off) {
        eprintln!("plot convergence/{name} {step_s} {off:e}");
    }
}

/// Prints the errors, and checks them: of second order between all but the coarsest steps, and below `limit` at the
/// world's own step.
fn converges(what: &str, off: &[f64; 4], limit: f64) {
    let orders: Vec<f64> = off.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect();
    let show = |values: &[f64]| values.iter().map(|v| format!("{v:.2e}")).collect::<Vec<_>>().join(", ");
    eprintln!("{what}: off by {} at 4, 2, 1, 0.5 ms; orders {orders:.2?}", show(off));
    plot_steps(what, off);
    assert!(off[1] < limit, "{what}: {} at 2 ms", off[1]);
    assert!(orders[1..].iter().all(|order| (1.7..2.6).contains(order)), "{what}: {orders:?}");
}

#[test]
fn a_fall_converges_to_pinocchios_with_the_square_of_the_step() {
    for (robot, file) in arms::<Paths>() {
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, None));
        let still = Environment::still(file.gravity_m_s2);
        let run = Run {
            arm: &arm,
            damping_n_m_s_rad: file.falling.damping_n_m_s_rad,
            torque_n_m: &|_, _| 0.0,
            is_free: false,
            around: &|_, _| (still, AT_REST),
        };
        let off = STEPS_S.map(|step_s| run.off(&file.falling.samples, step_s));
        converges(&format!("{}, falling, rad", robot.name), &off, 1e-3);
    }
}

#[test]
fn a_swing_on_a_shaken_base_converges_to_pinocchios_with_the_square_of_the_step() {
    for (robot, file) in arms::<Paths>() {
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, None));
        let run = Run {
            arm: &arm,
            damping_n_m_s_rad: file.shaken.damping_n_m_s_rad,
            torque_n_m: &|_, _| 0.0,
            is_free: false,
            around: &|t, _| shaken_base(&file.shaken.base_motion, t, file.gravity_m_s2),
        };
        let off = STEPS_S.map(|step_s| run.off(&file.shaken.samples, step_s));
        converges(&format!("{}, shaken base, rad", robot.name), &off, 1e-3);
    }
}

/// Largest differences along the way: angles (rad), base position (m) and turn (rad), momentum (kg m/s and kg m2/s).
fn flight_off(name: &str, arm: &Multibody, rocking: &Rocking, samples: &[FlightSample], step_s: f64) -> [f64; 4] {
    let run = Run {
        arm,
        damping_n_m_s_rad: rocking.damping_n_m_s_rad,
        torque_n_m: &|t, j| {
            let (amplitude, rate) = (rocking.tau_amplitude_n_m.get(j), rocking.tau_rate_rad_s.get(j));
            amplitude.zip(rate).map_or(0.0, |(amplitude, rate)| amplitude * (rate * t).sin())
        },
        is_free: true,
        around: &|_, at| {
            let around = Environment { base_velocity: at.base_velocity, ..Environment::still(0.0) };
            (around, BaseCoupling::Free)
        },
    };
    let mut state = start(&samples[0].joints);
    state.base_velocity = samples[0].base.velocity();
    let mut worst = [0.0_f64; 4];
    for pair in samples.windows(2) {
        run.advance(&mut state, step_s, pair[0].joints.time_s, pair[1].joints.time_s);
        let expected = &pair[1];
        let position = Translation3::from(Vector3::from(expected.base_position_m));
        let base = Isometry3::from_parts(position, expected.base.rotation());
        let found = arm.momentum(&state.angles, &state.rates, &state.base_velocity);
        let to_world = state.world_from_base.rotation;
        let linear = to_world * found.force;
        let angular = to_world * found.moment + state.world_from_base.translation.vector.cross(&linear);
        let kept = (linear - Vector3::from(expected.linear_momentum_kg_m_s)).amax();
        let off = [
            state.angles.max_abs_difference(&of(&expected.joints.q)),
            (state.world_from_base.translation.vector - base.translation.vector).norm(),
            state.world_from_base.rotation.angle_to(&base.rotation),
            kept.max((angular - Vector3::from(expected.angular_momentum_kg_m2_s)).amax()),
        ];
        if step_s == STEPS_S[1] {
            let [turn, expected] = [to_world, base.rotation].map(|rotation| rotation.angle());
            eprintln!("plot rocking/{name} {} {turn:e} {expected:e}", pair[1].joints.time_s);
        }
        for (worst, off) in worst.iter_mut().zip(off) {
            *worst = worst.max(off);
        }
    }
    worst
}

#[test]
fn a_rocked_vehicle_converges_to_pinocchios_with_the_square_of_the_step() {
    for (robot, file) in arms::<Paths>() {
        let arm = Multibody::new(robot.chain.clone(), dry(&robot, Some(&file.rocking.vehicle)));
        for (name, flight) in [("from rest", &file.rocking.from_rest), ("drifting", &file.rocking.drifting)] {
            let label = format!("{}/{}", robot.name, name.replace(' ', "-"));
            let off = STEPS_S.map(|step_s| flight_off(&label, &arm, &file.rocking, &flight.samples, step_s));
            let figures = [("angle, rad", 1e-3), ("base position, m", 1e-3), ("base turn, rad", 1e-3)];
            for (k, (what, limit)) in figures.into_iter().enumerate() {
                converges(&format!("{}, {name}, {what}", robot.name), &off.map(|all| all[k]), limit);
            }
            let momentum = off.map(|all| all[3]);
            let shown = momentum.map(|off| format!("{off:.1e}")).join(", ");
            eprintln!("{}, {name}: momentum off by {shown}", robot.name);
            plot_steps(&format!("{label}/momentum"), &momentum);
            assert!(momentum[1] < 0.1, "{momentum:?}");
            assert!(momentum[1] / momentum[3] > 8.0, "{momentum:?}");
        }
    }
}

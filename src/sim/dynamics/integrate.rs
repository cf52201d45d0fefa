//! One step: ROS2, a linearly implicit Runge-Kutta method of second order (Verwer, Spee, Blom, Hundsdorfer, SIAM J.
//! Sci. Comput. 20, 1999), `gamma = 1 - 1/sqrt 2`, L-stable.
//!
//! For `y' = f(y)` and any matrix `A` near its Jacobian: `(1 - g h A) k1 = f(y)`,
//! `(1 - g h A) w = f(y + h k1) - 2 g h A k1`, `y += h/2 (k1 + w)`. The order does not depend on `A`, stability does:
//! here it holds the springs and dampers about the joints and those of contacts. Their blocks put `g h C + g2 h2 K` on
//! top of the inertia, so that a step costs two factorisations of it. A free base moves on its group, by the
//! exponential of its twist.

use nalgebra::{Isometry3, Vector6};

use crate::dynamics::JointLoad;
use crate::dynamics::equations::{BaseCoupling, Environment, EquationInput, Equations, Multibody};
use crate::dynamics::spatial::{Force, Motion};
use crate::dynamics::system::{Coordinates, MAX_DOF, Symmetric};
use armcal_core::spatial::exp;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Positions and velocities of the system.
#[derive(Clone, Copy, Debug)]
pub struct SystemState {
    /// Joint angles, rad.
    pub angles: JointAngles,
    /// Joint rates, rad/s.
    pub rates: JointAngles,
    /// Pose of a free base; the caller has that of a prescribed base.
    pub world_from_base: Isometry3<f64>,
    /// Spatial velocity of a free base about its origin, base axes.
    pub base_velocity: Motion,
}

/// A spring and a damper along one direction of the generalised coordinates:
/// `force = start - stiffness travel - damping rate`.
#[derive(Clone, Copy, Debug)]
pub struct ContactRow {
    /// Direction in the generalised coordinates.
    pub direction: Coordinates,
    /// Force along it at the start of the step, at rest.
    pub start_n: f64,
    /// Stiffness of the spring.
    pub stiffness_n_m: f64,
    /// Damping of the damper.
    pub damping_n_s_m: f64,
}

/// Loads during one step.
pub struct StepInput<'a> {
    /// Length of the step.
    pub step_s: f64,
    /// Torque about each joint, linear in angle and rate.
    pub loads: &'a [JointLoad; MAX_JOINTS],
    /// Force on each body about the base's origin, base axes.
    pub extra: &'a [Force; MAX_JOINTS + 1],
    /// Springs and dampers of the points of contact.
    pub contacts: &'a [ContactRow],
    /// True if the base is free.
    pub is_free: bool,
    /// Surroundings at the start and at the end, for a base with this pose and motion.
    pub around: &'a dyn Fn(Stage, &SystemState) -> (Environment, BaseCoupling),
}

/// Instant of a step at which the method evaluates the slope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The state before the step.
    Start,
    /// The state that the first slope predicts.
    End,
}

/// Coefficient gamma: `1 - 1/sqrt 2`.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// Rates of all coordinates: of positions and of velocities.
struct Slope {
    position: Coordinates,
    velocity: Coordinates,
}

impl Multibody {
    /// Moves the state by one step.
    pub fn step(&self, state: &mut SystemState, input: &StepInput) {
        let h = input.step_s;
        let first_joint = if input.is_free { 6 } else { 0 };
        let first = self.slope(input, Stage::Start, state, None);
        let predicted = advanced(state, &first, h, first_joint);
        let second = self.slope(input, Stage::End, &predicted, Some(&first));
        let mean = Slope {
            position: std::array::from_fn(|i| 0.5 * (first.position[i] + second.position[i])),
            velocity: std::array::from_fn(|i| 0.5 * (first.velocity[i] + second.velocity[i])),
        };
        *state = advanced(state, &mean, h, first_joint);
    }

    /// Returns the slope at a stage; `first` is the slope of the stage before it.
    fn slope(&self, input: &StepInput, stage: Stage, at: &SystemState, first: Option<&Slope>) -> Slope {
        let gh = GAMMA * input.step_s;
        let (around, base) = (input.around)(stage, at);
        let Equations { mut inertia, bias, first_joint } = self.equations(&EquationInput {
            angles: &at.angles,
            rates: &at.rates,
            around: &around,
            base: &base,
            extra: input.extra,
        });
        let n = first_joint + self.chain().n_joints();
        let mut velocity = coordinates(at, first_joint);
        let mut forces: Coordinates = std::array::from_fn(|i| -bias[i]);
        if let Some(first) = first {
            for (slot, rate) in velocity.iter_mut().zip(&first.velocity) {
                *slot -= 2.0 * gh * rate;
            }
        }
        for (j, load) in input.loads.iter().enumerate().take(self.chain().n_joints()) {
            let i = first_joint + j;
            let (k, c) = (load.stiffness_n_m_rad, load.damping_n_m_s_rad);
            forces[i] += load.torque_n_m(at.angles[j], at.rates[j]) - gh * k * velocity[i];
            if let Some(first) = first {
                forces[i] += 2.0 * gh * (k * first.position[i] + c * first.velocity[i]);
            }
            inertia.add(i, i, gh * (c + gh * k));
        }
        if !input.contacts.is_empty() {
            let now = coordinates(at, first_joint);
            let travel: Coordinates = first.map_or([0.0; MAX_DOF], |f| f.position.map(|rate| rate * input.step_s));
            let state = RowState { n, gh, now: &now, travel: &travel, velocity: &velocity, first };
            for row in input.contacts {
                add_row(row, &state, &mut inertia, &mut forces);
            }
        }
        let acceleration = inertia.solve(&forces);
        Slope { position: std::array::from_fn(|i| velocity[i] + gh * acceleration[i]), velocity: acceleration }
    }
}

/// State that a contact's force in a stage depends on.
struct RowState<'a> {
    /// Number of the system's coordinates.
    n: usize,
    /// Step length times gamma, s.
    gh: f64,
    now: &'a Coordinates,
    /// Travel since the start of the step.
    travel: &'a Coordinates,
    /// Velocity in the implicit part.
    velocity: &'a Coordinates,
    first: Option<&'a Slope>,
}

fn add_row(row: &ContactRow, state: &RowState, inertia: &mut Symmetric, forces: &mut Coordinates) {
    let gh = state.gh;
    let along = |v: &Coordinates| (0..state.n).map(|i| row.direction[i] * v[i]).sum::<f64>();
    let (k, c) = (row.stiffness_n_m, row.damping_n_s_m);
    let mut force = row.start_n - k * along(state.travel) - c * along(state.now) - gh * k * along(state.velocity);
    if let Some(first) = state.first {
        force += 2.0 * gh * (k * along(&first.position) + c * along(&first.velocity));
    }
    for (slot, share) in forces.iter_mut().zip(&row.direction) {
        *slot += force * share;
    }
    inertia.add_outer(gh * (c + gh * k), &row.direction);
}

/// Returns the velocities as coordinates.
fn coordinates(state: &SystemState, first_joint: usize) -> Coordinates {
    let mut v = [0.0; MAX_DOF];
    if first_joint > 0 {
        v[..6].copy_from_slice(&state.base_velocity.to_array());
    }
    for (slot, rate) in v[first_joint..].iter_mut().zip(state.rates.iter()) {
        *slot = *rate;
    }
    v
}

fn advanced(state: &SystemState, slope: &Slope, h: f64, first_joint: usize) -> SystemState {
    let n = state.angles.len();
    let mut next = *state;
    next.angles = JointAngles::from_fn(n, |j| state.angles[j] + h * slope.position[first_joint + j]);
    next.rates = JointAngles::from_fn(n, |j| state.rates[j] + h * slope.velocity[first_joint + j]);
    if first_joint > 0 {
        let twist = Motion::from_slice(&slope.position);
        let (l, a) = (twist.linear * h, twist.angular * h);
        next.world_from_base = state.world_from_base * exp(&Vector6::new(l.x, l.y, l.z, a.x, a.y, a.z));
        next.base_velocity = state.base_velocity + Motion::from_slice(&slope.velocity) * h;
    }
    next
}

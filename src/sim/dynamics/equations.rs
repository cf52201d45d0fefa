//! Equations of motion of one state: `M a = forces - bias`.

use nalgebra::{Isometry3, Vector3};

use crate::dynamics::body::Body;
use crate::dynamics::spatial::{Force, Inertia, Motion};
use crate::dynamics::system::{Coordinates, Symmetric};
use armcal_core::kinematics::{Chain, LinkPoses};
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Arm on its base. Body 0 is the base's own; body `j + 1` is moved by joint `j`.
#[derive(Clone, Debug)]
pub struct Multibody {
    chain: Chain,
    bodies: Vec<Body>,
}

/// Gravity, base velocity and water about the arm at one instant, in base axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Environment {
    /// Gravity, m/s2.
    pub gravity: Vector3<f64>,
    /// Velocity of the base against the world, at its origin.
    pub base_velocity: Motion,
    /// Velocity of the water against the world, the same everywhere about the arm, m/s.
    pub water_velocity: Vector3<f64>,
    /// Acceleration of the water, m/s2.
    pub water_acceleration: Vector3<f64>,
}

impl Environment {
    /// Returns the surroundings of a base at rest in still water, z up.
    #[must_use]
    pub fn still(gravity_m_s2: f64) -> Self {
        Self {
            gravity: Vector3::new(0.0, 0.0, -gravity_m_s2),
            base_velocity: Motion::zero(),
            water_velocity: Vector3::zeros(),
            water_acceleration: Vector3::zeros(),
        }
    }

    #[inline]
    fn water_moves(&self) -> bool {
        self.water_velocity != Vector3::zeros() || self.water_acceleration != Vector3::zeros()
    }
}

/// Coupling of the base to the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BaseCoupling {
    /// Prescribed motion of the base: spatial acceleration about its origin, base axes.
    Prescribed(Motion),
    /// Free base: its six coordinates (angular, then linear, base axes) come before those of the joints.
    Free,
}

/// State of the system, and the forces in addition to gravity and water.
#[derive(Clone, Copy, Debug)]
pub struct EquationInput<'a> {
    /// Joint angles, rad.
    pub angles: &'a JointAngles,
    /// Joint rates, rad/s.
    pub rates: &'a JointAngles,
    /// Gravity, base velocity and water.
    pub around: &'a Environment,
    /// Motion of the base: prescribed or free.
    pub base: &'a BaseCoupling,
    /// Force on each body about the base's origin in base axes, e.g. of contacts.
    pub extra: &'a [Force; MAX_JOINTS + 1],
}

/// Inertia and bias of one state.
#[derive(Clone, Copy, Debug)]
pub struct Equations {
    /// Inertia of the generalised coordinates, added mass included.
    pub inertia: Symmetric,
    /// Generalised forces that keep the accelerations at zero (those of the base at the prescribed ones), N m (N).
    pub bias: Coordinates,
    /// Coordinates before the joints': 6 for a free base, else 0.
    pub first_joint: usize,
}

impl Multibody {
    /// Builds the system; `bodies` are those of the links 0..=n, base first.
    #[must_use]
    pub fn new(chain: Chain, bodies: Vec<Body>) -> Self {
        assert_eq!(bodies.len(), chain.n_joints() + 1, "a body for each link");
        Self { chain, bodies }
    }

    /// Replaces the base's own body.
    pub fn set_base(&mut self, body: Body) {
        self.bodies[0] = body;
    }

    /// Returns the kinematics of the arm.
    #[must_use]
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    pub(super) fn chain_mut(&mut self) -> &mut Chain {
        &mut self.chain
    }

    /// Returns the bodies of the links 0..=n, base first.
    #[must_use]
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Returns inertia and bias of one state.
    #[must_use]
    pub fn equations(&self, input: &EquationInput) -> Equations {
        let EquationInput { angles, rates, around, base, extra } = *input;
        let n = self.chain.n_joints();
        let poses = self.chain.link_poses(angles);
        let axes = joint_axes(&poses, n);
        let mut composite = [Inertia::zero(); MAX_JOINTS + 1];
        let mut force = [Force::zero(); MAX_JOINTS + 1];
        let mut velocity = around.base_velocity;
        let mut acceleration = match base {
            BaseCoupling::Prescribed(a) => *a,
            BaseCoupling::Free => Motion::zero(),
        };
        let first_body = usize::from(matches!(base, BaseCoupling::Prescribed(_)));
        for body in 0..=n {
            if body > 0 {
                let turning = axes[body - 1] * rates[body - 1];
                velocity = velocity + turning;
                acceleration = acceleration + velocity.cross(&turning);
            }
            if body < first_body {
                continue;
            }
            let place = poses.link(body);
            let (inertia, wanted) = self.bodies[body].newton_euler(place, &velocity, &acceleration, around);
            composite[body] = inertia;
            force[body] = wanted - extra[body];
        }
        for body in (1..=n).rev() {
            composite[body - 1] = composite[body - 1] + composite[body];
            let outer = force[body];
            force[body - 1] += outer;
        }
        assemble(n, &axes, &composite, &force, base)
    }

    /// Returns the torques of gravity and buoyancy about each joint at rest, N m.
    #[must_use]
    pub fn static_torques(&self, angles: &JointAngles, gravity: &Vector3<f64>) -> JointAngles {
        let still = Environment { gravity: *gravity, ..Environment::still(0.0) };
        let rates = JointAngles::from_fn(angles.len(), |_| 0.0);
        let equations = self.equations(&EquationInput {
            angles,
            rates: &rates,
            around: &still,
            base: &BaseCoupling::Prescribed(Motion::zero()),
            extra: &[Force::zero(); MAX_JOINTS + 1],
        });
        JointAngles::from_fn(angles.len(), |j| -equations.bias[j])
    }

    /// Returns the momentum of the whole about the base's origin in base axes, including that of the moving water;
    /// still water.
    #[must_use]
    pub fn momentum(&self, angles: &JointAngles, rates: &JointAngles, base_velocity: &Motion) -> Force {
        let poses = self.chain.link_poses(angles);
        let axes = joint_axes(&poses, self.chain.n_joints());
        let mut velocity = *base_velocity;
        let mut total = Force::zero();
        for (body, inertia) in self.bodies.iter().enumerate() {
            if body > 0 {
                velocity = velocity + axes[body - 1] * rates[body - 1];
            }
            total += (inertia.rigid + inertia.added).placed(poses.link(body)).momentum(&velocity);
        }
        total
    }
}

impl Body {
    /// Returns the inertia of the body, and the force that this motion needs, both about the base's origin.
    ///
    /// The water's part, with `u` its velocity and `r` the body's velocity against it (Kirchhoff; in the frame that
    /// moves with the water the spatial acceleration has `w x u` more): `Ia (a + w x u - du/dt) + r x* Ia r`.
    pub(crate) fn newton_euler(
        &self,
        place: &Isometry3<f64>,
        velocity: &Motion,
        acceleration: &Motion,
        around: &Environment,
    ) -> (Inertia, Force) {
        if self.is_dry() {
            let all = self.placed_dry(place);
            let inertial = all.momentum(acceleration) + velocity.cross_force(&all.momentum(velocity));
            return (all, inertial - self.weight(place, &around.gravity, &around.water_acceleration));
        }
        let against_water = Motion::new(velocity.angular, velocity.linear - around.water_velocity);
        let (inertia, inertial) = if around.water_moves() {
            let (rigid, added) = (self.rigid.placed(place), self.added.placed(place));
            let seen = velocity.angular.cross(&around.water_velocity) - around.water_acceleration;
            let in_water = Motion::new(acceleration.angular, acceleration.linear + seen);
            let force = rigid.momentum(acceleration)
                + velocity.cross_force(&rigid.momentum(velocity))
                + added.momentum(&in_water)
                + against_water.cross_force(&added.momentum(&against_water));
            (rigid + added, force)
        } else {
            let all = (self.rigid + self.added).placed(place);
            (all, all.momentum(acceleration) + velocity.cross_force(&all.momentum(velocity)))
        };
        let loads = self.weight(place, &around.gravity, &around.water_acceleration) + self.drag(place, &against_water);
        (inertia, inertial - loads)
    }
}

pub(super) fn joint_axes(poses: &LinkPoses, n: usize) -> [Motion; MAX_JOINTS] {
    let mut axes = [Motion::zero(); MAX_JOINTS];
    for (j, slot) in axes.iter_mut().enumerate().take(n) {
        *slot = Motion::rotation(poses.axis(j), &poses.joint_origin(j));
    }
    axes
}

/// Assembles the inertia of composite rigid bodies: `M[i][j] = s_i . Ic_j s_j` for i <= j, the base's columns before
/// the joints'.
fn assemble(
    n: usize,
    axes: &[Motion; MAX_JOINTS],
    composite: &[Inertia; MAX_JOINTS + 1],
    force: &[Force; MAX_JOINTS + 1],
    base: &BaseCoupling,
) -> Equations {
    let first = if matches!(base, BaseCoupling::Free) { 6 } else { 0 };
    let mut inertia = Symmetric::zeros(first + n);
    let mut bias = [0.0; crate::dynamics::MAX_DOF];
    for j in 0..n {
        let carried = composite[j + 1].momentum(&axes[j]);
        for (i, axis) in axes.iter().enumerate().take(j + 1) {
            inertia.set(first + j, first + i, axis.dot(&carried));
        }
        bias[first + j] = axes[j].dot(&force[j + 1]);
        if first > 0 {
            for (k, value) in carried.to_array().into_iter().enumerate() {
                inertia.set(first + j, k, value);
            }
        }
    }
    if first > 0 {
        let whole = &composite[0];
        for row in 0..3 {
            for column in 0..3 {
                inertia.set(row, column, whole.rotational[(row, column)]);
                inertia.set(row, 3 + column, whole.coupling[(row, column)]);
                inertia.set(3 + row, 3 + column, whole.linear[(row, column)]);
            }
        }
        bias[..6].copy_from_slice(&force[0].to_array());
    }
    Equations { inertia, bias, first_joint: first }
}

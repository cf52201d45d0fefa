//! State of arm and vehicle, moved step by step.

use nalgebra::{Isometry3, Vector3};

use crate::body_poses::BodyPoses;
use crate::dynamics::{
    BaseCoupling, Body, Environment, Force, JointLoad, MAX_DOF, Motion, Multibody, Stage, StepInput, SystemState,
    WaterProperties,
};
use crate::physics::contacts::{ContactState, ContactWorld};
use crate::solids::Solids;
use crate::spec::{PhysicsSpec, WaterSpec};
use crate::vehicle::{BaseState, GRAVITY_M_S2, WaterMotion};
use armcal_core::kinematics::{Chain, LinkPoses};
use armcal_core::robot::LinkBody;
use armcal_core::spatial::{Base, Pose, Vehicle};
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// The arm, the vehicle if it is free, and what they may collide with.
pub(crate) struct ArmPhysics {
    multibody: Multibody,
    state: SystemState,
    /// The rate of a free base's velocity over the last step.
    base_rate: Motion,
    is_free: bool,
    poses: LinkPoses,
    /// `None` for an arm that collides with nothing.
    contacts: Option<(ContactWorld, Solids)>,
    push: Option<Push>,
    step_s: f64,
}

pub(crate) struct PhysicsInput<'a> {
    pub chain: &'a Chain,
    /// Bodies 0..=n, base first.
    pub bodies: &'a [LinkBody],
    /// `None` for an arm that collides with nothing.
    pub solids: Option<&'a Solids>,
    pub water: &'a WaterSpec,
    /// A body that one of them carries.
    pub payload: Option<&'a (usize, Body)>,
    pub spec: &'a PhysicsSpec,
    pub angles: JointAngles,
}

/// The base's motion at both ends of a step, where it is prescribed; the water's, in world axes; and what pushes a free
/// vehicle.
pub(crate) struct Drive<'a> {
    pub base: [&'a BaseState; 2],
    pub water: [WaterMotion; 2],
    /// About the base's origin, base axes.
    pub vehicle_force: Force,
    /// On each body besides, about the base's origin, base axes.
    pub pulls: &'a [Force; MAX_JOINTS + 1],
    pub loads: &'a [JointLoad; MAX_JOINTS],
}

/// A force on a link for some time.
#[derive(Clone, Copy, Debug)]
struct Push {
    body: usize,
    point_m: Vector3<f64>,
    force_n: Vector3<f64>,
    steps: u64,
}

impl ArmPhysics {
    pub(crate) fn new(input: &PhysicsInput) -> Self {
        let water = WaterProperties::of(input.water);
        let mut bodies: Vec<Body> = input.bodies.iter().map(|link| Body::link(link, &water)).collect();
        if let Some((body, payload)) = input.payload {
            bodies[*body].carry(payload);
        }
        bodies[0] = Body::none();
        let contacts = input.solids.map(|s| (ContactWorld::new(input.chain, s, input.spec, &input.angles), s.clone()));
        let state = SystemState {
            angles: input.angles,
            rates: JointAngles::from_fn(input.angles.len(), |_| 0.0),
            world_from_base: Isometry3::identity(),
            base_velocity: Motion::zero(),
        };
        Self {
            poses: input.chain.link_poses(&input.angles),
            multibody: Multibody::new(input.chain.clone(), bodies),
            state,
            base_rate: Motion::zero(),
            is_free: false,
            contacts,
            push: None,
            step_s: input.spec.step_s,
        }
    }

    /// Lets the base float: `vehicle` is what it carries.
    pub(crate) fn set_free(&mut self, vehicle: Body, world_from_base: &Isometry3<f64>) {
        self.multibody.set_base(vehicle);
        self.state.world_from_base = *world_from_base;
        self.is_free = true;
    }

    pub(crate) fn multibody(&self) -> &Multibody {
        &self.multibody
    }

    /// Puts the first joint where the mount has brought it.
    pub(crate) fn set_first_place(&mut self, base_from_joint: &Isometry3<f64>) {
        self.multibody.set_first_place(base_from_joint);
        self.poses = self.multibody.chain().link_poses(&self.state.angles);
    }

    /// True joint angles, rad.
    pub(crate) fn angles(&self) -> JointAngles {
        self.state.angles
    }

    /// True joint rates, rad/s.
    pub(crate) fn rates(&self) -> JointAngles {
        self.state.rates
    }

    /// Poses of all links, base frame.
    pub(crate) fn poses(&self) -> BodyPoses {
        BodyPoses::drawn(self.state.angles.len(), &self.poses)
    }

    /// A free base's motion.
    pub(crate) fn base_state(&self, vehicle_from_base: &Pose<Vehicle, Base>) -> BaseState {
        let state = &self.state;
        BaseState::of_free_base(&state.world_from_base, &state.base_velocity, &self.base_rate, vehicle_from_base)
    }

    /// Something pushes a link at a point of its own frame for a while, with a force in base axes.
    pub(crate) fn push(&mut self, body: usize, point_m: &Vector3<f64>, force_n: &Vector3<f64>, duration_s: f64) {
        let steps = (duration_s / self.step_s).round().max(1.0) as u64;
        self.push = Some(Push { body, point_m: *point_m, force_n: *force_n, steps });
    }

    /// One step.
    pub(crate) fn step(&mut self, drive: &Drive) {
        let extra = self.extra(drive);
        let before = self.state.base_velocity;
        let mut state = self.state;
        let Self { multibody, contacts, poses, is_free, step_s, .. } = self;
        let is_free = *is_free;
        let first_joint = if is_free { 6 } else { 0 };
        let rows = match contacts {
            Some((world, solids)) => world.update(solids.shapes(), &contact_state(&state, poses, first_joint, drive)),
            None => &[],
        };
        let around = |stage: Stage, at: &SystemState| {
            if is_free { free_environment(drive, stage, at) } else { prescribed_environment(drive, stage) }
        };
        multibody.step(
            &mut state,
            &StepInput { step_s: *step_s, loads: drive.loads, extra: &extra, contacts: rows, is_free, around: &around },
        );
        self.state = state;
        self.base_rate = (state.base_velocity - before) * (1.0 / self.step_s);
        self.poses = self.multibody.chain().link_poses(&state.angles);
    }

    /// Forces on each body besides what gravity and water do.
    fn extra(&mut self, drive: &Drive) -> [Force; MAX_JOINTS + 1] {
        let mut extra = *drive.pulls;
        extra[0] += drive.vehicle_force;
        if let Some(push) = &mut self.push {
            let place = self.poses.link(push.body);
            let point = place.rotation * push.point_m + place.translation.vector;
            extra[push.body] += Force::at(&point, &push.force_n);
            push.steps -= 1;
            if push.steps == 0 {
                self.push = None;
            }
        }
        extra
    }

    /// Calls `touch` with the two parts of every pair that touches now.
    pub(crate) fn for_each_contact(&self, touch: impl FnMut(usize, usize)) {
        if let Some((contacts, _)) = &self.contacts {
            contacts.for_each(touch);
        }
    }
}

/// Environment of a free base, by its own state.
fn free_environment(drive: &Drive, stage: Stage, at: &SystemState) -> (Environment, BaseCoupling) {
    let water = &drive.water[usize::from(stage == Stage::End)];
    let to_base = at.world_from_base.rotation.inverse();
    let around = Environment {
        gravity: to_base * Vector3::new(0.0, 0.0, -GRAVITY_M_S2),
        base_velocity: at.base_velocity,
        water_velocity: to_base * water.velocity,
        water_acceleration: to_base * water.acceleration,
    };
    (around, BaseCoupling::Free)
}

/// Environment of a base that moves as prescribed.
fn prescribed_environment(drive: &Drive, stage: Stage) -> (Environment, BaseCoupling) {
    let end = usize::from(stage == Stage::End);
    let (base, water) = (drive.base[end], &drive.water[end]);
    let to_base = base.world_from_base.rotation().inverse();
    let around = Environment {
        gravity: base.gravity,
        base_velocity: base.motion(),
        water_velocity: to_base * water.velocity,
        water_acceleration: to_base * water.acceleration,
    };
    (around, BaseCoupling::Prescribed(base.spatial_acceleration()))
}

fn contact_state<'a>(
    state: &'a SystemState,
    poses: &'a LinkPoses,
    first_joint: usize,
    drive: &Drive,
) -> ContactState<'a> {
    let mut velocity = [0.0; MAX_DOF];
    let (base_velocity, base_from_ground) = if first_joint > 0 {
        velocity[..6].copy_from_slice(&state.base_velocity.to_array());
        (state.base_velocity, state.world_from_base.inverse())
    } else {
        (drive.base[0].motion(), *drive.base[0].world_from_base.inverse().isometry())
    };
    for (slot, rate) in velocity[first_joint..].iter_mut().zip(state.rates.iter()) {
        *slot = *rate;
    }
    ContactState { poses, angles: &state.angles, velocity, first_joint, base_velocity, base_from_ground }
}

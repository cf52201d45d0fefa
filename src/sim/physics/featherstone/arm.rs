//! Arm and vehicle by our own equations of motion.

use nalgebra::{Isometry3, Vector3};

use crate::body_poses::BodyPoses;
use crate::dynamics::{BaseCoupling, Body, Environment, MAX_DOF, Motion, Multibody, Stage, StepInput, SystemState};
use crate::physics::engine::{Drive, Engine, PhysicsInput};
use crate::physics::featherstone::contacts::{ContactState, ContactWorld};
use crate::solids::Solids;
use crate::vehicle::BaseState;
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::GRAVITY_M_S2;
use armcal_core::spatial::{Base, Pose, Vehicle};
use armcal_core::streams::JointAngles;

/// Arm, the vehicle if it is free, and the solids with which they may collide.
pub(in crate::physics) struct Featherstone {
    multibody: Multibody,
    state: SystemState,
    /// Rate of change of a free base's velocity over the last step.
    base_rate: Motion,
    is_free: bool,
    poses: LinkPoses,
    /// Contacts; `None` for an arm without collisions.
    contacts: Option<(ContactWorld, Solids)>,
    step_s: f64,
}

impl Featherstone {
    pub(in crate::physics) fn new(input: PhysicsInput) -> Self {
        let PhysicsInput { chain, mut bodies, free_base, solids, spec, angles, .. } = input;
        if free_base.is_none() {
            bodies[0] = Body::none();
        }
        let contacts = solids.map(|s| (ContactWorld::new(chain, s, spec, &angles), s.clone()));
        let state = SystemState {
            angles,
            rates: JointAngles::from_fn(angles.len(), |_| 0.0),
            world_from_base: free_base.unwrap_or_else(Isometry3::identity),
            base_velocity: Motion::zero(),
        };
        Self {
            poses: chain.link_poses(&angles),
            multibody: Multibody::new(chain.clone(), bodies),
            state,
            base_rate: Motion::zero(),
            is_free: free_base.is_some(),
            contacts,
            step_s: spec.step_s,
        }
    }
}

impl Engine for Featherstone {
    fn angles(&self) -> JointAngles {
        self.state.angles
    }

    fn rates(&self) -> JointAngles {
        self.state.rates
    }

    fn poses(&self) -> BodyPoses {
        BodyPoses::drawn(self.state.angles.len(), &self.poses)
    }

    fn base_state(&self, vehicle_from_base: &Pose<Vehicle, Base>) -> Option<BaseState> {
        let SystemState { world_from_base, base_velocity, .. } = &self.state;
        self.is_free
            .then(|| BaseState::of_free_base(world_from_base, base_velocity, &self.base_rate, vehicle_from_base))
    }

    fn set_first_place(&mut self, base_from_joint: &Isometry3<f64>) {
        self.multibody.set_first_place(base_from_joint);
        self.poses = self.multibody.chain().link_poses(&self.state.angles);
    }

    fn step(&mut self, drive: &Drive) {
        let before = self.state.base_velocity;
        let mut state = self.state;
        let Self { multibody, contacts, poses, is_free, step_s, .. } = self;
        let is_free = *is_free;
        let first_joint = if is_free { 6 } else { 0 };
        let first_place = multibody.chain().first_place();
        let rows = match contacts {
            Some((world, solids)) => {
                world.update(solids.shapes(), &contact_state(&state, poses, first_joint, first_place, drive))
            }
            None => &[],
        };
        let around = |stage: Stage, at: &SystemState| {
            if is_free { free_environment(drive, stage, at) } else { prescribed_environment(drive, stage) }
        };
        let input = StepInput {
            step_s: *step_s,
            loads: drive.loads,
            extra: drive.wrenches,
            contacts: rows,
            is_free,
            around: &around,
        };
        multibody.step(&mut state, &input);
        self.state = state;
        self.base_rate = (state.base_velocity - before) * (1.0 / self.step_s);
        self.poses = self.multibody.chain().link_poses(&state.angles);
    }

    #[cfg(test)]
    fn static_torques(&self, gravity: &Vector3<f64>, angles: &JointAngles) -> JointAngles {
        self.multibody.static_torques(angles, gravity)
    }

    fn for_each_contact(&self, touch: &mut dyn FnMut(usize, usize)) {
        if let Some((contacts, _)) = &self.contacts {
            contacts.for_each(touch);
        }
    }
}

/// Returns the environment of a free base, from its own state.
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

/// Returns the environment of a base with prescribed motion.
fn prescribed_environment(drive: &Drive, stage: Stage) -> (Environment, BaseCoupling) {
    let end = usize::from(stage == Stage::End);
    let base = drive.base[end];
    (base.environment(&drive.water[end]), BaseCoupling::Prescribed(base.spatial_acceleration()))
}

fn contact_state<'a>(
    state: &'a SystemState,
    poses: &'a LinkPoses,
    first_joint: usize,
    first_place: Isometry3<f64>,
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
    ContactState { poses, angles: &state.angles, velocity, first_joint, base_velocity, base_from_ground, first_place }
}

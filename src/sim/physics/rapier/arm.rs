//! Arm as rapier's multibody, advanced step by step.

use nalgebra::{Isometry3, Vector3};
use rapier3d::dynamics::{Multibody, MultibodyJointHandle, RigidBodyBuilder, RigidBodyHandle};
use rapier3d::geometry::ColliderHandle;
use rapier3d::pipeline::PhysicsWorld;

use crate::body_poses::BodyPoses;
use crate::convert::to_rapier;
use crate::dynamics::{Environment, Force, JointLoad};
use crate::error::SimError;
use crate::pair_motion::ArmPlace;
use crate::physics::contact_guard::ContactGuard;
use crate::physics::engine::{Drive, Engine, PhysicsInput};
use crate::physics::pair_filter::PairFilter;
use crate::physics::rapier::link_load::{ArmState, Link, link_wrenches};
use crate::physics::rapier::setup::{add_colliders, empty_engine, revolute, rigid_body};
use crate::vehicle::WaterMotion;
use armcal_core::kinematics::{Chain, LinkPoses};
use armcal_core::robot::parry_pose;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Free axis of a revolute joint in rapier's spatial layout (3 linear, then 3 angular): rotation about x.
const ROTATION_X: usize = 3;

/// Arm in rapier, on a fixed root in base axes.
pub(in crate::physics) struct RapierArm {
    engine: PhysicsWorld,
    chain: Chain,
    links: Vec<Link>,
    /// Rigid bodies, root first.
    handles: Vec<RigidBodyHandle>,
    tip: MultibodyJointHandle,
    state: State,
    contacts: Option<Contacts>,
    step_s: f64,
}

/// State after the last step. Rapier's step is `v += h a(q); q += h v`. With its angles half a step ahead of its rates
/// this is the leapfrog, of second order in forces that depend on the angles.
struct State {
    rates: JointAngles,
    /// Mean accelerations over the last step.
    accelerations: JointAngles,
    /// Angles half a step ahead.
    angles_ahead: JointAngles,
    poses_ahead: LinkPoses,
}

/// Solids with which the arm may collide.
struct Contacts {
    filter: PairFilter,
    guard: ContactGuard,
    colliders: Vec<ColliderHandle>,
    ground: RigidBodyHandle,
    /// True if the engine searches for contacts.
    is_on: bool,
}

impl RapierArm {
    /// Builds the arm.
    ///
    /// # Errors
    /// [`SimError`] for a base that floats, an arm without joints, or a joint that rapier refuses.
    pub(in crate::physics) fn new(input: PhysicsInput) -> Result<Self, SimError> {
        let PhysicsInput { chain, bodies, free_base, solids, spec, angles, .. } = input;
        if free_base.is_some() {
            return Err(SimError::FreeBase);
        }
        let mut engine = empty_engine(spec.step_s);
        let links: Vec<Link> = bodies.into_iter().skip(1).map(Link::new).collect();
        let mut handles = vec![engine.bodies.insert(RigidBodyBuilder::fixed())];
        let mut tip = None;
        for (i, (joint, link)) in chain.joints().iter().zip(&links).enumerate() {
            let handle = engine.bodies.insert(rigid_body(link));
            let data = revolute(&joint.parent_from_joint, &joint.axis);
            tip = engine.multibody_joints.insert(handles[i], handle, data, true);
            if tip.is_none() {
                return Err(SimError::Joint { joint: joint.name.clone() });
            }
            handles.push(handle);
        }
        let tip = tip.ok_or_else(|| SimError::Joint { joint: "(none)".into() })?;
        let contacts = solids.map(|solids| {
            let ground = engine.bodies.insert(RigidBodyBuilder::kinematic_position_based().can_sleep(false));
            let colliders = add_colliders(&mut engine, solids, spec, &handles, ground);
            let start = ArmPlace { angles, base_from_ground: Isometry3::identity(), first_place: chain.first_place() };
            let guard = ContactGuard::new(chain, solids, &start);
            let filter = PairFilter::new(solids);
            Contacts { filter, guard, colliders, ground, is_on: false }
        });
        let at_rest = JointAngles::from_fn(angles.len(), |_| 0.0);
        let poses_ahead = chain.link_poses(&angles);
        let state = State { rates: at_rest, accelerations: at_rest, angles_ahead: angles, poses_ahead };
        let mut arm = Self { engine, chain: chain.clone(), links, handles, tip, state, contacts, step_s: spec.step_s };
        arm.place(&angles, &at_rest);
        Ok(arm)
    }

    /// Places the joints at angles, with rates.
    pub(in crate::physics) fn place(&mut self, angles: &JointAngles, rates: &JointAngles) {
        let PhysicsWorld { bodies, multibody_joints, .. } = &mut self.engine;
        let Some((multibody, _)) = multibody_joints.get_mut(self.tip) else { return };
        // First the root: as long as it counts as free, the coordinates begin with its six.
        multibody.forward_kinematics(bodies, true);
        let ahead = JointAngles::from_fn(angles.len(), |j| angles[j] + 0.5 * self.step_s * rates[j]);
        let shift = JointAngles::from_fn(angles.len(), |j| ahead[j] - coordinate(multibody, j));
        multibody.apply_displacements(&shift);
        for (slot, rate) in multibody.generalized_velocity_mut().iter_mut().zip(rates.iter()) {
            *slot = *rate;
        }
        multibody.damping_mut().fill(0.0);
        multibody.forward_kinematics(bodies, true);
        multibody.update_rigid_bodies(bodies, true);
        let accelerations = JointAngles::from_fn(angles.len(), |_| 0.0);
        let poses_ahead = self.chain.link_poses(&ahead);
        self.state = State { rates: *rates, accelerations, angles_ahead: ahead, poses_ahead };
    }

    /// Sets springs and dampers about the joints; a load without a spring is a pair of torques. Rapier evaluates a
    /// spring at the angle after the step. A rest angle shifted by the motion of a steady step makes it act as before
    /// the step.
    fn set_loads(&mut self, loads: &[JointLoad; MAX_JOINTS], wrenches: &mut [Force; MAX_JOINTS + 1]) {
        let Some((multibody, _)) = self.engine.multibody_joints.get_mut(self.tip) else { return };
        for (j, load) in loads.iter().enumerate().take(self.links.len()) {
            let stiffness = load.stiffness_n_m_rad;
            let way_rad = self.step_s * self.state.rates[j];
            let rest_rad = if stiffness > 0.0 { load.constant_n_m / stiffness + way_rad } else { 0.0 };
            if let Some(link) = multibody.link_mut(j + 1) {
                link.joint.set_spring(ROTATION_X, stiffness, rest_rad);
            }
            multibody.damping_mut()[j] = load.damping_n_m_s_rad;
            if stiffness == 0.0 {
                let torque = Force::new(self.state.poses_ahead.axis(j) * load.constant_n_m, Vector3::zeros());
                wrenches[j + 1] += torque;
                wrenches[j] = wrenches[j] - torque;
            }
        }
    }

    fn apply(&mut self, wrenches: &[Force; MAX_JOINTS + 1]) {
        for (body, link) in self.links.iter().enumerate().map(|(j, link)| (j + 1, link)) {
            let Some(rigid) = self.engine.bodies.get_mut(self.handles[body]) else { continue };
            let place = self.state.poses_ahead.link(body);
            let com = place.rotation * link.engine_com_m + place.translation.vector;
            let wrench = &wrenches[body];
            // Forces that were added stay until they are reset.
            rigid.reset_forces(false);
            rigid.reset_torques(false);
            rigid.add_force(to_rapier(&wrench.force), false);
            rigid.add_torque(to_rapier(&(wrench.moment - com.cross(&wrench.force))), false);
        }
    }

    /// Moves the ground, and enables the engine's search for contacts only while contacts are possible.
    fn prepare_contacts(&mut self, drive: &Drive) {
        let Self { contacts: Some(contacts), engine, state, chain, .. } = self else { return };
        let base_from_ground = drive.base.map(|base| *base.world_from_base.inverse().isometry());
        let links = || BodyPoses::drawn(state.rates.len(), &state.poses_ahead);
        let (angles, first_place) = (state.angles_ahead, chain.first_place());
        let place = ArmPlace { angles, base_from_ground: base_from_ground[0], first_place };
        let needed = contacts.guard.contact_is_possible(&place, links);
        if needed != contacts.is_on {
            contacts.is_on = needed;
            for &handle in &contacts.colliders {
                if let Some(collider) = engine.colliders.get_mut(handle) {
                    collider.set_enabled(needed);
                }
            }
            if let Some(ground) = engine.bodies.get_mut(contacts.ground) {
                // If it were driven there from its last position, it would fly through the arm.
                ground.set_position(parry_pose(&base_from_ground[0]), false);
            }
        }
        if let (true, Some(ground)) = (needed, engine.bodies.get_mut(contacts.ground)) {
            ground.set_next_kinematic_position(parry_pose(&base_from_ground[1]));
        }
    }

    /// Reads the engine's state after the step.
    fn read_state(&mut self) {
        let Some((multibody, _)) = self.engine.multibody_joints.get(self.tip) else { return };
        let State { rates, accelerations, angles_ahead, poses_ahead } = &mut self.state;
        let n = rates.len();
        let now = multibody.generalized_velocity();
        *accelerations = JointAngles::from_fn(n, |j| (now[j] - rates[j]) / self.step_s);
        *rates = JointAngles::from_fn(n, |j| now[j]);
        *angles_ahead = JointAngles::from_fn(n, |j| coordinate(multibody, j));
        *poses_ahead = self.chain.link_poses(angles_ahead);
    }
}

impl Engine for RapierArm {
    fn angles(&self) -> JointAngles {
        let State { rates, angles_ahead, .. } = &self.state;
        JointAngles::from_fn(rates.len(), |j| angles_ahead[j] - 0.5 * self.step_s * rates[j])
    }

    fn rates(&self) -> JointAngles {
        self.state.rates
    }

    fn poses(&self) -> BodyPoses {
        BodyPoses::drawn(self.links.len(), &self.chain.link_poses(&self.angles()))
    }

    fn set_first_place(&mut self, base_from_joint: &Isometry3<f64>) {
        self.chain.set_first_place(base_from_joint);
        let (Some((multibody, _)), Some(first)) =
            (self.engine.multibody_joints.get_mut(self.tip), self.chain.joints().first())
        else {
            return;
        };
        if let Some(link) = multibody.link_mut(1) {
            link.joint.data.local_frame1 = revolute(base_from_joint, &first.axis).local_frame1;
        }
        self.state.poses_ahead = self.chain.link_poses(&self.state.angles_ahead);
    }

    fn step(&mut self, drive: &Drive) {
        let [start, end] = drive.base;
        let state = ArmState {
            poses: &self.state.poses_ahead,
            rates: &self.state.rates,
            accelerations: &self.state.accelerations,
            around: &midway(drive),
            base_acceleration: (start.spatial_acceleration() + end.spatial_acceleration()) * 0.5,
        };
        let mut wrenches = link_wrenches(&self.links, &state);
        for (wrench, more) in wrenches.iter_mut().zip(drive.wrenches) {
            *wrench += *more;
        }
        self.set_loads(drive.loads, &mut wrenches);
        self.apply(&wrenches);
        self.prepare_contacts(drive);
        match &self.contacts {
            Some(contacts) => self.engine.step_with_events(&contacts.filter, &()),
            None => self.engine.step(),
        }
        self.read_state();
    }

    #[cfg(test)]
    fn static_torques(&self, gravity: &Vector3<f64>, angles: &JointAngles) -> JointAngles {
        let poses = self.chain.link_poses(angles);
        JointAngles::from_fn(angles.len(), |j| {
            let carried = self.links.iter().enumerate().skip(j);
            let total =
                carried.map(|(i, link)| link.weight(poses.link(i + 1), gravity)).fold(Force::zero(), |a, b| a + b);
            crate::dynamics::Motion::rotation(poses.axis(j), &poses.joint_origin(j)).dot(&total)
        })
    }

    fn for_each_contact(&self, touch: &mut dyn FnMut(usize, usize)) {
        for pair in self.engine.narrow_phase.contact_pairs() {
            let mut points = pair.manifolds().iter().flat_map(|m| &m.points);
            if points.any(|p| p.dist < 0.0 || p.data.impulse > 0.0) {
                let part = |handle| self.engine.colliders.get(handle).map(|c| c.user_data as usize);
                if let (Some(a), Some(b)) = (part(pair.collider1), part(pair.collider2)) {
                    touch(a, b);
                }
            }
        }
    }
}

/// Returns the base's surroundings in the middle of the step, the time of the angles.
fn midway(drive: &Drive) -> Environment {
    let [start, end] = drive.base;
    let to_base = start.world_from_base.rotation().inverse();
    let mean = |of: fn(&WaterMotion) -> Vector3<f64>| to_base * (of(&drive.water[0]) + of(&drive.water[1])) * 0.5;
    Environment {
        gravity: (start.gravity + end.gravity) * 0.5,
        base_velocity: (start.motion() + end.motion()) * 0.5,
        water_velocity: mean(|water| water.velocity),
        water_acceleration: mean(|water| water.acceleration),
    }
}

/// Returns the angle of joint `j`, rad.
fn coordinate(multibody: &Multibody, j: usize) -> f64 {
    multibody.link(j + 1).map_or(f64::NAN, |link| link.joint.coords()[ROTATION_X])
}

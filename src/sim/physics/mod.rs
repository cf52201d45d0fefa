//! The arm as a multibody of the physics engine, in base axes with a fixed root.
//!
//! Each joint hangs on its oil column: an implicit spring towards the piston, which the hydraulics move. Everything
//! else (gravity, buoyancy, drag, the base's motion) comes as forces of `loads`, set anew in each step.

mod guard;

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};
use rapier3d::dynamics::{
    GenericJoint, JointAxesMask, Multibody, MultibodyJointHandle, RigidBodyBuilder, RigidBodyHandle,
};
use rapier3d::geometry::{ColliderBuilder, ColliderHandle};
use rapier3d::math::{Matrix, Vector};
use rapier3d::parry::mass_properties::MassProperties;
use rapier3d::pipeline::{ActiveHooks, PairFilterContext, PhysicsHooks, PhysicsWorld};
use rapier3d::prelude::SolverFlags;

use guard::ContactGuard;

use super::convert::{from_rapier, to_rapier};
use super::error::SimError;
use super::loads::{LinkLoads, LinkMotion};
use super::places::BodyPoses;
use super::solids::{Carrier, PairTable, Solids};
use super::spec::WaterSpec;
use super::vehicle::BaseState;
use crate::kinematics::Chain;
use crate::robot::{LinkBody, parry_pose};
use crate::streams::{JointAngles, MAX_JOINTS};

/// Free axis of a revolute joint in rapier's spatial layout (3 linear, then 3 angular): rotation about x.
const ROTATION_X: usize = 3;

/// The arm, its solver and what it may collide with.
pub(super) struct ArmPhysics {
    engine: PhysicsWorld,
    links: Vec<RigidBodyHandle>,
    tip: MultibodyJointHandle,
    ground: RigidBodyHandle,
    loads: Vec<LinkLoads>,
    filter: PairFilter,
    colliders: Vec<ColliderHandle>,
    /// `None` for an arm that collides with nothing.
    guard: Option<ContactGuard>,
    /// Whether the engine looks for contacts.
    is_colliding: bool,
    is_ground_placed: bool,
}

pub(super) struct PhysicsInput<'a> {
    pub chain: &'a Chain,
    /// Bodies 0..=n, base first.
    pub bodies: &'a [LinkBody],
    /// `None` for an arm that collides with nothing.
    pub solids: Option<&'a Solids>,
    pub water: &'a WaterSpec,
    pub step_s: f64,
    pub angles: JointAngles,
}

/// The oil column of one joint: `torque = stiffness (rest - angle) - damping rate`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Column {
    pub stiffness_n_m_rad: f64,
    pub rest_rad: f64,
}

struct PairFilter {
    pairs: Option<PairTable>,
}

impl PhysicsHooks for PairFilter {
    fn filter_contact_pair(&self, context: &PairFilterContext) -> Option<SolverFlags> {
        let part = |handle| context.colliders.get(handle).map(|c| c.user_data as usize);
        let (a, b) = (part(context.collider1)?, part(context.collider2)?);
        let watched = self.pairs.as_ref().is_some_and(|pairs| pairs.is_watched(a, b));
        watched.then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }
}

impl ArmPhysics {
    pub(super) fn new(input: &PhysicsInput) -> Result<Self, SimError> {
        let mut engine = empty_engine(input.step_s);
        let root = engine.bodies.insert(RigidBodyBuilder::fixed());
        let ground = engine.bodies.insert(RigidBodyBuilder::kinematic_position_based().can_sleep(false));
        let mut links = vec![root];
        let mut tip = None;
        for (i, joint) in input.chain.joints().iter().enumerate() {
            let link = engine.bodies.insert(link_body(&input.bodies[i + 1]));
            let data = revolute(&joint.parent_from_joint, &joint.axis);
            tip = engine.multibody_joints.insert(links[i], link, data, true);
            if tip.is_none() {
                return Err(SimError::Joint { joint: joint.name.clone() });
            }
            links.push(link);
        }
        let tip = tip.ok_or_else(|| SimError::Joint { joint: "(none)".into() })?;
        let colliders = input.solids.map_or(Vec::new(), |solids| add_colliders(&mut engine, solids, &links, ground));
        let guard = input.solids.map(|solids| ContactGuard::new(input.chain, solids, &input.angles));
        let loads = input.bodies[1..].iter().map(|body| LinkLoads::new(body, input.water)).collect();
        let filter = PairFilter { pairs: input.solids.map(|s| s.pairs().clone()) };
        let mut physics = Self {
            engine,
            links,
            tip,
            ground,
            loads,
            filter,
            colliders,
            guard,
            is_colliding: true,
            is_ground_placed: false,
        };
        physics.set_angles(&input.angles);
        physics.set_damping(&[0.0; MAX_JOINTS]);
        Ok(physics)
    }

    /// Puts the joints somewhere, at rest.
    pub(super) fn set_angles(&mut self, angles: &JointAngles) {
        let now = self.angles();
        let PhysicsWorld { bodies, multibody_joints, .. } = &mut self.engine;
        let Some((multibody, _)) = multibody_joints.get_mut(self.tip) else { return };
        // First the root: as long as it counts as free, the coordinates begin with its six.
        multibody.forward_kinematics(bodies, true);
        let shift = JointAngles::from_fn(angles.len(), |j| angles[j] - now[j]);
        multibody.apply_displacements(&shift);
        multibody.generalized_velocity_mut().fill(0.0);
        multibody.forward_kinematics(bodies, true);
        multibody.update_rigid_bodies(bodies, true);
    }

    /// Sets each joint's damping, N m s/rad.
    pub(super) fn set_damping(&mut self, damping: &[f64; MAX_JOINTS]) {
        if let Some((multibody, _)) = self.engine.multibody_joints.get_mut(self.tip) {
            for (slot, value) in multibody.damping_mut().iter_mut().zip(damping) {
                *slot = *value;
            }
        }
    }

    /// Sets the oil column of joint `joint`.
    pub(super) fn set_column(&mut self, joint: usize, column: &Column) {
        let multibody = self.engine.multibody_joints.get_mut(self.tip);
        if let Some(link) = multibody.and_then(|(m, _)| m.link_mut(joint + 1)) {
            link.joint.set_spring(ROTATION_X, column.stiffness_n_m_rad, column.rest_rad);
        }
    }

    fn multibody(&self) -> Option<&Multibody> {
        self.engine.multibody_joints.get(self.tip).map(|(multibody, _)| multibody)
    }

    /// True joint angles, rad.
    pub(super) fn angles(&self) -> JointAngles {
        JointAngles::from_fn(self.loads.len(), |j| {
            let link = self.multibody().and_then(|multibody| multibody.link(j + 1));
            link.map_or(f64::NAN, |link| link.joint.coords()[ROTATION_X])
        })
    }

    /// True joint rates, rad/s.
    pub(super) fn rates(&self) -> JointAngles {
        let n = self.loads.len();
        match self.multibody() {
            Some(multibody) => {
                let rates = multibody.generalized_velocity();
                // A root not yet collapsed has six coordinates before the joints'.
                JointAngles::from_fn(n, |j| rates[rates.len() - n + j])
            }
            None => JointAngles::from_fn(n, |_| f64::NAN),
        }
    }

    /// `base_from_link` of body `body`, as the engine has it.
    pub(super) fn link(&self, body: usize) -> Isometry3<f64> {
        isometry(self.engine.bodies[self.links[body]].position())
    }

    /// Poses of all links, base frame.
    pub(super) fn poses(&self) -> BodyPoses {
        BodyPoses::from_fn(self.loads.len(), |body| self.link(body))
    }

    /// One step under the loads of `base`.
    pub(super) fn step(&mut self, base: &BaseState) {
        self.apply_loads(base);
        if let Some(ground) = self.engine.bodies.get_mut(self.ground) {
            let base_from_world = parry_pose(base.world_from_base.inverse().isometry());
            if !self.is_ground_placed {
                // Driven there from the origin it would fly through the arm.
                ground.set_position(base_from_world, false);
                self.is_ground_placed = true;
            }
            ground.set_next_kinematic_position(base_from_world);
        }
        self.guard_contacts();
        self.engine.step_with_events(&self.filter, &());
    }

    /// Lets the engine look for contacts only while there can be any.
    fn guard_contacts(&mut self) {
        let Some(mut guard) = self.guard.take() else { return };
        let ground = isometry(self.engine.bodies[self.ground].position());
        let needed = guard.contact_is_possible(&self.angles(), || self.poses(), &ground);
        self.guard = Some(guard);
        if needed != self.is_colliding {
            self.is_colliding = needed;
            for &handle in &self.colliders {
                if let Some(collider) = self.engine.colliders.get_mut(handle) {
                    collider.set_enabled(needed);
                }
            }
        }
    }

    fn apply_loads(&mut self, base: &BaseState) {
        for (loads, &handle) in self.loads.iter().zip(&self.links[1..]) {
            let Some(body) = self.engine.bodies.get_mut(handle) else { continue };
            let motion = LinkMotion {
                base_from_link: isometry(body.position()),
                com_velocity: from_rapier(body.linvel()),
                angular_velocity: from_rapier(body.angvel()),
            };
            let wrench = loads.wrench(base, &motion);
            // Added forces stay until they are reset.
            body.reset_forces(false);
            body.reset_torques(false);
            body.add_force(to_rapier(&wrench.force), false);
            body.add_torque(to_rapier(&wrench.torque), false);
        }
    }

    /// Torque of gravity and buoyancy about each joint at `angles`, N m.
    pub(super) fn static_torques(&self, chain: &Chain, base: &BaseState, angles: &JointAngles) -> JointAngles {
        let poses = chain.link_poses(angles);
        JointAngles::from_fn(chain.n_joints(), |j| {
            let mut torque = Vector3::zeros();
            for (i, loads) in self.loads.iter().enumerate().skip(j) {
                let wrench = loads.static_wrench(base, poses.link(i + 1));
                let lever = loads.com(poses.link(i + 1)) - poses.joint_origin(j);
                torque += lever.cross(&wrench.force) + wrench.torque;
            }
            poses.axis(j).dot(&torque)
        })
    }

    /// Calls `touch` with the two parts of every pair that touches now.
    pub(super) fn for_each_contact(&self, mut touch: impl FnMut(usize, usize)) {
        for pair in self.engine.narrow_phase.contact_pairs() {
            let deepest = pair.manifolds().iter().flat_map(|m| &m.points).map(|p| p.dist).fold(f64::INFINITY, f64::min);
            if deepest <= 0.0 {
                let part = |handle| self.engine.colliders.get(handle).map(|c| c.user_data as usize);
                if let (Some(a), Some(b)) = (part(pair.collider1), part(pair.collider2)) {
                    touch(a, b);
                }
            }
        }
    }
}

fn empty_engine(step_s: f64) -> PhysicsWorld {
    let mut engine = PhysicsWorld::new();
    // Gravity is among the loads.
    engine.gravity = Vector::ZERO;
    let parameters = &mut engine.integration_parameters;
    parameters.dt = step_s;
    // Springs and damping are implicit and outside of the iterative solver: it only has contacts to resolve.
    parameters.num_solver_iterations = 1;
    parameters.num_internal_pgs_iterations = 4;
    // Nothing moves its own size in a step.
    parameters.max_ccd_substeps = 0;
    engine
}

fn isometry(pose: &rapier3d::math::Pose) -> Isometry3<f64> {
    let q = pose.rotation;
    let rotation = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z));
    Isometry3::from_parts(from_rapier(pose.translation).into(), rotation)
}

fn link_body(body: &LinkBody) -> RigidBodyBuilder {
    let i = &body.inertia_kg_m2;
    let column = |k: usize| Vector::new(i[(0, k)], i[(1, k)], i[(2, k)]);
    let inertia = Matrix::from_cols(column(0), column(1), column(2));
    let mass = MassProperties::with_inertia_matrix(to_rapier(&body.com_m), body.mass_kg, inertia);
    RigidBodyBuilder::dynamic()
        .additional_mass_properties(mass)
        .angular_damping(0.0)
        .linear_damping(0.0)
        .can_sleep(false)
}

/// The engine turns joints about their frame's x axis: both frames have it along `axis`.
fn revolute(parent_from_joint: &Isometry3<f64>, axis: &Unit<Vector3<f64>>) -> GenericJoint {
    let turn = UnitQuaternion::rotation_between_axis(&Vector3::x_axis(), axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI));
    let turn = Isometry3::from_parts(nalgebra::Translation3::identity(), turn);
    let mut joint = GenericJoint::new(JointAxesMask::LOCKED_REVOLUTE_AXES);
    joint.set_local_frame1(parry_pose(&(parent_from_joint * turn)));
    joint.set_local_frame2(parry_pose(&turn));
    joint.set_contacts_enabled(false);
    joint
}

fn add_colliders(
    engine: &mut PhysicsWorld,
    solids: &Solids,
    links: &[RigidBodyHandle],
    ground: RigidBodyHandle,
) -> Vec<ColliderHandle> {
    let mut handles = Vec::new();
    for solid in solids.shapes() {
        let parent = match solid.carrier {
            Carrier::Body(body) => links[body],
            Carrier::World => ground,
        };
        // No density: the link has its mass already.
        let collider = ColliderBuilder::new(solid.shape.clone())
            .position(solid.carrier_from_shape)
            .density(0.0)
            .active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS)
            .user_data(solid.part as u128);
        handles.push(engine.colliders.insert_with_parent(collider, parent, &mut engine.bodies));
    }
    handles
}

#[cfg(test)]
mod tests;

//! Contacts from the engine's collision pipeline, with forces by a spring and a damper.
//!
//! The engine finds manifolds (broad phase, narrow phase, persistent points); the arm's own equations take the forces
//! implicitly. Friction is viscous below a small slip rate and Coulomb's above.

use nalgebra::{Isometry3, Vector3};
use rapier3d::geometry::{ActiveCollisionTypes, ColliderBuilder, ColliderHandle};
use rapier3d::pipeline::{ActiveHooks, PhysicsWorld};

use crate::body_poses::BodyPoses;
use crate::convert::from_rapier;
use crate::dynamics::{ContactRow, Coordinates, Force, MAX_DOF, Motion};
use crate::pair_motion::ArmPlace;
use crate::physics::contact_guard::ContactGuard;
use crate::physics::pair_filter::PairFilter;
use crate::solids::{Carrier, Solid, Solids};
use crate::spec::PhysicsSpec;
use armcal_core::kinematics::{Chain, LinkPoses};
use armcal_core::robot::parry_pose;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Slip rate below which friction is viscous, m/s.
const SLIP_M_S: f64 = 1e-3;

/// Shapes in the engine, and the pairs that touch.
pub(super) struct ContactWorld {
    engine: PhysicsWorld,
    filter: PairFilter,
    colliders: Vec<(ColliderHandle, Carrier)>,
    guard: ContactGuard,
    is_colliding: bool,
    spec: PhysicsSpec,
    rows: Vec<ContactRow>,
    touching: Vec<(usize, usize)>,
}

/// State that contact forces depend on.
pub(super) struct ContactState<'a> {
    pub poses: &'a LinkPoses,
    pub angles: &'a JointAngles,
    /// Velocities of all coordinates, those of a free base first.
    pub velocity: Coordinates,
    pub first_joint: usize,
    /// Velocity of the base against the ground; if the base's motion is prescribed, it is not part of `velocity`.
    pub base_velocity: Motion,
    pub base_from_ground: Isometry3<f64>,
    /// Pose of the first joint on the base.
    pub first_place: Isometry3<f64>,
}

impl ContactWorld {
    pub(super) fn new(chain: &Chain, solids: &Solids, spec: &PhysicsSpec, angles: &JointAngles) -> Self {
        let mut engine = PhysicsWorld::new();
        let colliders = solids
            .shapes()
            .iter()
            .map(|solid| {
                let collider = ColliderBuilder::new(solid.shape.clone())
                    .position(solid.carrier_from_shape)
                    .active_collision_types(ActiveCollisionTypes::all())
                    .active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS)
                    .user_data(solid.part as u128);
                (engine.colliders.insert(collider), solid.carrier)
            })
            .collect();
        let start =
            ArmPlace { angles: *angles, base_from_ground: Isometry3::identity(), first_place: chain.first_place() };
        Self {
            engine,
            filter: PairFilter::new(solids),
            colliders,
            guard: ContactGuard::new(chain, solids, &start),
            is_colliding: true,
            spec: *spec,
            rows: Vec::with_capacity(64),
            touching: Vec::with_capacity(64),
        }
    }

    /// Returns the springs and dampers of all present contacts.
    pub(super) fn update(&mut self, solids: &[Solid], state: &ContactState) -> &[ContactRow] {
        self.rows.clear();
        self.touching.clear();
        let n = state.angles.len();
        let links = || BodyPoses::drawn(n, state.poses);
        let place = ArmPlace {
            angles: *state.angles,
            base_from_ground: state.base_from_ground,
            first_place: state.first_place,
        };
        let needed = self.guard.contact_is_possible(&place, links);
        if needed != self.is_colliding {
            self.is_colliding = needed;
            for (handle, _) in &self.colliders {
                if let Some(collider) = self.engine.colliders.get_mut(*handle) {
                    collider.set_enabled(needed);
                }
            }
        }
        if needed {
            self.place(solids, state);
            self.engine.detect_collisions(&self.filter, &());
            self.collect(state);
        }
        &self.rows
    }

    fn place(&mut self, solids: &[Solid], state: &ContactState) {
        for ((handle, carrier), solid) in self.colliders.iter().zip(solids) {
            let Some(collider) = self.engine.colliders.get_mut(*handle) else { continue };
            let place = match carrier {
                Carrier::Body(body) => parry_pose(state.poses.link(*body)),
                Carrier::World => parry_pose(&state.base_from_ground),
            };
            collider.set_position(place * solid.carrier_from_shape);
        }
    }

    fn collect(&mut self, state: &ContactState) {
        let Self { engine, rows, touching, colliders, spec, .. } = self;
        for pair in engine.narrow_phase.contact_pairs() {
            let find = |handle| colliders.iter().find(|(known, _)| *known == handle).map(|(_, carrier)| *carrier);
            let (Some(a), Some(b)) = (engine.colliders.get(pair.collider1), engine.colliders.get(pair.collider2))
            else {
                continue;
            };
            let (Some(on_a), Some(on_b)) = (find(pair.collider1), find(pair.collider2)) else { continue };
            let deep = || {
                pair.manifolds().iter().flat_map(|m| m.points.iter().map(move |p| (m, p))).filter(|(_, p)| p.dist < 0.0)
            };
            let n_points = deep().count();
            if n_points == 0 {
                continue;
            }
            touching.push((a.user_data as usize, b.user_data as usize));
            for (manifold, point) in deep() {
                let place = manifold.subshape_pos1().map_or(*a.position(), |sub| *a.position() * *sub);
                let contact = Contact {
                    point: from_rapier(place.transform_point(point.local_p1)),
                    // The normal points from the first shape to the second, which it pushes away.
                    normal: from_rapier(manifold.data.normal),
                    depth_m: -point.dist,
                    pushed: body(on_b),
                    against: body(on_a),
                    share: 1.0 / n_points as f64,
                };
                contact.add_rows(spec, state, rows);
            }
        }
    }

    /// Calls `touch` with the two parts of every pair that touched in the last step.
    pub(super) fn for_each(&self, mut touch: impl FnMut(usize, usize)) {
        for &(a, b) in &self.touching {
            touch(a, b);
        }
    }
}

/// Returns the body that carries a shape; `None` for the ground.
fn body(carrier: Carrier) -> Option<usize> {
    match carrier {
        Carrier::Body(body) => Some(body),
        Carrier::World => None,
    }
}

struct Contact {
    /// Point of contact, base frame.
    point: Vector3<f64>,
    normal: Vector3<f64>,
    depth_m: f64,
    pushed: Option<usize>,
    against: Option<usize>,
    /// Share of the pair's stiffness.
    share: f64,
}

impl Contact {
    fn add_rows(&self, spec: &PhysicsSpec, state: &ContactState, rows: &mut Vec<ContactRow>) {
        let stiffness_n_m = spec.contact_stiffness_n_m * self.share;
        let damping_n_s_m = spec.contact_damping_s * stiffness_n_m;
        let (direction, ground_rate) = self.direction(&self.normal, state);
        let parting: f64 = (0..MAX_DOF).map(|i| direction[i] * state.velocity[i]).sum::<f64>() + ground_rate;
        // Bodies that separate faster than the spring relaxes are not pulled back.
        let damping_n_s_m =
            if stiffness_n_m * self.depth_m - damping_n_s_m * parting > 0.0 { damping_n_s_m } else { 0.0 };
        let start_n = stiffness_n_m * self.depth_m - damping_n_s_m * ground_rate;
        rows.push(ContactRow { direction, start_n, stiffness_n_m, damping_n_s_m });
        let normal_n = (stiffness_n_m * self.depth_m - damping_n_s_m * parting).max(0.0);
        let side = self.normal.cross(&if self.normal.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() }).normalize();
        for tangent in [side, self.normal.cross(&side)] {
            let (direction, ground_rate) = self.direction(&tangent, state);
            let slip = (0..MAX_DOF).map(|i| direction[i] * state.velocity[i]).sum::<f64>() + ground_rate;
            let damping_n_s_m = spec.contact_friction * normal_n / slip.abs().max(SLIP_M_S);
            let start_n = -damping_n_s_m * ground_rate;
            rows.push(ContactRow { direction, start_n, stiffness_n_m: 0.0, damping_n_s_m });
        }
    }

    /// Returns how each coordinate moves the pushed body's point along `axis` against the other's. The second result is
    /// the rate that the ground, or a base with prescribed motion, adds.
    fn direction(&self, axis: &Vector3<f64>, state: &ContactState) -> (Coordinates, f64) {
        let unit = Force::at(&self.point, axis);
        let mut direction = [0.0; MAX_DOF];
        for (carrier, sign) in [(self.pushed, 1.0), (self.against, -1.0)] {
            let Some(body) = carrier else { continue };
            for joint in 0..body.min(MAX_JOINTS) {
                let turning = Motion::rotation(state.poses.axis(joint), &state.poses.joint_origin(joint));
                direction[state.first_joint + joint] += sign * turning.dot(&unit);
            }
            if state.first_joint > 0 {
                for (slot, value) in direction.iter_mut().zip(unit.to_array()) {
                    *slot += sign * value;
                }
            }
        }
        // A contact of two bodies of the vehicle moves with it; one with the ground does not.
        let moves = f64::from(u8::from(self.pushed.is_some())) - f64::from(u8::from(self.against.is_some()));
        let carried = if state.first_joint == 0 { moves * state.base_velocity.dot(&unit) } else { 0.0 };
        (direction, carried)
    }
}

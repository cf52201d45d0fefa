//! Free water between the arm and everything else, for one arm or for every arm within the joint errors.
//!
//! Moving shapes are the links' collision primitives; standing ones the vehicle's parts (fixed in the base frame),
//! obstacles and the seafloor (fixed in the world; the vehicle's motion about its station is added to the margin).
//! Links closer than two joints apart cannot be told from a joint and are not tested against each other.

use nalgebra::{Isometry3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::math::{Pose3, Vec3};
use parry3d::query;
use parry3d::shape::{HalfSpace, SharedShape};

use super::bounds::JointErrorBounds;
use crate::kinematics::LinkPoses;
use crate::robot::{MAX_COLLISION_SHAPES, PlacedShape, Robot, Vehicle, parry_pose};
use crate::routine::Scene;
use crate::streams::{JointAngles, MAX_JOINTS};

/// The closest pair and their distance.
#[derive(Clone, Debug, PartialEq)]
pub struct Nearest {
    /// Zero: touching or inside each other.
    pub distance_m: f64,
    pub first: String,
    pub second: String,
}

impl std::fmt::Display for Nearest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "`{}` and `{}`", self.first, self.second)
    }
}

struct Moving {
    body: usize,
    name: String,
    shape: SharedShape,
    body_from_shape: Isometry3<f64>,
    radius_m: f64,
    /// Of the box around the shape in its own axes.
    half_extents_m: Vector3<f64>,
}

struct Standing {
    name: String,
    shape: SharedShape,
    pose: Pose3,
    bounds: Aabb,
    center_m: Vector3<f64>,
    /// Infinite for the seafloor.
    radius_m: f64,
    /// What the vehicle's motion may take from the distance; zero for its own parts.
    motion_m: f64,
}

/// The arm, what is around it, and which pairs may touch.
pub struct ClearanceModel<'a> {
    robot: &'a Robot,
    moving: Vec<Moving>,
    standing: Vec<Standing>,
    /// Joints whose error moves a collision shape in a way that matters.
    n_error_joints: usize,
    levers_m: [f64; MAX_JOINTS],
}

/// Distances beyond this are all the same to planning, m.
const FAR_M: f64 = 0.4;
/// Free water in which a lower bound serves as well as the true distance, m.
const AMPLE_M: f64 = 0.15;
/// Bodies nearer along the chain than this share a joint or a short link and always nearly touch.
const MIN_BODY_GAP: usize = 2;
/// Larger than any site, m.
const EVERYWHERE_M: f64 = 1e6;
/// Links of one arm neither sway against each other nor are surveyed: they need less water than the vehicle does.
const SELF_EASE_M: f64 = 0.03;
/// The vehicle sways about its station: three times 3 cm, and 0.5 deg three times over at 2 m.
const VEHICLE_MOTION_M: f64 = 0.15;

impl<'a> ClearanceModel<'a> {
    #[must_use]
    pub fn new(robot: &'a Robot, vehicle: &Vehicle, scene: &Scene) -> Self {
        let mut moving = Vec::new();
        for (body, link) in robot.bodies.iter().enumerate() {
            for placed in &link.collisions {
                let shape = placed.shape.to_parry();
                let half = shape.compute_local_aabb().half_extents();
                moving.push(Moving {
                    body,
                    name: link.name.clone(),
                    shape,
                    half_extents_m: Vector3::new(half.x, half.y, half.z),
                    body_from_shape: placed.owner_from_shape * placed.shape.axis_fix(),
                    radius_m: placed.shape.bounding_radius_m(),
                });
            }
        }
        let base_from_vehicle = *vehicle.vehicle_from_base.inverse().isometry();
        let mut standing: Vec<Standing> =
            vehicle.parts.iter().map(|part| Standing::new(&part.name, &part.placed, &base_from_vehicle, 0.0)).collect();
        // The vehicle's mean pose is the world's origin, so world = vehicle here; its motion is in the margin.
        for obstacle in &scene.obstacles {
            standing.push(Standing::new(&obstacle.name, &obstacle.placed, &base_from_vehicle, VEHICLE_MOTION_M));
        }
        if let Some(z_m) = scene.seafloor_z_m {
            standing.push(Standing::seafloor(z_m, &base_from_vehicle));
        }
        // The last joint turns a nearly round gripper about its own axis: its error moves no outline.
        let n_error_joints = robot.chain.joints().iter().filter(|joint| joint.limits.is_some()).count();
        let levers_m = levers(robot, &moving);
        Self { robot, moving, standing, n_error_joints, levers_m }
    }

    /// The closest pair for one arm exactly at `angles`; distances are cut off at 0.4 m.
    #[must_use]
    pub fn nearest(&self, angles: &JointAngles) -> Nearest {
        let poses = self.robot.chain.link_poses(angles);
        self.nearest_below(&poses, FAR_M)
    }

    /// The closest pair over every arm within `bounds` whose sensors read `believed`: the corners of the error box.
    ///
    /// Stops early at the first arm nearer than `enough_m`, for then the answer is no.
    #[must_use]
    pub fn nearest_under(&self, believed: &JointAngles, bounds: &JointErrorBounds, enough_m: f64) -> Nearest {
        let mut worst = self.nearest(believed);
        // What the error can move the arm by at most; where the free water exceeds it by far, no corner needs a look.
        let error_m = self.motion_bound_m(|joint| {
            if joint < self.n_error_joints { bounds.error_rad(joint, believed[joint]) } else { 0.0 }
        });
        if worst.distance_m - error_m >= AMPLE_M.max(enough_m) {
            worst.distance_m -= error_m;
            return worst;
        }
        for corner in 0..1usize << self.n_error_joints {
            if worst.distance_m < enough_m {
                break;
            }
            let poses = self.robot.chain.link_poses(&bounds.corner(believed, self.n_error_joints, corner));
            let nearest = self.nearest_below(&poses, worst.distance_m);
            if nearest.distance_m < worst.distance_m {
                worst = nearest;
            }
        }
        worst
    }

    /// Upper bound on how far any point of the arm moves when the joints move by `delta_rad`, m (Schwarzer et al.).
    #[must_use]
    pub fn motion_bound_m(&self, delta_rad: impl Fn(usize) -> f64) -> f64 {
        (0..self.robot.n_joints()).map(|joint| self.levers_m[joint] * delta_rad(joint).abs()).sum()
    }

    fn nearest_below(&self, poses: &LinkPoses, limit_m: f64) -> Nearest {
        let mut best = Nearest { distance_m: limit_m, first: String::new(), second: String::new() };
        let mut pair = None;
        let placed = self.placed(poses);
        for (i, (moving, at)) in self.moving.iter().zip(&placed).enumerate() {
            // What is fixed to the base stands where it is bolted on.
            let standing: &[Standing] = if moving.body > 0 { &self.standing } else { &[] };
            for (k, standing) in standing.iter().enumerate() {
                if gap_m(&at.bounds, &standing.bounds) - standing.motion_m >= best.distance_m {
                    continue;
                }
                let distance = distance_m(&at.pose, &moving.shape, &standing.pose, &standing.shape) - standing.motion_m;
                if distance < best.distance_m {
                    best.distance_m = distance;
                    pair = Some((i, Err(k)));
                }
            }
            for (j, (other, other_at)) in self.moving.iter().zip(&placed).enumerate().skip(i + 1) {
                let near = other.body.abs_diff(moving.body) < MIN_BODY_GAP;
                if near || gap_m(&at.bounds, &other_at.bounds) + SELF_EASE_M >= best.distance_m {
                    continue;
                }
                let distance = eased(distance_m(&at.pose, &moving.shape, &other_at.pose, &other.shape));
                if distance < best.distance_m {
                    best.distance_m = distance;
                    pair = Some((i, Ok(j)));
                }
            }
        }
        // An obstacle inside the margin for the vehicle's motion is as near as touching.
        best.distance_m = best.distance_m.max(0.0);
        if let Some((i, other)) = pair {
            best.first.clone_from(&self.moving[i].name);
            best.second.clone_from(match other {
                Ok(j) => &self.moving[j].name,
                Err(k) => &self.standing[k].name,
            });
        }
        best
    }

    fn placed(&self, poses: &LinkPoses) -> [Placed; MAX_COLLISION_SHAPES] {
        let mut placed = [Placed { pose: Pose3::IDENTITY, bounds: Aabb::new_invalid() }; MAX_COLLISION_SHAPES];
        for (slot, moving) in placed.iter_mut().zip(&self.moving) {
            let isometry = poses.link(moving.body) * moving.body_from_shape;
            *slot = Placed { pose: parry_pose(&isometry), bounds: moving.bounds(&isometry) };
        }
        placed
    }

    /// Whether something stands on the line between two points of the base frame; `skip_m` is left out at its far end.
    #[must_use]
    pub fn blocks_sight(&self, poses: &LinkPoses, from_m: &Vector3<f64>, to_m: &Vector3<f64>, skip_m: f64) -> bool {
        let sight = to_m - from_m;
        let length = sight.norm();
        let direction = sight / length.max(1e-9);
        // The camera's own housing surrounds the start of the ray.
        let near_m = 0.08;
        let start = from_m + direction * near_m;
        let ray = query::Ray::new(vec3(&start), vec3(&direction));
        let reach = length - near_m - skip_m;
        if reach <= 0.0 {
            return false;
        }
        let hit = |pose: &Pose3, shape: &SharedShape| shape.cast_ray(pose, &ray, reach, true).is_some();
        let beside = |center: &Vector3<f64>, radius_m: f64| {
            let along = (center - start).dot(&direction).clamp(0.0, reach);
            (center - (start + direction * along)).norm() > radius_m
        };
        self.standing.iter().any(|s| !beside(&s.center_m, s.radius_m) && hit(&s.pose, &s.shape))
            || self.moving.iter().any(|m| {
                let isometry = poses.link(m.body) * m.body_from_shape;
                !beside(&isometry.translation.vector, m.radius_m) && hit(&parry_pose(&isometry), &m.shape)
            })
    }
}

impl Moving {
    /// The box along the base's axes around the turned box of the shape itself; a little large, and cheap.
    fn bounds(&self, base_from_shape: &Isometry3<f64>) -> Aabb {
        let turn = base_from_shape.rotation.to_rotation_matrix();
        let half = vec3(&(turn.matrix().abs() * self.half_extents_m));
        let center = vec3(&base_from_shape.translation.vector);
        Aabb::new(center - half, center + half)
    }
}

/// A moving shape at one configuration.
#[derive(Clone, Copy)]
struct Placed {
    pose: Pose3,
    bounds: Aabb,
}

/// Distance between two boxes along the axes, a lower bound on that of what they hold, m.
fn gap_m(a: &Aabb, b: &Aabb) -> f64 {
    let apart = (a.mins - b.maxs).max(b.mins - a.maxs).max(Vec3::ZERO);
    apart.length()
}

impl Standing {
    fn new(name: &str, placed: &PlacedShape, base_from_owner: &Isometry3<f64>, motion_m: f64) -> Self {
        let isometry = base_from_owner * placed.owner_from_shape * placed.shape.axis_fix();
        Self {
            name: name.to_owned(),
            shape: placed.shape.to_parry(),
            bounds: placed.shape.to_parry().compute_aabb(&parry_pose(&isometry)),
            pose: parry_pose(&isometry),
            center_m: isometry.translation.vector,
            radius_m: placed.shape.bounding_radius_m(),
            motion_m,
        }
    }

    fn seafloor(z_m: f64, base_from_world: &Isometry3<f64>) -> Self {
        let isometry = base_from_world * Isometry3::translation(0.0, 0.0, z_m);
        Self {
            name: "seafloor".to_owned(),
            shape: SharedShape::new(HalfSpace::new(Vec3::new(0.0, 0.0, 1.0))),
            // A tilted base tilts the half-space too, so no box leaves it out.
            bounds: Aabb::new(Vec3::splat(-EVERYWHERE_M), Vec3::splat(EVERYWHERE_M)),
            pose: parry_pose(&isometry),
            center_m: isometry.translation.vector,
            radius_m: f64::INFINITY,
            motion_m: VEHICLE_MOTION_M,
        }
    }
}

fn vec3(v: &Vector3<f64>) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

fn distance_m(pose1: &Pose3, shape1: &SharedShape, pose2: &Pose3, shape2: &SharedShape) -> f64 {
    // An unsupported pair of shapes cannot occur (convex primitives and a half-space); taking it as contact is safe.
    query::distance(pose1, shape1.as_ref(), pose2, shape2.as_ref()).map_or(0.0, |found| found.distance)
}

/// Distance between two links, raised by what they need less; links that touch stay at zero.
fn eased(distance_m: f64) -> f64 {
    if distance_m > 0.0 { distance_m + SELF_EASE_M } else { 0.0 }
}

/// For each joint, an upper bound on the distance from its axis to any point of the arm behind it, over all angles.
fn levers(robot: &Robot, moving: &[Moving]) -> [f64; MAX_JOINTS] {
    let mut levers = [0.0; MAX_JOINTS];
    for (joint, lever) in levers.iter_mut().enumerate().take(robot.n_joints()) {
        for shape in moving.iter().filter(|shape| shape.body > joint) {
            let links: f64 = robot.chain.joints()[joint + 1..shape.body]
                .iter()
                .map(|next| next.parent_from_joint.translation.vector.norm())
                .sum();
            let own = shape.body_from_shape.translation.vector.norm() + shape.radius_m;
            *lever = f64::max(*lever, links + own);
        }
    }
    levers
}

//! Free water between the arm and everything else, for one arm or for every arm within the joint errors.
//!
//! Moving shapes are the links' collision primitives; standing ones the vehicle's parts (fixed in the base frame),
//! obstacles and the seafloor (fixed in the world; the vehicle's motion about its station is added to the margin).
//! Links closer than two joints apart cannot be told from a joint and are not tested against each other.

use std::ops::Range;

use nalgebra::Vector3;
use parry3d::math::{Pose3, Vec3};
use parry3d::query;
use parry3d::shape::SharedShape;

use super::bounds::JointErrorBounds;
use super::certify::{Pair, Sweep};
use super::separation::{Placed, Shapes, gap_m, separate};
use super::shapes::{Moving, Standing, VEHICLE_MOTION_M, pairs, vec3};
use crate::kinematics::LinkPoses;
use crate::robot::{MAX_COLLISION_SHAPES, Robot, Vehicle, parry_pose};
use crate::routine::Scene;
use crate::streams::JointAngles;

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

/// The arm, what is around it, and which pairs may touch.
pub struct ClearanceModel<'a> {
    robot: &'a Robot,
    moving: Vec<Moving>,
    standing: Vec<Standing>,
    /// Joints whose error moves a collision shape in a way that matters.
    n_error_joints: usize,
    pairs: Vec<Pair>,
    /// By how much the gripper stands out beyond its shapes, m.
    gripper_growth_m: f64,
}

/// Distances beyond this are all the same to planning, m.
const FAR_M: f64 = 0.4;
/// Shapes that touch are never clear, whatever is asked for, m.
const TOUCHING_M: f64 = 1e-6;
/// Links of one arm neither sway against each other nor are surveyed: they need less water than the vehicle does.
const SELF_EASE_M: f64 = 0.03;

impl<'a> ClearanceModel<'a> {
    #[must_use]
    pub fn new(robot: &'a Robot, vehicle: &Vehicle, scene: &Scene) -> Self {
        let mut moving = Vec::new();
        for (body, link) in robot.bodies.iter().enumerate() {
            for placed in &link.collisions {
                moving.push(Moving::new(robot, body, &link.name, placed));
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
        let pairs = pairs(&moving, &standing);
        Self { robot, moving, standing, n_error_joints, pairs, gripper_growth_m: 0.0 }
    }

    /// The same with a gripper that stands out by `growth_m` more than its shapes: its jaws are open.
    #[must_use]
    pub fn with_grown_gripper(self, growth_m: f64) -> Self {
        Self { gripper_growth_m: growth_m, ..self }
    }

    /// The closest pair for one arm exactly at `angles`; distances are cut off at 0.4 m.
    #[must_use]
    pub fn nearest(&self, angles: &JointAngles) -> Nearest {
        let poses = self.robot.chain.link_poses(angles);
        self.nearest_below(&poses, FAR_M)
    }

    /// Whether one arm exactly at `angles` has anything nearer than `margin_m`.
    #[must_use]
    pub fn is_nearer_than(&self, angles: &JointAngles, margin_m: f64) -> bool {
        self.nearest_below(&self.link_poses(angles), margin_m).distance_m < margin_m
    }

    /// A pair that some arm within `bounds` whose sensors read `believed` brings, or may bring, nearer than `margin_m`;
    /// `None` proves that there is none.
    #[must_use]
    pub fn too_near(&self, believed: &JointAngles, bounds: &JointErrorBounds, margin_m: f64) -> Option<Nearest> {
        self.too_near_between(believed, believed, bounds, margin_m)
    }

    /// The same for every arm along the straight edge between two believed poses.
    #[must_use]
    pub fn too_near_between(
        &self,
        from: &JointAngles,
        to: &JointAngles,
        bounds: &JointErrorBounds,
        margin_m: f64,
    ) -> Option<Nearest> {
        Sweep { model: self, from: *from, to: *to, bounds, margin_m }.first_too_near()
    }

    /// The closest pair over every arm within `bounds` whose sensors read `believed`, as far as the answer matters: its
    /// distance is at least `enough_m` where all of them are proven to keep that, else it is that of one which does not.
    #[must_use]
    pub fn nearest_under(&self, believed: &JointAngles, bounds: &JointErrorBounds, enough_m: f64) -> Nearest {
        self.too_near(believed, bounds, enough_m).unwrap_or_else(|| {
            let nearest = self.nearest(believed);
            Nearest { distance_m: nearest.distance_m.max(enough_m), ..nearest }
        })
    }

    fn nearest_below(&self, poses: &LinkPoses, limit_m: f64) -> Nearest {
        let placed = self.placed(poses);
        let mut best_m = limit_m;
        let mut nearest = None;
        for &pair in &self.pairs {
            let at = [placed[pair.outer()], *self.other_placed(pair, &placed)];
            let enough_m = self.needed_m(pair, best_m);
            if gap_m(&at[0].bounds, &at[1].bounds) >= enough_m {
                continue;
            }
            let (shapes, guess) = (self.shapes(pair), at[0].bounds_direction(&at[1]));
            if guess != Vec3::ZERO && shapes.gap_along_m(&at, guess).is_some_and(|gap| gap >= enough_m) {
                continue;
            }
            let distance_m = self.in_margin_m(pair, separate(&shapes, &at, guess).distance_m);
            if distance_m < best_m {
                best_m = distance_m;
                nearest = Some(pair);
            }
        }
        let (first, second) = nearest.map_or_else(Default::default, |pair| self.names(pair));
        Nearest { distance_m: best_m, first, second }
    }

    pub(super) fn placed(&self, poses: &LinkPoses) -> [Placed; MAX_COLLISION_SHAPES] {
        let mut placed = [Placed::NOWHERE; MAX_COLLISION_SHAPES];
        for (slot, moving) in placed.iter_mut().zip(&self.moving) {
            *slot = moving.placed(poses);
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
        self.standing.iter().any(|s| !beside(&s.center_m, s.radius_m) && hit(&s.placed.pose, &s.shape))
            || self.moving.iter().any(|m| {
                let isometry = poses.link(m.body) * m.body_from_shape;
                !beside(&isometry.translation.vector, m.radius_m) && hit(&parry_pose(&isometry), &m.shape)
            })
    }
}

/// What the proof of clearance asks of the model.
impl ClearanceModel<'_> {
    pub(super) fn link_poses(&self, angles: &JointAngles) -> LinkPoses {
        self.robot.chain.link_poses(angles)
    }

    pub(super) fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    pub(super) fn n_error_joints(&self) -> usize {
        self.n_error_joints
    }

    /// Joints that move the pair's shapes against each other.
    pub(super) fn joints_between(&self, pair: Pair) -> Range<usize> {
        match pair {
            Pair::Standing { moving, .. } => 0..self.moving[moving].body,
            Pair::Links { outer, inner } => self.moving[inner].body..self.moving[outer].body,
        }
    }

    /// An upper bound on the distance of a moving shape from the axis of a joint before it, m.
    pub(super) fn lever_m(&self, shape: usize, joint: usize) -> f64 {
        self.moving[shape].levers_m[joint]
    }

    pub(super) fn shapes(&self, pair: Pair) -> Shapes<'_> {
        match pair {
            Pair::Standing { moving, standing } => {
                Shapes { outer: &self.moving[moving].shape, other: &self.standing[standing].shape }
            }
            Pair::Links { outer, inner } => {
                Shapes { outer: &self.moving[outer].shape, other: &self.moving[inner].shape }
            }
        }
    }

    /// The pair's second shape where it is.
    pub(super) fn other_placed<'b>(&'b self, pair: Pair, placed: &'b [Placed]) -> &'b Placed {
        match pair {
            Pair::Standing { standing, .. } => &self.standing[standing].placed,
            Pair::Links { inner, .. } => &placed[inner],
        }
    }

    pub(super) fn placed_pair(&self, pair: Pair, poses: &LinkPoses) -> [Placed; 2] {
        match pair {
            Pair::Standing { moving, standing } => [self.moving[moving].placed(poses), self.standing[standing].placed],
            Pair::Links { outer, inner } => [self.moving[outer].placed(poses), self.moving[inner].placed(poses)],
        }
    }

    /// The true distance at which a pair keeps `margin_m`.
    pub(super) fn needed_m(&self, pair: Pair, margin_m: f64) -> f64 {
        let needed_m = match pair {
            Pair::Standing { standing, .. } => margin_m + self.standing[standing].motion_m,
            Pair::Links { .. } => margin_m - SELF_EASE_M,
        };
        needed_m.max(TOUCHING_M) + self.growth_m(pair)
    }

    /// What open jaws take from the distance of a pair.
    fn growth_m(&self, pair: Pair) -> f64 {
        let is_gripper = |moving: usize| self.moving[moving].body == self.robot.tool.mount.n_joints;
        let grows = match pair {
            Pair::Standing { moving, .. } => is_gripper(moving),
            Pair::Links { outer, inner } => is_gripper(outer) || is_gripper(inner),
        };
        if grows { self.gripper_growth_m } else { 0.0 }
    }

    /// A true distance in the terms of the margin; shapes that touch stay at zero.
    pub(super) fn in_margin_m(&self, pair: Pair, distance_m: f64) -> f64 {
        let distance_m = (distance_m - self.growth_m(pair)).max(0.0);
        match pair {
            // An obstacle inside the margin for the vehicle's motion is as near as touching.
            Pair::Standing { standing, .. } => (distance_m - self.standing[standing].motion_m).max(0.0),
            Pair::Links { .. } if distance_m > 0.0 => distance_m + SELF_EASE_M,
            Pair::Links { .. } => 0.0,
        }
    }

    fn names(&self, pair: Pair) -> (String, String) {
        match pair {
            Pair::Standing { moving, standing } => {
                (self.moving[moving].name.clone(), self.standing[standing].name.clone())
            }
            Pair::Links { outer, inner } => (self.moving[inner].name.clone(), self.moving[outer].name.clone()),
        }
    }

    /// The pair at a true distance.
    pub(super) fn named(&self, pair: Pair, distance_m: f64) -> Nearest {
        let (first, second) = self.names(pair);
        Nearest { distance_m: self.in_margin_m(pair, distance_m), first, second }
    }
}

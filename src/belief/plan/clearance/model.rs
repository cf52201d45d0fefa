//! Clearance between the arm and its environment, for one arm or for every arm within the joint errors.
//!
//! Moving shapes are the links' collision primitives. Static shapes are the vehicle's parts (fixed in the base frame),
//! obstacles and the seafloor (fixed in the world). The bound on the vehicle's station-keeping motion is added to the
//! margin. Links closer than two joints apart always nearly touch and are not tested against each other.

pub use crate::plan::constants::clearance_model::SELF_MARGIN_REDUCTION_M;
pub(crate) use crate::plan::constants::clearance_model::TOUCHING_M;
use crate::plan::constants::clearance_model::{FAR_M, ROUND_TOOL_M, SWAY_SIGMAS};
use nalgebra::Vector3;
use parry3d::math::{Pose3, Vec3};
use parry3d::shape::SharedShape;

use crate::plan::clearance::pair::Pair;
use crate::plan::clearance::separation::{Placed, gap_m, separate};
use crate::plan::clearance::shapes::{LinkShape, StaticShape, pairs, vec3};
use crate::plan::motion::timing::Timing;
use armcal_core::kinematics::{Chain, LinkPoses};
use armcal_core::robot::{MAX_COLLISION_SHAPES, PlacedShape, Robot, StationKeeping, Vehicle, parry_pose};
use armcal_core::routine::Scene;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// The closest pair and their distance.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosestPair {
    /// Distance as the margin counts it, m: that of two links plus `reduction_m`. Zero: touching or inside each other.
    pub distance_m: f64,
    /// Reduction of the margin for this pair, m; zero except for two links of the arm.
    pub reduction_m: f64,
    /// Name of the proximal link, or of the link if `second` is no link; empty if nothing is near.
    pub first: String,
    /// Name of the other link, vehicle part, obstacle or seafloor; empty if nothing is near.
    pub second: String,
}

impl ClosestPair {
    /// Returns the true distance, m.
    #[must_use]
    pub fn true_distance_m(&self) -> f64 {
        (self.distance_m - self.reduction_m).max(0.0)
    }

    /// Returns the true distance that the pair needs under a margin, m.
    #[must_use]
    pub fn needed_m(&self, margin_m: f64) -> f64 {
        (margin_m - self.reduction_m).max(0.0)
    }
}

impl std::fmt::Display for ClosestPair {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "`{}` and `{}`", self.first, self.second)
    }
}

/// The arm, its environment, and the pairs that may touch.
pub struct ClearanceModel<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) moving: Vec<LinkShape>,
    pub(crate) standing: Vec<StaticShape>,
    /// True for each joint whose error moves an outline enough to count.
    pub(crate) has_error: [bool; MAX_JOINTS],
    pub(crate) pairs: Vec<Pair>,
    /// True for each pair of links that the robot's folder does not list as ever near each other.
    pub(crate) is_unlisted: Vec<bool>,
    /// Distance by which the gripper extends beyond its shapes, m.
    pub(crate) gripper_growth_m: f64,
    /// Largest displacement by sag, by the body whose proximal end bends, m ([`Chain::most_sag_m`]).
    pub(crate) sag_m: [f64; MAX_JOINTS + 1],
    pub(crate) sway: StationBound,
    pub(crate) timing: Timing,
}

/// Bound on the displacement of the vehicle and its arm by station keeping.
pub(crate) struct StationBound {
    /// Largest displacement of the vehicle's centre of mass, m.
    pub(crate) position_m: f64,
    /// Largest rotation, rad: the displacement per metre from the centre of mass.
    pub(crate) attitude_rad: f64,
    /// Centre of mass in the base frame.
    pub(crate) center_of_mass: Vec3,
}

impl StationBound {
    fn new(vehicle: &Vehicle) -> Self {
        let StationKeeping { position_std_m, attitude_std_rad } = vehicle.station_keeping;
        Self {
            position_m: SWAY_SIGMAS * position_std_m,
            attitude_rad: SWAY_SIGMAS * attitude_std_rad,
            // The origin of the vehicle's frame.
            center_of_mass: vec3(&vehicle.vehicle_from_base.inverse().isometry().translation.vector),
        }
    }
}

impl<'a> ClearanceModel<'a> {
    /// Returns the arm on its vehicle in the scene, with the jaws at rest.
    #[must_use]
    pub fn new(robot: &'a Robot, vehicle: &Vehicle, scene: &Scene) -> Self {
        let moving = moving(robot);
        let base_from_vehicle = *vehicle.vehicle_from_base.inverse().isometry();
        let mut standing: Vec<StaticShape> =
            vehicle.parts.iter().map(|part| StaticShape::new(&part.name, &part.placed, &base_from_vehicle)).collect();
        // The vehicle's mean pose is the world's origin, so world = vehicle here; the margin includes its motion.
        for obstacle in &scene.obstacles {
            standing.push(StaticShape::new(&obstacle.name, &obstacle.placed, &base_from_vehicle).of_world());
        }
        if let Some(z_m) = scene.seafloor_z_m {
            standing.push(StaticShape::seafloor(z_m, &base_from_vehicle));
        }
        Self::of(robot, moving, standing, StationBound::new(vehicle))
    }

    /// Returns the models for a touch of the vehicle part `part` by the tool's tip. The first has all other shapes; the
    /// second has only that part, and an arm without its tip.
    #[must_use]
    pub fn for_touch(robot: &'a Robot, vehicle: &Vehicle, scene: &Scene, part: &str) -> [Self; 2] {
        let all = Self::new(robot, vehicle, scene);
        let (touched, rest): (Vec<_>, Vec<_>) = all.standing.into_iter().partition(|standing| standing.name == part);
        let mut without_tip = moving(robot);
        if robot.tool.tip_radius_m.is_some()
            && let Some(tip) = without_tip.iter().rposition(|shape| shape.body == robot.tool.mount.n_joints)
        {
            // The last shape of its body.
            without_tip.remove(tip);
        }
        let of = |moving, standing| Self::of(robot, moving, standing, StationBound::new(vehicle));
        [of(moving(robot), rest), of(without_tip, touched)]
    }

    /// Returns the model of the arm without any environment.
    #[must_use]
    pub fn of_arm_alone(robot: &'a Robot) -> Self {
        let sway = StationBound { position_m: 0.0, attitude_rad: 0.0, center_of_mass: Vec3::ZERO };
        Self::of(robot, moving(robot), Vec::new(), sway)
    }

    fn of(robot: &'a Robot, moving: Vec<LinkShape>, standing: Vec<StaticShape>, sway: StationBound) -> Self {
        let has_error = std::array::from_fn(|joint| joint < robot.n_joints() && !turns_round_tool(robot, joint));
        let pairs = pairs(robot, &moving, &standing);
        let is_listed = |inner: usize, outer: usize| {
            robot.self_pairs.as_ref().is_none_or(|stored| stored.has(moving[inner].body, moving[outer].body))
        };
        let is_unlisted = |pair: &Pair| matches!(*pair, Pair::Links { outer, inner } if !is_listed(inner, outer));
        let is_unlisted = pairs.iter().map(is_unlisted).collect();
        let timing = Timing::new(robot);
        Self {
            robot,
            moving,
            standing,
            has_error,
            pairs,
            is_unlisted,
            gripper_growth_m: 0.0,
            sag_m: [0.0; MAX_JOINTS + 1],
            sway,
            timing,
        }
    }

    /// Adds `growth_m` to the extent of the gripper's shapes, because its jaws are open.
    #[must_use]
    pub fn with_grown_gripper(self, growth_m: f64) -> Self {
        Self { gripper_growth_m: growth_m, ..self }
    }

    /// Allows for the largest sag of `chain`; the shapes follow the straight arm.
    #[must_use]
    pub fn with_sag(self, chain: &Chain) -> Self {
        Self { sag_m: chain.most_sag_m(), ..self }
    }

    /// Opens the jaws as wide as they go.
    #[must_use]
    pub fn with_open_jaws(self) -> Self {
        let gripper = self.robot.gripper.as_ref();
        let growth_m = gripper.map_or(0.0, |gripper| gripper.outline_growth_m(gripper.opening_max_m));
        self.with_grown_gripper(growth_m)
    }

    /// Returns the closest pair for one arm exactly at `angles`; distances are cut off at 0.4 m.
    #[must_use]
    pub fn nearest(&self, angles: &JointAngles) -> ClosestPair {
        let poses = self.robot.chain.link_poses(angles);
        self.nearest_below(&poses, FAR_M)
    }

    /// Returns every two parts that overlap for one arm exactly at `angles`, and do not touch by design.
    #[must_use]
    pub fn overlaps(&self, angles: &JointAngles) -> Vec<ClosestPair> {
        let placed = self.placed(&self.link_poses(angles));
        let mut found: Vec<ClosestPair> = Vec::new();
        for &pair in &self.pairs {
            let at = [&placed[pair.outer()], self.other_at(pair, |inner| &placed[inner])];
            let near = gap_m(&at[0].bounds, &at[1].bounds) <= 0.0;
            if near && separate(&self.shapes(pair), at, at[0].rough_direction(at[1])).distance_m <= 0.0 {
                let named = self.named(pair, 0.0);
                if !found.contains(&named) {
                    found.push(named);
                }
            }
        }
        found
    }

    /// Returns the name of a static shape or base-link shape that contains a point deeper than `depth_m`.
    #[must_use]
    pub(crate) fn holder(&self, point_m: &Vector3<f64>, depth_m: f64) -> Option<&str> {
        let point = vec3(point_m);
        let holds = |pose: &Pose3, shape: &SharedShape| {
            let near = shape.project_point(pose, point, false);
            near.is_inside && (near.point - point).length() > depth_m
        };
        let standing = self.standing.iter().find(|s| holds(&s.placed.pose, &s.shape)).map(|s| s.name.as_str());
        let base = |m: &&LinkShape| m.body == 0 && holds(&parry_pose(&m.body_from_shape), &m.shape);
        standing.or_else(|| self.moving.iter().find(base).map(|m| m.name.as_str()))
    }

    /// True if one arm exactly at `angles` has any pair nearer than `margin_m`.
    #[must_use]
    pub fn is_nearer_than(&self, angles: &JointAngles, margin_m: f64) -> bool {
        self.nearest_below(&self.link_poses(angles), margin_m).distance_m < margin_m
    }

    /// Calls `found` with the bodies (inner first) and the distance of any two links nearer than `near_m`.
    pub(crate) fn each_near_pair(&self, angles: &JointAngles, near_m: f64, mut found: impl FnMut([usize; 2], f64)) {
        let placed = self.placed(&self.link_poses(angles));
        for &pair in &self.pairs {
            let Pair::Links { outer, inner } = pair else { continue };
            let at = [&placed[outer], &placed[inner]];
            if gap_m(&at[0].bounds, &at[1].bounds) < near_m {
                let distance_m = separate(&self.shapes(pair), at, at[0].rough_direction(at[1])).distance_m;
                if distance_m < near_m {
                    found([self.moving[inner].body, self.moving[outer].body], distance_m);
                }
            }
        }
    }

    fn nearest_below(&self, poses: &LinkPoses, limit_m: f64) -> ClosestPair {
        let placed = self.placed(poses);
        let mut best_m = limit_m;
        let mut nearest = None;
        for (number, &pair) in self.pairs.iter().enumerate() {
            let (outer, other) = (&placed[pair.outer()], self.other_at(pair, |inner| &placed[inner]));
            let sway_m = if self.sways(pair) { self.station_bound_m(outer) } else { 0.0 };
            let enough_m = self.needed_m(pair, best_m) + sway_m;
            if self.never_within(number, enough_m) || gap_m(&outer.bounds, &other.bounds) >= enough_m {
                continue;
            }
            let (shapes, guess) = (self.shapes(pair), outer.rough_direction(other));
            if guess != Vec3::ZERO && shapes.gap_along_m(outer, other, guess) >= enough_m {
                continue;
            }
            let distance_m = self.in_margin_m(pair, separate(&shapes, [outer, other], guess).distance_m, sway_m);
            if distance_m < best_m {
                best_m = distance_m;
                nearest = Some(pair);
            }
        }
        match nearest {
            Some(pair) => self.named(pair, best_m),
            None => ClosestPair { distance_m: best_m, reduction_m: 0.0, first: String::new(), second: String::new() },
        }
    }

    fn placed(&self, poses: &LinkPoses) -> [Placed; MAX_COLLISION_SHAPES] {
        let mut placed = [Placed::NOWHERE; MAX_COLLISION_SHAPES];
        for (slot, moving) in placed.iter_mut().zip(&self.moving) {
            *slot = moving.placed(poses);
        }
        placed
    }
}

/// True if a joint has no stops and turns only a slender tool about its own axis: its error hardly moves an outline.
fn turns_round_tool(robot: &Robot, joint: usize) -> bool {
    let spec = &robot.chain.joints()[joint];
    let is_slender = |placed: &PlacedShape| {
        let bounds = placed.shape.to_parry().compute_local_aabb();
        let from_shape = placed.owner_from_shape * placed.shape.axis_fix();
        bounds.vertices().iter().all(|corner| {
            let at = from_shape * nalgebra::Point3::new(corner.x, corner.y, corner.z);
            spec.axis.cross(&at.coords).norm() <= ROUND_TOOL_M
        })
    };
    spec.limits.is_none() && joint + 1 == robot.n_joints() && robot.bodies[joint + 1].collisions.iter().all(is_slender)
}

fn moving(robot: &Robot) -> Vec<LinkShape> {
    let of_body = |(body, link): (usize, &'_ armcal_core::robot::LinkBody)| -> Vec<LinkShape> {
        link.collisions.iter().map(|placed| LinkShape::new(robot, body, &link.name, placed)).collect()
    };
    robot.bodies.iter().enumerate().flat_map(of_body).collect()
}

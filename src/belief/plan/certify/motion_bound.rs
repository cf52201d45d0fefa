//! The middle of a region of arms, and bounds on the shapes' motion within the region.

use parry3d::math::{Pose3, Vec3};

use crate::plan::clearance::ClearanceModel;
use crate::plan::clearance::pair::BodyPair;
use crate::plan::clearance::separation::Placed;
use crate::plan::clearance::shapes::vec3;
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::parry_pose;
use armcal_core::streams::MAX_JOINTS;

/// The middle of a region and its extent to either side.
pub(crate) struct ArmRegion {
    base_from_body: [Pose3; MAX_JOINTS + 1],
    axes: [Vec3; MAX_JOINTS],
    origins: [Vec3; MAX_JOINTS],
    error_half_rad: [f64; MAX_JOINTS],
    /// Half of the stretch, as an absolute value, plus half of the errors, rad.
    reach_rad: [f64; MAX_JOINTS],
    /// Sum of `reach_rad` over the joints before each body.
    reach_before_rad: [f64; MAX_JOINTS + 1],
    /// Motion of each body over half of the stretch, to first order: a point p moves by `push + turn x p`.
    turn: [Vec3; MAX_JOINTS + 1],
    push: [Vec3; MAX_JOINTS + 1],
    step_rad: [f64; MAX_JOINTS],
    /// True if the middle is itself an arm within the bounds.
    pub is_within: bool,
}

/// A moving shape at the middle of a region, and bounds on its motion within the region.
#[derive(Clone, Copy, Default)]
pub(crate) struct ShapeMotion {
    pub placed: Placed,
    /// Upper bound on the shape's distance from the axis of each joint that moves it over the region, m.
    levers_m: [f64; MAX_JOINTS],
    /// Sum of lever times reach over the joints from each joint on, m.
    coarse_m: [f64; MAX_JOINTS + 1],
    /// Sum of lever times reach, each term times half of its reach and the reach of all joints before, m.
    bent_m: [f64; MAX_JOINTS + 1],
    /// Largest displacement of any point of the shape from its middle position over the stretch alone, m.
    pub stretch_m: f64,
    /// Largest loss of distance to world-fixed shapes by the vehicle's motion, m: at the middle of the region, and
    /// anywhere in it (`most_sway_m`).
    pub station_bound_m: f64,
    pub most_sway_m: f64,
}

/// The direction in which a region is halved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Split {
    Along,
    Error(usize),
}

/// Largest displacement of one shape against another by the joints within a region.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MotionBound {
    pub total_m: f64,
    /// First-order part, m.
    pub first_m: f64,
}

/// First-order direction in which a region brings a pair nearer, and the joint with the largest share in it.
pub(crate) struct Trend {
    /// Distance by which half of the stretch moves the pair apart, m.
    pub along_m: f64,
    /// Distance by which half of each joint's errors moves the pair apart, m.
    pub error_m: [f64; MAX_JOINTS],
    pub split: Split,
}

impl ShapeMotion {
    /// Returns the largest displacement of any point of the shape by the joints from `first_joint` on, m (Schwarzer,
    /// Saha and Latombe).
    pub(crate) fn coarse_m(&self, first_joint: usize) -> f64 {
        self.coarse_m[first_joint]
    }
}

impl ArmRegion {
    /// `step_rad`: half of the stretch; `error_half_rad`: half of the errors' width.
    pub(crate) fn new(
        poses: &LinkPoses,
        n_joints: usize,
        step_rad: [f64; MAX_JOINTS],
        error_half_rad: [f64; MAX_JOINTS],
    ) -> Self {
        let mut region = Self {
            base_from_body: [Pose3::IDENTITY; MAX_JOINTS + 1],
            axes: [Vec3::ZERO; MAX_JOINTS],
            origins: [Vec3::ZERO; MAX_JOINTS],
            error_half_rad,
            reach_rad: [0.0; MAX_JOINTS],
            reach_before_rad: [0.0; MAX_JOINTS + 1],
            turn: [Vec3::ZERO; MAX_JOINTS + 1],
            push: [Vec3::ZERO; MAX_JOINTS + 1],
            step_rad,
            is_within: true,
        };
        for j in 0..n_joints {
            let (axis, origin) = (vec3(poses.axis(j)), vec3(&poses.joint_origin(j)));
            region.base_from_body[j + 1] = parry_pose(poses.link(j + 1));
            (region.axes[j], region.origins[j]) = (axis, origin);
            region.reach_rad[j] = step_rad[j].abs() + error_half_rad[j];
            region.reach_before_rad[j + 1] = region.reach_before_rad[j] + region.reach_rad[j];
            region.turn[j + 1] = region.turn[j] + step_rad[j] * axis;
            region.push[j + 1] = region.push[j] + step_rad[j] * origin.cross(axis);
        }
        region
    }

    /// Places a moving shape and bounds its motion.
    pub(crate) fn place(&self, model: &ClearanceModel<'_>, shape: usize, moved: &mut ShapeMotion) {
        let body = model.body(shape);
        moved.placed = model.placed_on(shape, &self.base_from_body[body]);
        let (mut beyond_m, mut bent_m, mut stretch_m) = (0.0, 0.0, 0.0);
        (moved.coarse_m[body], moved.bent_m[body]) = (0.0, 0.0);
        for joint in (0..body).rev() {
            let arm = moved.placed.center - self.origins[joint];
            let now_m = self.axes[joint].cross(arm).length() + moved.placed.radius_m;
            // Joints farther out turn the shape away from where it is now.
            let lever_m = f64::min(model.lever_m(shape, joint), now_m + beyond_m);
            let reach_rad = self.reach_rad[joint];
            moved.levers_m[joint] = lever_m;
            beyond_m += lever_m * reach_rad;
            stretch_m += lever_m * self.step_rad[joint].abs();
            bent_m += lever_m * reach_rad * (0.5 * reach_rad + self.reach_before_rad[joint]);
            moved.coarse_m[joint] = beyond_m;
            moved.bent_m[joint] = bent_m;
        }
        moved.stretch_m = stretch_m;
        moved.station_bound_m = model.station_bound_m(&moved.placed);
        moved.most_sway_m = moved.station_bound_m + model.sway_growth(beyond_m);
    }

    /// Returns the largest displacement of the outer shape against `direction` within the region.
    pub(crate) fn drift(&self, between: BodyPair, moved: &ShapeMotion, direction: Vec3) -> MotionBound {
        let BodyPair { first_joint, outer_body } = between;
        let coarse_m = moved.coarse_m[first_joint];
        // A zero direction has no first-order motion.
        if direction == Vec3::ZERO {
            return MotionBound { total_m: coarse_m, first_m: coarse_m };
        }
        let placed = &moved.placed;
        let turn = self.turn[outer_body] - self.turn[first_joint];
        let push = self.push[outer_body] - self.push[first_joint];
        let along_m = direction.dot(push + turn.cross(placed.center));
        let mut first_m = along_m.abs() + placed.extent_m(direction.cross(turn));
        for joint in first_joint..outer_body {
            let half_rad = self.error_half_rad[joint];
            if half_rad > 0.0 {
                // Along the direction a point p moves by `direction . (axis x (p - origin)) = turn . (p - origin)` a
                // radian.
                let turn = direction.cross(self.axes[joint]);
                let rate_m = turn.dot(placed.center - self.origins[joint]);
                first_m += half_rad * (rate_m.abs() + placed.extent_m(turn));
            }
        }
        // No second derivative of a point's place by joints i <= j is longer than its distance from axis j.
        let second_m = moved.bent_m[first_joint] - self.reach_before_rad[first_joint] * coarse_m;
        MotionBound { total_m: f64::min(coarse_m, first_m + second_m), first_m }
    }

    /// Returns the first-order motion of the pair within the region, and how to halve the region.
    pub(crate) fn trend(&self, between: BodyPair, moved: &ShapeMotion, direction: Vec3) -> Trend {
        let placed = &moved.placed;
        let mut trend = Trend { along_m: 0.0, error_m: [0.0; MAX_JOINTS], split: Split::Along };
        let joints = between.first_joint..between.outer_body;
        let reach_rad = self.reach_before_rad[between.outer_body] - self.reach_before_rad[between.first_joint];
        let (mut most_m, mut along_turn, mut bent_m) = (-1.0, Vec3::ZERO, 0.0);
        for joint in joints {
            let turn = direction.cross(self.axes[joint]);
            let rate_m = turn.dot(placed.center - self.origins[joint]);
            let (half_rad, lever_m) = (self.error_half_rad[joint], moved.levers_m[joint]);
            trend.error_m[joint] = half_rad * rate_m;
            trend.along_m += self.step_rad[joint] * rate_m;
            along_turn += self.step_rad[joint] * turn;
            bent_m += self.step_rad[joint].abs() * lever_m;
            let share_m = half_rad * (rate_m.abs() + placed.extent_m(turn) + lever_m * reach_rad);
            if half_rad > 0.0 && share_m > most_m {
                (trend.split, most_m) = (Split::Error(joint), share_m);
            }
        }
        if trend.along_m.abs() + placed.extent_m(along_turn) + bent_m * reach_rad > most_m {
            trend.split = Split::Along;
        }
        trend
    }
}

//! Inverse kinematics of the camera: its optical centre at a point, its optical axis along a direction. For a fixed
//! camera it is a tag that moves to a point, with its normal along a direction.
//!
//! Levenberg's damped least squares on five numbers: the origin's distance (m) and the axis's turn `a x a*` (rad). The
//! turn is weighted by the range, so that both count as displacements at the tag. The arm need not reach the goal: the
//! result is tested like any other pose.

use crate::plan::constants::view_planning_camera_ik::{BESIDE_RAD, DAMPING, MAX_STEP_RAD, RANGES_M, STEPS};
use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plan::visibility::VisibilityModel;
use armcal_core::kinematics::{Attachment, JointLimits};
use armcal_core::numeric::{LeastSquares, Proposal, StopRule, minimize};
use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Target position of a frame of the arm and target direction of its z axis, base frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraGoal {
    /// Frame of the camera, or of a tag that the arm carries.
    pub frame: Attachment,
    pub origin_m: Vector3<f64>,
    /// Target direction of the z axis, unit vector.
    pub axis: Vector3<f64>,
}

impl CameraGoal {
    /// Draws a goal at a useful range and incidence from a randomly chosen tag.
    pub(crate) fn draw(robot: &Robot, visibility: &VisibilityModel, rng: &mut ChaCha8Rng) -> Option<Self> {
        if robot.tags.is_empty() {
            return None;
        }
        let tag = &robot.tags[rng.random_range(0..robot.tags.len())];
        let highest_m = RANGES_M[1].min(visibility.max_range_m);
        let range_m = rng.random_range(RANGES_M[0].max(visibility.min_range_m).min(highest_m - 1e-3)..highest_m);
        // Uniform over the cone about the tag's normal.
        let cos = 1.0 - rng.random_range(0.0..1.0) * (1.0 - visibility.max_incidence_rad.cos());
        let sin = (1.0_f64 - cos * cos).max(0.0).sqrt();
        let around = rng.random_range(0.0..std::f64::consts::TAU);
        let from_tag = Vector3::new(sin * around.cos(), sin * around.sin(), cos);
        let beside = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)) * BESIDE_RAD;
        if robot.is_watched() {
            return Some(Self::of_carried_tag(robot, tag, range_m, &from_tag, &beside));
        }
        let out = tag.base_from_tag.rotation() * from_tag;
        let origin_m = tag.base_from_tag.origin().vector() + out * range_m;
        Some(Self { frame: robot.camera.mount, origin_m, axis: (beside - out).normalize() })
    }

    /// Returns the goal of a carried tag at this range from a fixed camera, in the direction of its optical axis plus
    /// an offset. `from_tag`: unit vector from the tag to the camera, in the tag's axes.
    fn of_carried_tag(
        robot: &Robot,
        tag: &SurveyedTag,
        range_m: f64,
        from_tag: &Vector3<f64>,
        beside: &Vector3<f64>,
    ) -> Self {
        let base_from_camera = &robot.camera.mount.link_from_frame;
        let sight = (base_from_camera.rotation * Vector3::z() + beside).normalize();
        // One of all rotations of the tag about the line of sight: the goal leaves this rotation free.
        let along = UnitQuaternion::rotation_between(from_tag, &-sight).unwrap_or_else(UnitQuaternion::identity);
        let Attachment { n_joints, link_from_frame } = robot.tag_frame;
        let frame = Attachment { n_joints, link_from_frame: link_from_frame * tag.base_from_tag.isometry() };
        let origin_m = base_from_camera.translation.vector + sight * range_m;
        Self { frame, origin_m, axis: along * Vector3::z() }
    }

    /// Returns the angles from `seed` with the joints before the frame solved; the others stay.
    pub(crate) fn solve(&self, robot: &Robot, limits: &[JointLimits], seed: &JointAngles) -> JointAngles {
        let error = self.error(robot, seed);
        let mut search = Search { goal: self, robot, limits, angles: *seed, error, trial: *seed, trial_error: error };
        minimize(&mut search, &DAMPING, &StopRule::after(STEPS));
        search.angles
    }

    /// Returns the position error (m), then the direction error.
    fn error(&self, robot: &Robot, angles: &JointAngles) -> SVector<f64, 6> {
        let base_from_frame = robot.chain.frame(angles, &self.frame);
        let off_m = self.origin_m - base_from_frame.translation.vector;
        let turn = (base_from_frame.rotation * Vector3::z()).cross(&self.axis);
        SVector::<f64, 6>::new(off_m.x, off_m.y, off_m.z, turn.x, turn.y, turn.z)
    }

    fn jacobian(&self, robot: &Robot, angles: &JointAngles, n: usize) -> SMatrix<f64, 6, MAX_JOINTS> {
        let poses = robot.chain.link_poses(angles);
        let base_from_frame = poses.frame(&self.frame);
        let axis = base_from_frame.rotation * Vector3::z();
        let mut out = SMatrix::<f64, 6, MAX_JOINTS>::zeros();
        for joint in 0..n {
            let moved = poses.point_jacobian(joint, &base_from_frame.translation.vector);
            // The axis turns by omega x a; in `a x a*` that is the part of omega across the axis.
            let omega = poses.turn_jacobian(joint);
            let turned = omega - axis * axis.dot(&omega);
            out.fixed_view_mut::<3, 1>(0, joint).copy_from(&moved);
            out.fixed_view_mut::<3, 1>(3, joint).copy_from(&turned);
        }
        out
    }
}

struct Search<'a> {
    goal: &'a CameraGoal,
    robot: &'a Robot,
    limits: &'a [JointLimits],
    angles: JointAngles,
    error: SVector<f64, 6>,
    trial: JointAngles,
    trial_error: SVector<f64, 6>,
}

impl LeastSquares for Search<'_> {
    fn cost(&self) -> f64 {
        self.error.norm()
    }

    fn propose(&mut self, damping: f64) -> Option<Proposal> {
        let n = self.goal.frame.n_joints;
        let jacobian = self.goal.jacobian(self.robot, &self.angles, n);
        let mut normal = jacobian.tr_mul(&jacobian);
        for k in 0..MAX_JOINTS {
            normal[(k, k)] += damping;
        }
        let step = normal.cholesky()?.solve(&jacobian.tr_mul(&self.error));
        let scale = (MAX_STEP_RAD / step.amax().max(1e-12)).min(1.0);
        self.trial = self.angles;
        for joint in 0..n {
            let JointLimits { lower_rad, upper_rad } = self.limits[joint];
            self.trial[joint] = (self.angles[joint] + scale * step[joint]).clamp(lower_rad.min(upper_rad), upper_rad);
        }
        Some(Proposal { length: f64::INFINITY, predicted_gain: f64::INFINITY })
    }

    fn trial_cost(&mut self) -> Option<f64> {
        self.trial_error = self.goal.error(self.robot, &self.trial);
        // A step against the limits does not move the arm, so it does not help.
        Some(self.trial_error.norm()).filter(|trial| *trial < self.error.norm())
    }

    fn accept(&mut self) {
        (self.angles, self.error) = (self.trial, self.trial_error);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(robot: &Robot) -> Vec<JointLimits> {
        let without = JointLimits { lower_rad: -3.0, upper_rad: 3.0 };
        robot.chain.joints().iter().map(|joint| joint.limits.unwrap_or(without)).collect()
    }

    /// From another pose, the camera reaches its position and direction at a random pose, within a small tolerance.
    #[test]
    fn the_camera_gets_where_another_pose_has_it() {
        let robot = crate::plan::view_planning::fixture::titan();
        let limits = limits(&robot);
        let mut rng = armcal_core::stats::stream_rng(3, "aim");
        let (mut n, mut there) = (0, 0);
        for _ in 0..200 {
            let goal =
                JointAngles::from_fn(robot.n_joints(), |j| rng.random_range(limits[j].lower_rad..limits[j].upper_rad));
            let frame = robot.chain.frame(&goal, &robot.camera.mount);
            let (origin_m, axis) = (frame.translation.vector, frame.rotation * Vector3::z());
            let aim = CameraGoal { frame: robot.camera.mount, origin_m, axis };
            let seed = JointAngles::from_fn(robot.n_joints(), |j| {
                (goal[j] + rng.random_range(-0.5..0.5)).clamp(limits[j].lower_rad, limits[j].upper_rad)
            });
            let error = aim.error(&robot, &aim.solve(&robot, &limits, &seed));
            n += 1;
            there += usize::from(error.norm() < 0.05);
        }
        assert!(there * 10 > n * 9, "{there} of {n}");
    }

    /// Some goals before a fixed camera are reached, and there the intended tag is usually in view. A direction may lie
    /// outside the image of a narrow lens.
    #[test]
    fn a_carried_tag_gets_before_the_camera() {
        let robot = crate::plan::view_planning::fixture::watched_titan();
        let limits = limits(&robot);
        let visibility = VisibilityModel::default();
        let mut rng = armcal_core::stats::stream_rng(3, "aim");
        let (mut met, mut shown) = (0, 0);
        for _ in 0..300 {
            let seed =
                JointAngles::from_fn(robot.n_joints(), |j| rng.random_range(limits[j].lower_rad..limits[j].upper_rad));
            let goal = CameraGoal::draw(&robot, &visibility, &mut rng).expect("there are tags");
            let angles = goal.solve(&robot, &limits, &seed);
            if goal.error(&robot, &angles).norm() > 0.02 {
                continue;
            }
            met += 1;
            let is_meant = |idx: usize| {
                robot.tag_frame.link_from_frame * robot.tags[idx].base_from_tag.isometry() == goal.frame.link_from_frame
            };
            shown += usize::from(visibility.in_view(&robot, &robot.chain.link_poses(&angles)).any(is_meant));
        }
        assert!(met > 40 && shown * 10 > met * 6, "{met} met, {shown} of them show the tag");
    }
}

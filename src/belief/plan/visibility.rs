//! Tags that a pose is expected to show.

use crate::plan::constants::visibility::{BORDER_PX, EDGE_RAD, MAX_INCIDENCE_RAD, RANGE_M, SIGHT_END_M};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::plan::clearance::ClearanceModel;
use crate::plan::clearance::sight::Sights;
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::{GripperTag, Robot};
use armcal_core::streams::JointAngles;

/// Conditions under which a detector reads a tag reliably.
#[derive(Clone, Copy, Debug)]
pub struct VisibilityModel {
    /// Largest distance from the camera to the tag's centre, m.
    pub max_range_m: f64,
    /// Smallest distance from the camera to the tag's centre, m.
    pub min_range_m: f64,
    /// Largest angle between the tag's normal and the line to the camera, rad.
    pub max_incidence_rad: f64,
    /// Width kept free at the edge of the lens's field of view, rad.
    pub edge_rad: f64,
    /// Width kept free at the border of the image, px.
    pub border_px: f64,
}

impl Default for VisibilityModel {
    fn default() -> Self {
        Self::USUAL
    }
}

impl VisibilityModel {
    /// Limits of a usual detector and a usual image.
    pub const USUAL: Self = {
        let [min_range_m, max_range_m] = RANGE_M;
        Self {
            max_range_m,
            min_range_m,
            max_incidence_rad: MAX_INCIDENCE_RAD,
            edge_rad: EDGE_RAD,
            border_px: BORDER_PX,
        }
    };

    /// Returns the indices of the surveyed tags that `robot` at `angles` sees, before occlusion.
    pub fn in_view<'a>(&'a self, robot: &'a Robot, poses: &LinkPoses) -> impl Iterator<Item = usize> + use<'a> {
        // All poses are in the frame of the tags, which the arm may carry.
        let tags_from_camera = camera_in_tags(robot, poses);
        let camera_from_tags = tags_from_camera.inverse();
        let eye = tags_from_camera.translation.vector;
        robot
            .tags
            .iter()
            .enumerate()
            .filter(move |(_, tag)| {
                let center = tag.base_from_tag.origin().vector();
                let sight = eye - center;
                let range_m = sight.norm();
                let normal = tag.base_from_tag.rotation() * Vector3::z();
                let incidence_ok = normal.dot(&sight) > range_m * self.max_incidence_rad.cos();
                (self.min_range_m..=self.max_range_m).contains(&range_m) && incidence_ok && {
                    armcal_core::optics::square_corners(tag.size_m).iter().all(|corner| {
                        let in_camera = camera_from_tags * (tag.base_from_tag.isometry() * corner);
                        self.in_image(robot, &in_camera)
                    })
                }
            })
            .map(|(idx, _)| idx)
    }

    /// True if the camera sees the tag on the gripper, whose links hide it at some angles. This tag may be nearer than
    /// others: only incidence, image and occlusion count.
    #[must_use]
    pub fn sees_gripper_tag(
        &self,
        robot: &Robot,
        tag: &GripperTag,
        clearance: &ClearanceModel<'_>,
        poses: &LinkPoses,
    ) -> bool {
        let base_from_camera = poses.frame(&robot.camera.mount);
        let base_from_tag = poses.frame(&tag.mount);
        let camera_from_base = base_from_camera.inverse();
        let eye = base_from_camera.translation.vector;
        let sight = eye - base_from_tag.translation.vector;
        let normal = base_from_tag.rotation * Vector3::z();
        normal.dot(&sight) > sight.norm() * self.max_incidence_rad.cos()
            && armcal_core::optics::square_corners(tag.size_m).iter().all(|corner| {
                let in_base = base_from_tag * corner;
                self.in_image(robot, &(camera_from_base * in_base))
                    && !clearance.blocks_sight(poses, &eye, &in_base.coords, SIGHT_END_M)
            })
    }

    fn in_image(&self, robot: &Robot, in_camera: &Point3<f64>) -> bool {
        let lens = &robot.camera.lens;
        let [width, height] = lens.resolution_px().map(f64::from);
        let within_rad = lens.max_view_angle_rad() - self.edge_rad;
        lens.project_within(&in_camera.coords, within_rad).is_some_and(|pixel| {
            (self.border_px..=width - self.border_px).contains(&pixel.x)
                && (self.border_px..=height - self.border_px).contains(&pixel.y)
        })
    }

    /// Returns the name of the shape that hides the first hidden tag in view.
    #[must_use]
    pub fn hidden_by<'a>(
        &self,
        robot: &Robot,
        clearance: &'a ClearanceModel<'_>,
        angles: &JointAngles,
    ) -> Option<&'a str> {
        let poses = robot.chain.link_poses(angles);
        self.in_view(robot, &poses).find_map(|idx| self.tag_hidden_by(robot, clearance, &poses, idx))
    }

    /// Returns the name of the shape that hides a corner of a tag (by its index).
    pub(crate) fn tag_hidden_by<'a>(
        &self,
        robot: &Robot,
        clearance: &'a ClearanceModel<'_>,
        poses: &LinkPoses,
        idx: usize,
    ) -> Option<&'a str> {
        let (tag, eye) = (&robot.tags[idx], poses.frame(&robot.camera.mount).translation.vector);
        let base_from_tag = robot.base_from_tags_at(poses) * tag.base_from_tag.isometry();
        armcal_core::optics::square_corners(tag.size_m).iter().find_map(|corner| {
            let target = base_from_tag * corner;
            clearance.sight_blocker(poses, [&eye, &target.coords], SIGHT_END_M)
        })
    }

    /// Returns the indices of the tags in view that no shape hides.
    #[must_use]
    pub fn visible(&self, robot: &Robot, clearance: &ClearanceModel<'_>, angles: &JointAngles) -> Vec<usize> {
        let poses = robot.chain.link_poses(angles);
        let sights = Sights::new(clearance, &poses);
        self.in_view(robot, &poses).filter(|&idx| !self.is_hidden(robot, &poses, &sights, idx)).collect()
    }

    /// True if a shape hides a corner of a tag (by its index).
    pub(crate) fn is_hidden(&self, robot: &Robot, poses: &LinkPoses, sights: &Sights<'_>, idx: usize) -> bool {
        let tag = &robot.tags[idx];
        let base_from_tag = robot.base_from_tags_at(poses) * tag.base_from_tag.isometry();
        sights.hide(&base_from_tag, &armcal_core::optics::square_corners(tag.size_m), SIGHT_END_M)
    }
}

/// Returns the pose of the camera in the frame of the tags.
fn camera_in_tags(robot: &Robot, poses: &LinkPoses) -> Isometry3<f64> {
    let base_from_camera = poses.frame(&robot.camera.mount);
    if robot.is_watched() { poses.frame(&robot.tag_frame).inv_mul(&base_from_camera) } else { base_from_camera }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::view_planning::fixture::{clearance_of, vehicle, watched_titan};
    use armcal_core::kinematics::Attachment;
    use armcal_core::robot::TagSurvey;
    use armcal_core::spatial::Pose;
    use armcal_core::stats::stream_rng;
    use rand::RngExt;

    /// Tags that the arm carries are seen like fixed tags at the same poses.
    #[test]
    fn carried_tags_are_seen_where_they_are() {
        let (robot, vehicle) = (watched_titan(), vehicle());
        let clearance = clearance_of(&robot, &vehicle);
        let (visibility, mut rng) = (VisibilityModel::default(), stream_rng(5, "configurations"));
        let (mut in_view, mut visible) = (0, 0);
        for _ in 0..300 {
            let angles = JointAngles::from_fn(robot.n_joints(), |j| {
                let sensor = &robot.sensors[j];
                sensor.center_rad + rng.random_range(-0.9..0.9) * sensor.half_range_rad.min(1.5)
            });
            let poses = robot.chain.link_poses(&angles);
            let mut tags = robot.tags.clone();
            for tag in &mut tags {
                tag.base_from_tag = Pose::from_isometry(poses.frame(&robot.tag_frame) * tag.base_from_tag.isometry());
            }
            let still = TagSurvey { tags, frame: Attachment::base(), family: None, ..robot.survey() };
            let still = robot.clone().with_survey(still);
            let of = |robot: &Robot| visibility.in_view(robot, &poses).collect::<Vec<_>>();
            assert_eq!(of(&robot), of(&still));
            let shown = visibility.visible(&robot, &clearance, &angles);
            assert_eq!(shown, visibility.visible(&still, &clearance, &angles));
            (in_view, visible) = (in_view + of(&robot).len(), visible + shown.len());
        }
        assert!(visible > 100 && in_view > visible + 20, "{in_view} in view, {visible} of them not hidden");
    }
}

//! Tag poses as built: the survey's poses with random errors.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use crate::as_built::pose::{PlainPose, normal_twist};
use crate::spec::TagsSpec;
use armcal_core::kinematics::Attachment;
use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::spatial::{Base, Link, Pose, Tag};

/// Surveyed tag at its true pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TagAsBuilt {
    /// Number of the tag.
    pub id: u32,
    /// Side of the black square, as surveyed.
    pub size_m: f64,
    /// Pose in the survey's frame: the base's, or that of the link that carries the tags.
    pub pose: PlainPose,
}

impl TagAsBuilt {
    /// Returns the true pose of a tag that is fixed near the arm.
    #[must_use]
    pub fn base_from_tag(&self) -> Pose<Base, Tag> {
        self.pose.to_pose()
    }

    /// Moves the tag in the survey's frame.
    pub(super) fn move_by(&mut self, motion: &Isometry3<f64>) {
        let moved = motion * self.base_from_tag().isometry();
        self.pose = PlainPose::of(&Pose::<Base, Tag>::from_isometry(moved));
    }

    /// Returns the attachment to the link that carries the tags, or to the base.
    pub(crate) fn attachment(&self, robot: &Robot) -> Attachment {
        let Attachment { n_joints, link_from_frame } = robot.tag_frame;
        let pose = *self.base_from_tag().isometry();
        // For tags near the arm this is the pose itself, to the last bit.
        let link_from_frame = if robot.is_watched() { link_from_frame * pose } else { pose };
        Attachment { n_joints, link_from_frame }
    }
}

/// Draws each tag of the survey; the base tag has its own standard deviation.
pub(super) fn draw_tags(robot: &Robot, spec: &TagsSpec, seed: u64) -> Vec<TagAsBuilt> {
    let draw_tag = |tag: &SurveyedTag| {
        let (std_m, std_rad) = if Some(tag.id) == robot.base_tag { spec.base_tag_std() } else { spec.survey_std() };
        let error = normal_twist(seed, &format!("as_built/tag/{}", tag.id), std_m, std_rad);
        TagAsBuilt { id: tag.id, size_m: tag.size_m, pose: PlainPose::of(&tag.base_from_tag.perturbed(&error)) }
    };
    robot.tags.iter().map(draw_tag).collect()
}

/// Draws `link_from_tag` of the tag on the gripper, if the robot has one.
pub(super) fn draw_gripper_tag(robot: &Robot, spec: &TagsSpec, seed: u64) -> Option<PlainPose> {
    let tag = robot.gripper_tag?;
    let (std_m, std_rad) = spec.gripper_std();
    let error = normal_twist(seed, "as_built/gripper_tag", std_m, std_rad);
    Some(PlainPose::of(&Pose::<Link, Tag>::from_isometry(tag.mount.link_from_frame).perturbed(&error)))
}

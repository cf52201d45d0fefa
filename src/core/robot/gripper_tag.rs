//! `[gripper_tag]` of robot.toml: a tag distal to the camera, in view of it.
//!
//! It is not a tag of the survey and does not locate the base. It constrains the joints between camera and tool.

use crate::codes::Code;
use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use super::error::{FileIssue, RobotError};
use super::part::check_place;
use super::survey::SurveyedTag;
use super::urdf::UrdfChain;
use crate::kinematics::Attachment;
use crate::optics::TagFamily;
use crate::spatial::{Link, Pose, Tag};

/// A tag on a link distal to the camera.
#[derive(Clone, Copy, Debug)]
pub struct GripperTag {
    /// Family of the tag, which is also that of the surveyed tags.
    pub family: TagFamily,
    /// Id of the tag in its family; no surveyed tag has the same id.
    pub id: u32,
    /// Side of the black square, m.
    pub size_m: f64,
    /// Nominal `link_from_tag` on the link that carries it.
    pub mount: Attachment,
    /// Standard deviation of the tag's position, per axis.
    pub position_std_m: f64,
    /// Standard deviation of the tag's rotation, per axis.
    pub rotation_std_rad: f64,
}

impl GripperTag {
    /// Joints between the camera and this tag.
    #[must_use]
    pub fn joints(&self, camera_mount: &Attachment) -> std::ops::Range<usize> {
        camera_mount.n_joints..self.mount.n_joints
    }

    /// Checks that the tag is of the surveyed tags' family, and that none of `tags` has the same id.
    ///
    /// # Errors
    /// [`FileIssue`] with the id.
    pub(super) fn check_beside(
        &self,
        file: &Path,
        tags: &[SurveyedTag],
        family: Option<TagFamily>,
    ) -> Result<(), FileIssue> {
        if let Some(other) = family.filter(|other| *other != self.family) {
            let problem = format!("is {}, that of the surveyed tags is {other}; one family an arm", self.family);
            return Err(FileIssue::new(Code::KeysConflict, file, "gripper_tag.family", problem));
        }
        if tags.iter().any(|tag| tag.id == self.id) {
            return Err(FileIssue::new(
                Code::ValueInvalid,
                file,
                "gripper_tag.id",
                format!("{} is also the id of a surveyed tag", self.id),
            ));
        }
        Ok(())
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct GripperTagFile {
    /// Id of the tag.
    id: u32,
    /// Family of the tag, such as `36h11`.
    family: String,
    /// Edge of the black square.
    #[schemars(range(min = 1e-3, max = 10.0))]
    size_m: f64,
    /// Link of the URDF that carries the tag.
    link: String,
    /// Position of the tag's centre in that link.
    #[schemars(inner(range(min = -1e4, max = 1e4)))]
    position_m: [f64; 3],
    /// Attitude of the tag in that link.
    quaternion_wxyz: [f64; 4],
    /// Standard deviation of the position, per axis.
    #[schemars(range(min = 0.0, max = 1.0))]
    position_std_m: f64,
    /// Standard deviation of the attitude, per axis.
    #[schemars(range(min = 0.0, max = 1.0))]
    rotation_std_rad: f64,
}

impl GripperTagFile {
    /// Checks the table against the URDF.
    ///
    /// # Errors
    /// [`RobotError`] naming file, key and allowed range.
    pub(super) fn check(
        &self,
        file: &Path,
        arm: &UrdfChain<'_>,
        camera_mount: &Attachment,
    ) -> Result<GripperTag, RobotError> {
        let issue = |key: &str, problem: String| {
            FileIssue::new(Code::ValueInvalid, file, format!("gripper_tag.{key}"), problem)
        };
        let check =
            |key: &str, value: f64, range| FileIssue::check_range(file, &format!("gripper_tag.{key}"), value, range);
        let family: TagFamily = self.family.parse().map_err(|problem| issue("family", problem))?;
        if !arm.urdf.has_link(&self.link) {
            return Err(issue("link", format!("`{}` is not a link of the URDF", self.link)).into());
        }
        let mut mount = arm.attachment(&self.link)?;
        if mount.n_joints <= camera_mount.n_joints {
            let problem =
                format!("`{}` is not distal to the camera: no joint moves it relative to the camera", self.link);
            return Err(issue("link", problem).into());
        }
        check_place(file, "gripper_tag.position_m", &self.position_m)?;
        let link_from_tag: Pose<Link, Tag> = Pose::from_position_quaternion_wxyz(self.position_m, self.quaternion_wxyz)
            .ok_or_else(|| issue("position_m, quaternion_wxyz", "must be finite, not zero".to_owned()))?;
        mount.link_from_frame *= link_from_tag.isometry();
        Ok(GripperTag {
            family,
            id: self.id,
            size_m: check("size_m", self.size_m, 1e-3..=10.0)?,
            mount,
            position_std_m: check("position_std_m", self.position_std_m, 0.0..=1.0)?,
            rotation_std_rad: check("rotation_std_rad", self.rotation_std_rad, 0.0..=1.0)?,
        })
    }
}

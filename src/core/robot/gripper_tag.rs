//! `[gripper_tag]` of robot.toml: a tag behind the last joint before it, where the wrist camera sees it.
//!
//! It is none of the survey's tags: it says nothing of where the base is, but ties the tool to the camera, which hangs before the
//! tool's last joint.

use std::path::Path;

use serde::Deserialize;

use super::error::{FileIssue, RobotError};
use super::part::check_place;
use super::survey::SurveyedTag;
use super::urdf::UrdfModel;
use crate::kinematics::{Attachment, Chain};
use crate::spatial::{Link, Pose, Tag};

/// A tag on a link that the camera watches turn.
#[derive(Clone, Copy, Debug)]
pub struct GripperTag {
    pub id: u32,
    /// Side of the black square, m.
    pub size_m: f64,
    /// `link_from_tag` on the link that carries it, by the drawing.
    pub mount: Attachment,
    /// One sigma per axis of where it was glued.
    pub position_std_m: f64,
    pub rotation_std_rad: f64,
}

impl GripperTag {
    /// The joints between the camera and this tag: those that turn it in the camera's view.
    #[must_use]
    pub fn joints(&self, camera_mount: &Attachment) -> std::ops::Range<usize> {
        camera_mount.n_joints..self.mount.n_joints
    }

    /// # Errors
    /// [`FileIssue`] when one of `tags` has the same id.
    pub(super) fn check_id(&self, file: &Path, tags: &[SurveyedTag]) -> Result<(), FileIssue> {
        if tags.iter().any(|tag| tag.id == self.id) {
            return Err(FileIssue::new(file, "gripper_tag.id", format!("{} is a surveyed tag's, too", self.id)));
        }
        Ok(())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GripperTagFile {
    id: u32,
    family: String,
    size_m: f64,
    /// A link of the URDF; the tag's place is in its frame.
    link: String,
    position_m: [f64; 3],
    quaternion_wxyz: [f64; 4],
    position_std_m: f64,
    rotation_std_rad: f64,
}

impl GripperTagFile {
    /// Checks the table against the drawing.
    ///
    /// # Errors
    /// [`RobotError`] naming file, key and allowed range.
    pub(super) fn check(
        &self,
        file: &Path,
        urdf: &UrdfModel,
        base_link: &str,
        chain: &Chain,
        camera_mount: &Attachment,
    ) -> Result<GripperTag, RobotError> {
        let issue = |key: &str, problem: String| FileIssue::new(file, format!("gripper_tag.{key}"), problem);
        let check =
            |key: &str, value: f64, range| FileIssue::check_range(file, &format!("gripper_tag.{key}"), value, range);
        if self.family != "36h11" {
            return Err(issue("family", format!("`{}` is not supported; use \"36h11\"", self.family)).into());
        }
        if !urdf.has_link(&self.link) {
            return Err(issue("link", format!("`{}` is no link of the URDF", self.link)).into());
        }
        let mut mount = urdf.attachment(base_link, &self.link, chain)?;
        if mount.n_joints <= camera_mount.n_joints {
            let problem = format!("`{}` is not behind the camera: no joint turns it in the camera's view", self.link);
            return Err(issue("link", problem).into());
        }
        check_place(file, "gripper_tag.position_m", &self.position_m)?;
        let link_from_tag: Pose<Link, Tag> = Pose::from_position_quaternion_wxyz(self.position_m, self.quaternion_wxyz)
            .ok_or_else(|| issue("position_m, quaternion_wxyz", "must be finite, not zero".to_owned()))?;
        mount.link_from_frame *= link_from_tag.isometry();
        Ok(GripperTag {
            id: self.id,
            size_m: check("size_m", self.size_m, 1e-3..=10.0)?,
            mount,
            position_std_m: check("position_std_m", self.position_std_m, 0.0..=1.0)?,
            rotation_std_rad: check("rotation_std_rad", self.rotation_std_rad, 0.0..=1.0)?,
        })
    }
}

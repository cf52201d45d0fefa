//! The nominal arm.

use crate::codes::{Code, Warning};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix6, Vector3};

use super::allowed_pairs::AllowedPairs;
use super::body::LinkBody;
use super::camera::{CameraSpec, LENS_KEYS};
use super::drive::DriveSpec;
use super::error::{FileIssue, RobotError};
use super::failed::{FailedJoint, FailedKind};
use super::geometry::GeometryPriors;
use super::gripper::GripperSpec;
use super::gripper_tag::GripperTag;
use super::joint_sensor::JointSensorSpec;
use super::self_pairs::SelfPairs;
use super::survey::{SurveyedTag, TagSurvey};
use super::vehicle::Vehicle;
use crate::joints::JointAngles;
use crate::kinematics::{Attachment, Chain, ChainJoint, LinkPoses};
use crate::optics::TagFamily;

/// The nominal arm: URDF, datasheets and survey.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Name of the arm in robot.toml.
    pub name: String,
    /// Serial number of the arm, for reports; `None` if robot.toml has none.
    pub serial: Option<String>,
    /// Folder of robot.toml.
    pub folder: PathBuf,
    /// File name of the URDF, without a folder.
    pub urdf_name: String,
    /// The URDF as read.
    pub urdf_text: String,
    /// Parts of the URDF that were skipped, by link or joint.
    pub urdf_warnings: Vec<Warning>,
    /// Largest torque of each joint by the URDF, N m (N of a slide), base first; 0 if it states none.
    pub efforts_n_m: Vec<f64>,
    /// Link of the URDF whose frame is the base frame.
    pub base_link: String,
    /// Moving joints from the base link to tool and camera.
    pub chain: Chain,
    /// Rigid bodies 0..=n_joints, base first.
    pub bodies: Vec<LinkBody>,
    /// Links that can come near each other; `None` without a self_collision.toml.
    pub self_pairs: Option<SelfPairs>,
    /// Parts that touch by design.
    pub allowed_pairs: AllowedPairs,
    /// Joint sensors, one per joint, base first.
    pub sensors: Vec<JointSensorSpec>,
    /// Oil consumption and tracking error of the drives.
    pub drive: DriveSpec,
    /// Prior standard deviations of the nominal model.
    pub geometry: GeometryPriors,
    /// Tool point and tip.
    pub tool: ToolSpec,
    /// Gripper; `None` if the tool is not a gripper.
    pub gripper: Option<GripperSpec>,
    /// Tag distal to the camera.
    pub gripper_tag: Option<GripperTag>,
    /// Lens and mount of the wrist camera.
    pub camera: CameraSpec,
    /// Cameras in addition to the first, which see the same tags through none but the first camera's joints. Recordings
    /// may have them; planning uses only the first camera.
    pub further_cameras: Vec<CameraSpec>,
    /// Surveyed tags, including those with unknown poses, without the tag on the gripper.
    pub tags: Vec<SurveyedTag>,
    /// Frame of the tags' poses: the base's, or one that the arm moves in front of a stationary camera.
    pub tag_frame: Attachment,
    /// Family of the tags.
    pub tag_family: TagFamily,
    /// All links of the URDF that the arm carries, by name.
    pub links: BTreeMap<String, Attachment>,
    /// Id of the tag next to the base; one of `tags`, `None` if there are none.
    pub base_tag: Option<u32>,
    /// Id of the tag whose error all others share ([`TagSurvey::anchor_tag`]).
    pub anchor_tag: Option<u32>,
    /// Stowed configuration, rad. If robot.toml states none, it is the middle of each joint's range: usable as a start
    /// if any angles will do, but not for planning (`planning_issues`).
    pub stowed: JointAngles,
    /// Data that planning needs and the folder lacks; empty for an arm that `run` and `plan` can move.
    pub planning_issues: Vec<FileIssue>,
    /// Weight of the displaced sea water divided by the arm's weight.
    pub buoyancy_fraction: f64,
    /// Joints declared to have failed; empty as loaded.
    pub failed: Vec<FailedJoint>,
}

/// Keys of data that planning may lack.
pub(super) const STOWED: &str = "stowed_rad";
pub(super) const BASE_TAG: &str = "base_tag";
pub(super) const TAG_LINK: &str = "tag_link";

/// Returns the issue of a missing camera lens.
pub(super) fn lens_issue(file: &Path) -> FileIssue {
    let problem = format!("is missing; images and the corners of tags need it: add {}", LENS_KEYS.join(", "));
    FileIssue::new(Code::KeyMissing, file, "[camera] lens", problem)
}

/// `[tool]` of robot.toml.
#[derive(Clone, Debug)]
pub struct ToolSpec {
    /// Pose of the tool point, in the axes of the link that carries it.
    pub mount: Attachment,
    /// Radius of a ball about the tool point that touches first; `None` if robot.toml does not state it.
    pub tip_radius_m: Option<f64>,
}

impl Robot {
    /// Number of moving joints.
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.chain.n_joints()
    }

    /// Number of joints, from the base on, that move camera and tags relative to each other.
    #[must_use]
    pub fn n_seen_joints(&self) -> usize {
        self.n_joints_seen_by(&self.camera)
    }

    /// Largest distance of the tool point from the first joint, m: the links' lengths in one line.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        let joints = &self.chain.joints()[..self.tool.mount.n_joints];
        let links_m = joints.iter().skip(1).map(|joint| joint.parent_from_joint.translation.vector.norm());
        let slides = joints.iter().filter(|joint| joint.kind.is_slide());
        let slides_m = slides.filter_map(|joint| joint.limits).map(|l| l.lower_rad.abs().max(l.upper_rad.abs()));
        links_m.chain(slides_m).sum::<f64>() + self.tool.mount.link_from_frame.translation.vector.norm()
    }

    /// Returns true if the links in one line are long enough for a target in the base's frame.
    #[must_use]
    pub fn is_long_enough_for(&self, target_m: &Vector3<f64>) -> bool {
        (target_m - self.chain.first_place().translation.vector).norm() <= self.reach_m()
    }

    /// Returns all cameras, the first one first.
    pub fn cameras(&self) -> impl Iterator<Item = &CameraSpec> {
        std::iter::once(&self.camera).chain(&self.further_cameras)
    }

    /// Returns the camera of that number; the first has number 0.
    ///
    /// # Panics
    /// If there is no camera of that number.
    #[must_use]
    pub fn camera_at(&self, number: usize) -> &CameraSpec {
        number.checked_sub(1).map_or(&self.camera, |further| &self.further_cameras[further])
    }

    /// Number of joints, from the base on, that move a camera and the tags relative to each other.
    #[must_use]
    pub fn n_joints_seen_by(&self, camera: &CameraSpec) -> usize {
        camera.mount.n_joints.max(self.tag_frame.n_joints)
    }

    /// Returns the pose of the tags' frame in the base frame, at these angles of the sensors. Tags around the arm do
    /// not move when its base bends.
    #[must_use]
    pub fn base_from_tags(&self, angles: &JointAngles) -> Isometry3<f64> {
        if self.is_watched() { self.chain.frame(angles, &self.tag_frame) } else { Isometry3::identity() }
    }

    /// Returns the pose of the tags' frame in the base frame, with the links at `poses`, which are in the base frame.
    #[must_use]
    pub fn base_from_tags_at(&self, poses: &LinkPoses) -> Isometry3<f64> {
        if self.is_watched() { poses.frame(&self.tag_frame) } else { Isometry3::identity() }
    }

    /// Returns the pose of the camera in the frame of the tags, at these angles of the sensors.
    #[must_use]
    pub fn tags_from_camera(&self, angles: &JointAngles) -> Isometry3<f64> {
        self.tags_from(&self.camera, angles)
    }

    /// Returns the pose of any of the cameras in the frame of the tags, at these angles of the sensors.
    #[must_use]
    pub fn tags_from(&self, camera: &CameraSpec, angles: &JointAngles) -> Isometry3<f64> {
        if !self.is_watched() {
            return self.chain.frame(angles, &camera.mount);
        }
        self.chain.link_poses(angles).in_frame(&self.tag_frame).frame(&camera.mount)
    }

    /// Returns the link that carries the tags in front of a stationary camera; `None` for tags around the arm.
    #[must_use]
    pub fn tag_link(&self) -> Option<&str> {
        if !self.is_watched() {
            return None;
        }
        // Links fixed to a link that a joint moves may have its frame too; the moved link is the result.
        let moved = &self.bodies[self.tag_frame.n_joints].name;
        let carries = |name: &&String| self.links.get(*name) == Some(&self.tag_frame);
        std::iter::once(moved).chain(self.links.keys()).find(carries).map(String::as_str)
    }

    /// Returns true if the camera is stationary and the arm carries the tags (eye-to-hand).
    #[must_use]
    pub fn is_watched(&self) -> bool {
        self.tag_frame.n_joints > self.camera.mount.n_joints
    }

    /// Returns the surveyed tag with this id; `None` also for the tag on the gripper.
    #[must_use]
    pub fn tag(&self, id: u32) -> Option<&SurveyedTag> {
        self.tags.iter().find(|tag| tag.id == id)
    }

    /// Names of the moving joints in the URDF, base first.
    #[must_use]
    pub fn joint_names(&self) -> Vec<String> {
        self.sensors.iter().map(|s| s.joint.clone()).collect()
    }

    /// Returns the arm with the tags of `survey`.
    #[must_use]
    pub fn with_survey(mut self, survey: TagSurvey) -> Self {
        self.planning_issues.retain(|issue| issue.key != BASE_TAG);
        self.tags = survey.tags;
        self.base_tag = survey.base_tag;
        self.anchor_tag = survey.anchor_tag;
        self.tag_frame = survey.frame;
        self.tag_family = survey.family.unwrap_or(self.tag_family);
        self
    }

    /// Returns the arm on `vehicle`: with the vehicle's tags and its stowed configuration of this arm, if it has any.
    /// An arm that carries tags in front of a stationary camera keeps them.
    ///
    /// # Errors
    /// [`RobotError`] naming the vehicle's file if it has a wrong number of stowed angles. [`RobotError`] naming
    /// robot.toml if its `allowed_pairs` contain a part that neither arm nor vehicle has.
    pub fn mounted_on(mut self, vehicle: &Vehicle) -> Result<Self, RobotError> {
        self.allowed_pairs.check_names(&self.folder.join("robot.toml"), &self.bodies, vehicle)?;
        if let Some(stowed_rad) = vehicle.stowed_rad.get(&self.name) {
            let key = format!("stowed_rad.{}", self.name);
            self.stowed = check_stowed(&vehicle.file, &key, stowed_rad, self.n_joints())?;
            self.planning_issues.retain(|issue| issue.key != STOWED);
        }
        // Stationary tags give a stationary camera no information.
        let Some(survey) = vehicle.survey.as_ref().filter(|_| !self.is_watched()) else { return Ok(self) };
        if let Some(tag) = &self.gripper_tag {
            tag.check_beside(&vehicle.file, &survey.tags, survey.family)?;
        }
        Ok(self.with_survey(survey.clone()))
    }

    /// Returns the arm with `scale` times the linearity error of its sensors.
    #[must_use]
    pub fn with_linearity(mut self, scale: f64) -> Self {
        for sensor in &mut self.sensors {
            sensor.linearity_std_rad *= scale;
        }
        self
    }

    /// Returns the arm with an estimated camera mount and its covariance (translation m, rotation rad).
    #[must_use]
    pub fn with_camera_at(mut self, link_from_camera: Isometry3<f64>, covariance: &Matrix6<f64>) -> Self {
        let rms = |from: usize| ((0..3).map(|k| covariance[(from + k, from + k)]).sum::<f64>() / 3.0).max(0.0).sqrt();
        self.camera.mount.link_from_frame = link_from_camera;
        (self.camera.mount_std_m, self.camera.mount_std_rad) = (rms(0), rms(3));
        self
    }

    /// Returns the survey of the tags around the arm.
    #[must_use]
    pub fn survey(&self) -> TagSurvey {
        TagSurvey {
            base_tag: self.base_tag,
            anchor_tag: self.anchor_tag,
            frame: self.tag_frame,
            family: Some(self.tag_family),
            tags: self.tags.clone(),
        }
    }

    /// Checks that the arm can be simulated: each moving body has mass and an inertia.
    ///
    /// # Errors
    /// [`RobotError::ZeroMass`] or [`RobotError::Value`] naming the first link without them.
    pub fn require_masses(&self) -> Result<(), RobotError> {
        let file = self.folder.join(&self.urdf_name);
        for body in &self.bodies[1..] {
            if body.mass_kg <= 0.0 {
                return Err(RobotError::ZeroMass { file, link: body.name.clone(), mass_kg: body.mass_kg });
            }
            if let Some(link) = &body.bad_inertia {
                let key = format!("link `{link}`: inertia");
                return Err(FileIssue::new(
                    Code::ValueInvalid,
                    &file,
                    key,
                    "is not positive definite, so the arm cannot be simulated",
                )
                .into());
            }
        }
        Ok(())
    }

    /// Checks that paths and views can be planned for the arm and its camera.
    ///
    /// # Errors
    /// [`FileIssue`] naming all missing data of the folder, and the keys to add.
    pub fn require_planning(&self) -> Result<(), FileIssue> {
        FileIssue::all(&self.folder.join("robot.toml"), &self.planning_issues).map_or(Ok(()), Err)
    }

    /// Returns the first joint that slides.
    #[must_use]
    pub fn first_slide(&self) -> Option<&ChainJoint> {
        self.chain.joints().iter().find(|joint| joint.kind.is_slide())
    }

    /// Checks that all joints turn, because the command `what` does not support slides.
    ///
    /// # Errors
    /// [`FileIssue`] naming the URDF, the first slide and the commands that support it.
    pub fn require_turning(&self, what: &str) -> Result<(), FileIssue> {
        let Some(slide) = self.first_slide() else { return Ok(()) };
        let problem = format!("is prismatic, and {what} knows no slides yet: `armcal calibrate` on a recording does");
        Err(FileIssue::new(
            Code::UrdfStructure,
            &self.folder.join(&self.urdf_name),
            format!("joint `{}`", slide.name),
            problem,
        ))
    }

    /// Checks that the camera's lens is known, which the corners of tags require.
    ///
    /// # Errors
    /// [`FileIssue`] naming the keys to add.
    pub fn require_lens(&self) -> Result<(), FileIssue> {
        if self.camera.lens.is_known() { Ok(()) } else { Err(lens_issue(&self.folder.join("robot.toml"))) }
    }

    /// Checks that the lens of the further camera of that name is known, if there is one.
    ///
    /// # Errors
    /// The errors of [`Self::require_lens`].
    pub fn require_further_lens(&self, name: &str) -> Result<(), FileIssue> {
        let Some(_) = self.further_cameras.iter().find(|camera| camera.name == name && !camera.lens.is_known()) else {
            return Ok(());
        };
        let issue = lens_issue(&self.folder.join("robot.toml"));
        Err(FileIssue { key: format!("[[further_camera]] `{name}` lens"), ..issue })
    }

    /// Returns the arm with these joints declared to have failed. A later declaration of a joint replaces an earlier
    /// one, except that a joint with a dead or stuck sensor may be locked, too.
    #[must_use]
    pub fn with_failed(mut self, failed: &[FailedJoint]) -> Self {
        self.failed = FailedJoint::joined(self.failed, failed);
        self
    }

    /// Returns true if the joint is declared to have one fixed angle.
    #[must_use]
    pub fn is_locked(&self, joint: usize) -> bool {
        self.failed.contains(&FailedJoint { joint, kind: FailedKind::Locked })
    }
}

/// Checks that `angles_rad`, given at `key`, has one angle per joint.
pub(super) fn check_stowed(
    file: &Path,
    key: &str,
    angles_rad: &[f64],
    n_joints: usize,
) -> Result<JointAngles, RobotError> {
    if angles_rad.len() != n_joints || !angles_rad.iter().all(|v| v.abs() <= 100.0) {
        let problem = format!("needs {n_joints} angles within 100 rad, one per joint");
        return Err(FileIssue::new(Code::ValueCount, file, key, problem).into());
    }
    Ok(JointAngles::from_slice(angles_rad))
}

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
use super::failed::FailedJoint;
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

/// The nominal arm: drawing, datasheets and survey.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Name in robot.toml.
    pub name: String,
    /// Serial number of the arm, for reports; `None` where robot.toml has none.
    pub serial: Option<String>,
    /// Folder of robot.toml.
    pub folder: PathBuf,
    /// File name of the URDF, without a folder.
    pub urdf_name: String,
    /// The URDF as read.
    pub urdf_text: String,
    /// Parts of the URDF that were skipped, by link or joint.
    pub urdf_warnings: Vec<Warning>,
    /// Largest torque of each joint by the URDF, N m (N of a slide), base first; 0 where it states none.
    pub efforts_n_m: Vec<f64>,
    /// Link of the URDF whose frame is the base frame.
    pub base_link: String,
    /// Moving joints from the base link to tool and camera.
    pub chain: Chain,
    /// Bodies 0..=n_joints: base first.
    pub bodies: Vec<LinkBody>,
    /// Links that can come near each other; `None` without a self_collision.toml.
    pub self_pairs: Option<SelfPairs>,
    /// Parts that touch by design.
    pub allowed_pairs: AllowedPairs,
    /// One per joint, base first.
    pub sensors: Vec<JointSensorSpec>,
    /// Oil consumption and tracking error of the drives.
    pub drive: DriveSpec,
    /// How well the drawing is known.
    pub geometry: GeometryPriors,
    /// The tool point.
    pub tool: ToolSpec,
    /// `None` where the tool is no gripper.
    pub gripper: Option<GripperSpec>,
    /// A tag distal to the camera.
    pub gripper_tag: Option<GripperTag>,
    /// Lens and mount of the wrist camera.
    pub camera: CameraSpec,
    /// Cameras beside it, which see the same tags past no joint that it does not. Recordings may have them; the arm is
    /// planned for by the first alone.
    pub further_cameras: Vec<CameraSpec>,
    /// Tags by survey, with those whose pose is unknown; without the tag on the gripper.
    pub tags: Vec<SurveyedTag>,
    /// The frame that the tags' poses are in: the base's, or one that the arm moves before a camera that stands still.
    pub tag_frame: Attachment,
    /// What is printed on the tags.
    pub tag_family: TagFamily,
    /// Every link of the URDF that the arm carries, by name.
    pub links: BTreeMap<String, Attachment>,
    /// Id of the tag beside the base; one of `tags` where there are any, `None` where there are none.
    pub base_tag: Option<u32>,
    /// Joint angles in which the arm is stowed, rad. Where robot.toml names none, the middle of each joint's range: a
    /// start for what needs any angles, and no place to plan from (`planning_issues`).
    pub stowed: JointAngles,
    /// What planning needs and the folder does not give; empty for an arm that `run` and `plan` can move.
    pub planning_issues: Vec<FileIssue>,
    /// Weight of the displaced sea water divided by the arm's weight.
    pub buoyancy_fraction: f64,
    /// Joints declared to have failed; empty as loaded.
    pub failed: Vec<FailedJoint>,
}

/// Keys of what planning may lack.
pub(super) const STOWED: &str = "stowed_rad";
pub(super) const BASE_TAG: &str = "base_tag";
pub(super) const TAG_LINK: &str = "tag_link";

/// That the camera's lens is missing.
pub(super) fn lens_issue(file: &Path) -> FileIssue {
    let problem = format!("is missing; images and the corners of tags need it: add {}", LENS_KEYS.join(", "));
    FileIssue::new(Code::KeyMissing, file, "[camera] lens", problem)
}

/// `[tool]` of robot.toml.
#[derive(Clone, Debug)]
pub struct ToolSpec {
    /// The tool point, axes of the link that carries it.
    pub mount: Attachment,
    /// Of a ball about the tool point, which touches first; `None` where nobody says what touches.
    pub tip_radius_m: Option<f64>,
}

impl Robot {
    /// Number of moving joints.
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.chain.n_joints()
    }

    /// How many joints, from the base on, move camera and tags against each other.
    #[must_use]
    pub fn n_seen_joints(&self) -> usize {
        self.n_joints_seen_by(&self.camera)
    }

    /// Farthest that the tool's point can be from the first joint, m: the links' lengths in one line.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        let joints = &self.chain.joints()[..self.tool.mount.n_joints];
        let links_m = joints.iter().skip(1).map(|joint| joint.parent_from_joint.translation.vector.norm());
        let slides = joints.iter().filter(|joint| joint.kind.is_slide());
        let slides_m = slides.filter_map(|joint| joint.limits).map(|l| l.lower_rad.abs().max(l.upper_rad.abs()));
        links_m.chain(slides_m).sum::<f64>() + self.tool.mount.link_from_frame.translation.vector.norm()
    }

    /// Returns true where the links in one line are long enough for a target in the base's frame.
    #[must_use]
    pub fn is_long_enough_for(&self, target_m: &Vector3<f64>) -> bool {
        (target_m - self.chain.first_place().translation.vector).norm() <= self.reach_m()
    }

    /// All cameras, the first one first.
    pub fn cameras(&self) -> impl Iterator<Item = &CameraSpec> {
        std::iter::once(&self.camera).chain(&self.further_cameras)
    }

    /// The camera of that number, the first's being 0.
    ///
    /// # Panics
    /// Where there is none of that number.
    #[must_use]
    pub fn camera_at(&self, number: usize) -> &CameraSpec {
        number.checked_sub(1).map_or(&self.camera, |further| &self.further_cameras[further])
    }

    /// How many joints, from the base on, move a camera and the tags against each other.
    #[must_use]
    pub fn n_joints_seen_by(&self, camera: &CameraSpec) -> usize {
        camera.mount.n_joints.max(self.tag_frame.n_joints)
    }

    /// The frame of the tags in the base's, at these angles by the sensors. Tags beside the arm do not bend with its
    /// base.
    #[must_use]
    pub fn base_from_tags(&self, angles: &JointAngles) -> Isometry3<f64> {
        if self.is_watched() { self.chain.frame(angles, &self.tag_frame) } else { Isometry3::identity() }
    }

    /// The same where the links are at `poses`, whose frame is the base's.
    #[must_use]
    pub fn base_from_tags_at(&self, poses: &LinkPoses) -> Isometry3<f64> {
        if self.is_watched() { poses.frame(&self.tag_frame) } else { Isometry3::identity() }
    }

    /// The camera in the frame of the tags, at these angles by the sensors.
    #[must_use]
    pub fn tags_from_camera(&self, angles: &JointAngles) -> Isometry3<f64> {
        self.tags_from(&self.camera, angles)
    }

    /// The same of any of its cameras.
    #[must_use]
    pub fn tags_from(&self, camera: &CameraSpec, angles: &JointAngles) -> Isometry3<f64> {
        if !self.is_watched() {
            return self.chain.frame(angles, &camera.mount);
        }
        self.chain.link_poses(angles).in_frame(&self.tag_frame).frame(&camera.mount)
    }

    /// The link that carries the tags before a camera that stands still; `None` for tags beside the arm.
    #[must_use]
    pub fn tag_link(&self) -> Option<&str> {
        if !self.is_watched() {
            return None;
        }
        // Links fixed to one that a joint moves may have its frame, too: the moved one is meant.
        let moved = &self.bodies[self.tag_frame.n_joints].name;
        let carries = |name: &&String| self.links.get(*name) == Some(&self.tag_frame);
        std::iter::once(moved).chain(self.links.keys()).find(carries).map(String::as_str)
    }

    /// Whether the camera stands still beside the arm, which carries the tags (eye-to-hand).
    #[must_use]
    pub fn is_watched(&self) -> bool {
        self.tag_frame.n_joints > self.camera.mount.n_joints
    }

    /// The surveyed tag with this id; `None` for the tag on the gripper, too.
    #[must_use]
    pub fn tag(&self, id: u32) -> Option<&SurveyedTag> {
        self.tags.iter().find(|tag| tag.id == id)
    }

    /// Names of the moving joints in the URDF, base first.
    #[must_use]
    pub fn joint_names(&self) -> Vec<String> {
        self.sensors.iter().map(|s| s.joint.clone()).collect()
    }

    /// The same arm with the tags of `survey`.
    #[must_use]
    pub fn with_survey(mut self, survey: TagSurvey) -> Self {
        self.planning_issues.retain(|issue| issue.key != BASE_TAG);
        self.tags = survey.tags;
        self.base_tag = survey.base_tag;
        self.tag_frame = survey.frame;
        self.tag_family = survey.family.unwrap_or(self.tag_family);
        self
    }

    /// The arm on `vehicle`: with the vehicle's tags and its stowed configuration of this arm, where it has any. An arm
    /// that carries tags before a camera that stands still keeps them.
    ///
    /// # Errors
    /// [`RobotError`] naming the vehicle's file when it has another number of stowed angles, and robot.toml when it
    /// names a part in `allowed_pairs` that neither has.
    pub fn mounted_on(mut self, vehicle: &Vehicle) -> Result<Self, RobotError> {
        self.allowed_pairs.check_names(&self.folder.join("robot.toml"), &self.bodies, vehicle)?;
        if let Some(stowed_rad) = vehicle.stowed_rad.get(&self.name) {
            let key = format!("stowed_rad.{}", self.name);
            self.stowed = check_stowed(&vehicle.file, &key, stowed_rad, self.n_joints())?;
            self.planning_issues.retain(|issue| issue.key != STOWED);
        }
        // Of tags that do not move a camera that stands still tells nothing.
        let Some(survey) = vehicle.survey.as_ref().filter(|_| !self.is_watched()) else { return Ok(self) };
        if let Some(tag) = &self.gripper_tag {
            tag.check_beside(&vehicle.file, &survey.tags, survey.family)?;
        }
        Ok(self.with_survey(survey.clone()))
    }

    /// The same arm with `scale` times the linearity error of its sensors.
    #[must_use]
    pub fn with_linearity(mut self, scale: f64) -> Self {
        for sensor in &mut self.sensors {
            sensor.linearity_std_rad *= scale;
        }
        self
    }

    /// The same arm with an estimated camera mount and its covariance (translation m, rotation rad).
    #[must_use]
    pub fn with_camera_at(mut self, link_from_camera: Isometry3<f64>, covariance: &Matrix6<f64>) -> Self {
        let rms = |from: usize| ((0..3).map(|k| covariance[(from + k, from + k)]).sum::<f64>() / 3.0).max(0.0).sqrt();
        self.camera.mount.link_from_frame = link_from_camera;
        (self.camera.mount_std_m, self.camera.mount_std_rad) = (rms(0), rms(3));
        self
    }

    /// The tags around the arm.
    #[must_use]
    pub fn survey(&self) -> TagSurvey {
        TagSurvey {
            base_tag: self.base_tag,
            frame: self.tag_frame,
            family: Some(self.tag_family),
            tags: self.tags.clone(),
        }
    }

    /// Checks that the arm can be simulated: each moving body has mass and an inertia.
    ///
    /// # Errors
    /// [`RobotError::ZeroMass`] or [`RobotError::Value`] naming the first link that has not.
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

    /// Checks that paths can be planned for the arm and views seen by its camera.
    ///
    /// # Errors
    /// [`FileIssue`] naming all that the folder lacks for it, and what to add.
    pub fn require_planning(&self) -> Result<(), FileIssue> {
        FileIssue::all(&self.folder.join("robot.toml"), &self.planning_issues).map_or(Ok(()), Err)
    }

    /// The first joint that slides.
    #[must_use]
    pub fn first_slide(&self) -> Option<&ChainJoint> {
        self.chain.joints().iter().find(|joint| joint.kind.is_slide())
    }

    /// Checks that all joints turn, for `what`, which knows no slides.
    ///
    /// # Errors
    /// [`FileIssue`] naming the URDF, the first slide and what does work.
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

    /// Checks that the camera's lens is known: tags' corners mean nothing without it.
    ///
    /// # Errors
    /// [`FileIssue`] naming the keys to add.
    pub fn require_lens(&self) -> Result<(), FileIssue> {
        if self.camera.lens.is_known() { Ok(()) } else { Err(lens_issue(&self.folder.join("robot.toml"))) }
    }

    /// The same of the further camera of that name, if there is one.
    ///
    /// # Errors
    /// As [`Self::require_lens`].
    pub fn require_further_lens(&self, name: &str) -> Result<(), FileIssue> {
        let Some(_) = self.further_cameras.iter().find(|camera| camera.name == name && !camera.lens.is_known()) else {
            return Ok(());
        };
        let issue = lens_issue(&self.folder.join("robot.toml"));
        Err(FileIssue { key: format!("[[further_camera]] `{name}` lens"), ..issue })
    }

    /// The same arm with these joints declared to have failed. A later declaration of a joint replaces an earlier one.
    #[must_use]
    pub fn with_failed(mut self, failed: &[FailedJoint]) -> Self {
        for declared in failed {
            self.failed.retain(|known| known.joint != declared.joint);
            self.failed.push(*declared);
        }
        self.failed.sort_unstable();
        self
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

//! The nominal arm.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix6};

use super::allowed_pairs::AllowedPairs;
use super::body::LinkBody;
use super::camera::CameraSpec;
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
use crate::kinematics::{Attachment, Chain};

/// The nominal arm: drawing, datasheets and survey.
#[derive(Clone, Debug)]
pub struct Robot {
    /// Name in robot.toml.
    pub name: String,
    /// Folder of robot.toml.
    pub folder: PathBuf,
    /// File name of the URDF, without a folder.
    pub urdf_name: String,
    /// The URDF as read.
    pub urdf_text: String,
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
    /// Tags by survey, with those whose pose is unknown; without the tag on the gripper.
    pub tags: Vec<SurveyedTag>,
    /// Id of the tag beside the base; one of `tags` where there are any.
    pub base_tag: u32,
    /// Joint angles in which the arm is stowed, rad.
    pub stowed: JointAngles,
    /// Weight of the displaced sea water divided by the arm's weight.
    pub buoyancy_fraction: f64,
    /// Joints declared to have failed; empty as loaded.
    pub failed: Vec<FailedJoint>,
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
        self.tags = survey.tags;
        self.base_tag = survey.base_tag;
        self
    }

    /// The arm on `vehicle`: with the vehicle's tags and its stowed configuration of this arm, where it has any.
    ///
    /// # Errors
    /// [`RobotError`] naming the vehicle's file when it has another number of stowed angles, and robot.toml when it
    /// names a part in `allowed_pairs` that neither has.
    pub fn mounted_on(mut self, vehicle: &Vehicle) -> Result<Self, RobotError> {
        self.allowed_pairs.check_names(&self.folder.join("robot.toml"), &self.bodies, vehicle)?;
        if let Some(stowed_rad) = vehicle.stowed_rad.get(&self.name) {
            let key = format!("stowed_rad.{}", self.name);
            self.stowed = check_stowed(&vehicle.file, &key, stowed_rad, self.n_joints())?;
        }
        let Some(survey) = &vehicle.survey else { return Ok(self) };
        if let Some(tag) = &self.gripper_tag {
            tag.check_id(&vehicle.file, &survey.tags)?;
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
        TagSurvey { base_tag: self.base_tag, tags: self.tags.clone() }
    }

    /// Checks that the arm can be simulated: each moving body has mass.
    ///
    /// # Errors
    /// [`RobotError::ZeroMass`] naming the first link without mass.
    pub fn require_masses(&self) -> Result<(), RobotError> {
        match self.bodies[1..].iter().find(|body| body.mass_kg <= 0.0) {
            None => Ok(()),
            Some(body) => Err(RobotError::ZeroMass {
                file: self.folder.join(&self.urdf_name),
                link: body.name.clone(),
                mass_kg: body.mass_kg,
            }),
        }
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
        return Err(FileIssue::new(file, key, problem).into());
    }
    Ok(JointAngles::from_slice(angles_rad))
}

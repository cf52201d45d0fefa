//! All as-built values of one seed.

use serde::{Deserialize, Serialize};

use crate::as_built::attitude::AttitudeAsBuilt;
use crate::as_built::camera_mount::draw_camera_mount;
use crate::as_built::dome_port::draw_dome_center;
use crate::as_built::draw_joint::draw_joint;
use crate::as_built::gauges::GaugesAsBuilt;
use crate::as_built::geometry::GeometryAsBuilt;
use crate::as_built::joint::JointAsBuilt;
use crate::as_built::lens::LensAsBuilt;
use crate::as_built::pose::PlainPose;
use crate::as_built::tags::{TagAsBuilt, draw_gripper_tag, draw_tags};
use crate::spec::WorldSpec;
use armcal_core::kinematics::Attachment;
use armcal_core::robot::Robot;
use armcal_core::spatial::{Camera, Link, Pose, Tag};

/// All values that were drawn for one seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AsBuilt {
    /// Joint sensors, base first.
    pub joints: Vec<JointAsBuilt>,
    /// Pose `link_from_camera` on the link that carries the camera.
    pub camera_mount: PlainPose,
    /// Surveyed tags, in the order of the survey.
    pub tags: Vec<TagAsBuilt>,
    /// Pose `link_from_tag` of the tag on the gripper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gripper_tag: Option<PlainPose>,
    /// Thermometers and depth gauge.
    #[serde(default, skip_serializing_if = "GaugesAsBuilt::is_exact")]
    pub gauges: GaugesAsBuilt,
    /// The vehicle's attitude sensor.
    #[serde(default, skip_serializing_if = "AttitudeAsBuilt::is_exact")]
    pub attitude: AttitudeAsBuilt,
    /// Lens, if it differs from the nominal one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens: Option<LensAsBuilt>,
    /// Centre of a dome port that is not centred on the lens's pupil, camera frame, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dome_center_m: Option<[f64; 3]>,
    /// Errors of the arm's geometry; absent for an arm as in the URDF. The poses of `tags` include the survey's part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<GeometryAsBuilt>,
}

impl AsBuilt {
    /// Draws every value from its own stream, so that one more effect does not change the others.
    #[must_use]
    pub fn draw(robot: &Robot, spec: &WorldSpec, seed: u64) -> Self {
        let geometry = GeometryAsBuilt::draw(robot, &spec.geometry, seed);
        let mut tags = draw_tags(robot, &spec.tags, seed);
        if let Some(geometry) = &geometry {
            geometry.move_survey(robot, &mut tags);
        }
        let joints = (0..robot.n_joints()).map(|joint| draw_joint(robot, joint, spec, seed)).collect();
        Self {
            joints,
            gripper_tag: draw_gripper_tag(robot, &spec.tags, seed),
            camera_mount: draw_camera_mount(robot, &spec.camera, seed),
            tags,
            gauges: GaugesAsBuilt::draw(spec, seed),
            attitude: AttitudeAsBuilt::draw(&spec.vehicle, seed),
            lens: LensAsBuilt::draw(&robot.camera.lens, &spec.camera, seed),
            dome_center_m: draw_dome_center(&spec.camera, seed),
            geometry,
        }
    }

    /// Returns the arm as built: the nominal one with its geometry errors.
    #[must_use]
    pub fn arm(&self, nominal: &Robot) -> Robot {
        self.geometry.as_ref().map_or_else(|| nominal.clone(), |geometry| geometry.applied_to(nominal))
    }

    /// Returns the true pose of the camera on its link.
    pub(crate) fn camera_attachment(&self, robot: &Robot) -> Attachment {
        let link_from_camera: Pose<Link, Camera> = self.camera_mount.to_pose();
        Attachment { n_joints: robot.camera.mount.n_joints, link_from_frame: *link_from_camera.isometry() }
    }

    /// Returns the true pose of the gripper tag on its link.
    pub(crate) fn gripper_tag_attachment(&self, robot: &Robot) -> Option<Attachment> {
        let link_from_tag: Pose<Link, Tag> = self.gripper_tag?.to_pose();
        let n_joints = robot.gripper_tag?.mount.n_joints;
        Some(Attachment { n_joints, link_from_frame: *link_from_tag.isometry() })
    }
}

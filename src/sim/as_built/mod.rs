//! The arm, camera mount and tags as they were built: drawn once per seed, seen by nobody but the score.

mod camera;
mod gauges;
mod joint;

use nalgebra::{Vector3, Vector6};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::spec::WorldSpec;
use armcal_core::kinematics::Attachment;
use armcal_core::robot::Robot;
use armcal_core::spatial::{Base, Camera, Frame, Link, Pose, Tag};
use armcal_core::stats::stream_rng;
pub use camera::LensAsBuilt;
pub use gauges::{AttitudeAsBuilt, GaugesAsBuilt};
pub use joint::{Harmonic, JointAsBuilt, ResolverAsBuilt, WornSpot};

/// Everything that was drawn for one seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AsBuilt {
    pub joints: Vec<JointAsBuilt>,
    /// `link_from_camera` on the link that carries the camera.
    pub camera_mount: PlainPose,
    pub tags: Vec<TagAsBuilt>,
    /// `link_from_tag` of the tag on the gripper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gripper_tag: Option<PlainPose>,
    #[serde(default, skip_serializing_if = "GaugesAsBuilt::is_exact")]
    pub gauges: GaugesAsBuilt,
    #[serde(default, skip_serializing_if = "AttitudeAsBuilt::is_exact")]
    pub attitude: AttitudeAsBuilt,
    /// Where it differs from the drawing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens: Option<LensAsBuilt>,
    /// Of a dome port that is not about the lens's pupil; camera frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dome_center_m: Option<[f64; 3]>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TagAsBuilt {
    pub id: u32,
    pub size_m: f64,
    /// `base_from_tag`.
    pub pose: PlainPose,
}

/// A pose as files write it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlainPose {
    pub position_m: [f64; 3],
    pub quaternion_wxyz: [f64; 4],
}

impl AsBuilt {
    /// Draws every value from a stream of its own, so that one more effect does not move the others.
    #[must_use]
    pub fn draw(robot: &Robot, spec: &WorldSpec, seed: u64) -> Self {
        let joints = (0..robot.n_joints()).map(|joint| JointAsBuilt::draw(robot, joint, spec, seed)).collect();
        let mount_error =
            normal_twist(seed, "as_built/camera_mount", spec.camera.mount_std_m, spec.camera.mount_std_rad);
        let link_from_camera: Pose<Link, Camera> =
            Pose::from_isometry(robot.camera.mount.link_from_frame).perturbed(&mount_error);
        let tags = robot.tags.iter().map(|tag| {
            let stream = format!("as_built/tag/{}", tag.id);
            let (std_m, std_rad) = spec.tags.survey_std(tag.id == robot.base_tag);
            let error = normal_twist(seed, &stream, std_m, std_rad);
            TagAsBuilt { id: tag.id, size_m: tag.size_m, pose: PlainPose::of(&tag.base_from_tag.perturbed(&error)) }
        });
        let gripper_tag = robot.gripper_tag.map(|tag| {
            let (std_m, std_rad) = spec.tags.gripper_std();
            let error = normal_twist(seed, "as_built/gripper_tag", std_m, std_rad);
            PlainPose::of(&Pose::<Link, Tag>::from_isometry(tag.mount.link_from_frame).perturbed(&error))
        });
        Self {
            joints,
            gripper_tag,
            camera_mount: PlainPose::of(&link_from_camera),
            tags: tags.collect(),
            gauges: GaugesAsBuilt::draw(spec, seed),
            attitude: AttitudeAsBuilt::draw(spec, seed),
            lens: LensAsBuilt::draw(&robot.camera.lens, &spec.camera, seed),
            dome_center_m: camera::draw_dome_center(&spec.camera, seed),
        }
    }

    /// Where the camera truly hangs.
    pub(super) fn camera_attachment(&self, robot: &Robot) -> Attachment {
        let link_from_camera: Pose<Link, Camera> = self.camera_mount.to_pose();
        Attachment { n_joints: robot.camera.mount.n_joints, link_from_frame: *link_from_camera.isometry() }
    }

    /// Where the tag on the gripper truly is, on the link that carries it.
    pub(super) fn gripper_tag_attachment(&self, robot: &Robot) -> Option<Attachment> {
        let link_from_tag: Pose<Link, Tag> = self.gripper_tag?.to_pose();
        let n_joints = robot.gripper_tag?.mount.n_joints;
        Some(Attachment { n_joints, link_from_frame: *link_from_tag.isometry() })
    }
}

impl TagAsBuilt {
    #[must_use]
    pub fn base_from_tag(&self) -> Pose<Base, Tag> {
        self.pose.to_pose()
    }
}

impl PlainPose {
    fn of<A: Frame, B: Frame>(pose: &Pose<A, B>) -> Self {
        Self { position_m: pose.origin().to_array(), quaternion_wxyz: pose.quaternion_wxyz() }
    }

    /// The caller names the frames, as the file's key does. A quaternion without direction means no rotation.
    #[must_use]
    pub fn to_pose<A: Frame, B: Frame>(&self) -> Pose<A, B> {
        Pose::from_position_quaternion_wxyz(self.position_m, self.quaternion_wxyz)
            .unwrap_or_else(|| Pose::from_position_rpy(self.position_m, [0.0; 3]))
    }
}

/// A small random motion (translation m, rotation rad), independent per axis.
fn normal_twist(seed: u64, stream: &str, std_m: f64, std_rad: f64) -> Vector6<f64> {
    let mut rng = stream_rng(seed, stream);
    let mut draw = |std: f64| Vector3::from_fn(|_, _| std * Distribution::<f64>::sample(&StandardNormal, &mut rng));
    let (translation, rotation) = (draw(std_m), draw(std_rad));
    Vector6::new(translation.x, translation.y, translation.z, rotation.x, rotation.y, rotation.z)
}

#[cfg(test)]
mod tests;

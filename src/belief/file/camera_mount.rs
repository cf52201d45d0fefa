//! `[camera_mount]` and `[[further_camera]]` of calibration.toml.

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::file::constants::camera_mount::UNIT_LENGTH;
use crate::positions::mount_estimate::MountEstimate;
use armcal_core::robot::{FileIssue, Robot};
use armcal_core::spatial::{Camera, Link, Pose};

/// Camera mount, estimated from the tag on the gripper; the nominal mount if that tag was not used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraMount {
    /// Reason why the tag was not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
    /// Position of the camera on the link that carries it (`link_from_camera`), m.
    pub position_m: [f64; 3],
    /// Rotation of `link_from_camera`.
    pub quaternion_wxyz: [f64; 4],
    /// Standard deviation of the position along each axis of the camera, m.
    pub position_std_m: [f64; 3],
    /// Standard deviation of the rotation about each axis of the camera, rad.
    pub rotation_std_rad: [f64; 3],
    /// Number of views that showed the tag.
    pub views: usize,
    /// Root mean square reprojection error of the tag's corners; absent if the tag was not fitted separately.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
}

/// Mount of a further camera, estimated from the tags.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FurtherCamera {
    /// Name of the camera in robot.toml.
    pub name: String,
    /// Position of the camera on the link that carries it (`link_from_camera`), m.
    pub position_m: [f64; 3],
    /// Rotation of `link_from_camera`.
    pub quaternion_wxyz: [f64; 4],
    /// Standard deviation of the position along each axis of the camera, m.
    pub position_std_m: [f64; 3],
    /// Standard deviation of the rotation about each axis of the camera, rad.
    pub rotation_std_rad: [f64; 3],
    /// Number of the camera's views.
    pub views: usize,
}

/// Refuses a quaternion that is no rotation, and negative deviations, in the table of this name.
fn check_pose(
    file: &Path,
    table: &str,
    quaternion: &[f64; 4],
    deviations: [(&str, &[f64; 3]); 2],
) -> Result<(), FileIssue> {
    let length = quaternion.iter().map(|part| part * part).sum::<f64>().sqrt();
    FileIssue::check_range(file, &format!("{table}: quaternion_wxyz (length)"), length, UNIT_LENGTH)?;
    for (key, deviation) in deviations {
        if let Some(&negative) = deviation.iter().find(|std| **std < 0.0) {
            FileIssue::check_range(file, &format!("{table}: {key}"), negative, 0.0..=1e3)?;
        }
    }
    Ok(())
}

impl FurtherCamera {
    pub(crate) fn check(&self, file: &Path) -> Result<(), FileIssue> {
        let table = format!("further_camera `{}`", self.name);
        let deviations = [("position_std_m", &self.position_std_m), ("rotation_std_rad", &self.rotation_std_rad)];
        check_pose(file, &table, &self.quaternion_wxyz, deviations)
    }

    /// Returns the camera mount; `None` if the quaternion has no valid length.
    pub(crate) fn link_from_camera(&self) -> Option<Isometry3<f64>> {
        isometry(&self.position_m, &self.quaternion_wxyz)
    }
}

fn isometry(position_m: &[f64; 3], [w, x, y, z]: &[f64; 4]) -> Option<Isometry3<f64>> {
    let rotation = UnitQuaternion::try_new(Quaternion::new(*w, *x, *y, *z), 1e-6)?;
    Some(Isometry3::from_parts(Vector3::from(*position_m).into(), rotation))
}

impl CameraMount {
    pub(crate) fn check(&self, file: &Path) -> Result<(), FileIssue> {
        let deviations = [("position_std_m", &self.position_std_m), ("rotation_std_rad", &self.rotation_std_rad)];
        check_pose(file, "camera_mount", &self.quaternion_wxyz, deviations)
    }

    /// Returns the camera mount; `None` if the quaternion has no valid length.
    pub(crate) fn link_from_camera(&self) -> Option<Isometry3<f64>> {
        isometry(&self.position_m, &self.quaternion_wxyz)
    }

    /// Returns the mount of `robot`'s camera, which holds the estimate; `None` if the robot has no tag on the gripper.
    pub(crate) fn of(robot: &Robot, mount: &Result<Option<MountEstimate>, String>) -> Option<Self> {
        let camera = &robot.camera;
        let link_from_camera: Pose<Link, Camera> = Pose::from_isometry(camera.mount.link_from_frame);
        let drawn = Self {
            left_out: None,
            position_m: link_from_camera.origin().to_array(),
            quaternion_wxyz: link_from_camera.quaternion_wxyz(),
            position_std_m: [camera.mount_std_m; 3],
            rotation_std_rad: [camera.mount_std_rad; 3],
            views: 0,
            rms_px: None,
        };
        match mount {
            Ok(None) => None,
            Err(why) => Some(Self { left_out: Some(why.clone()), ..drawn }),
            Ok(Some(mount)) => {
                let std = |row: usize| mount.covariance[(row, row)].max(0.0).sqrt();
                Some(Self {
                    position_std_m: [0, 1, 2].map(std),
                    rotation_std_rad: [3, 4, 5].map(std),
                    views: mount.views,
                    rms_px: Some(mount.rms_px),
                    ..drawn
                })
            }
        }
    }
}

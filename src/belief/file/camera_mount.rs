//! `[camera_mount]` and `[[further_camera]]` of calibration.toml.

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::positions::mount_estimate::MountEstimate;
use armcal_core::robot::Robot;
use armcal_core::spatial::{Camera, Link, Pose};

/// Where the camera hangs, by the tag on the gripper; by the drawing where that was left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraMount {
    /// Why the tag was not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<String>,
    /// `link_from_camera` on the link that carries the camera.
    pub position_m: [f64; 3],
    /// Rotation of `link_from_camera`.
    pub quaternion_wxyz: [f64; 4],
    /// One sigma per axis of the camera.
    pub position_std_m: [f64; 3],
    /// One sigma about each axis of the camera.
    pub rotation_std_rad: [f64; 3],
    /// Views that showed the tag.
    pub views: usize,
    /// Of the tag's corners, root mean square distance in the image; absent where no fit of it alone was made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
}

/// Where a further camera hangs, by the tags.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FurtherCamera {
    /// Its name in robot.toml.
    pub name: String,
    /// `link_from_camera` on the link that carries the camera.
    pub position_m: [f64; 3],
    /// Rotation of `link_from_camera`.
    pub quaternion_wxyz: [f64; 4],
    /// One sigma per axis of the camera.
    pub position_std_m: [f64; 3],
    /// One sigma about each axis of the camera.
    pub rotation_std_rad: [f64; 3],
    /// Its views.
    pub views: usize,
}

impl FurtherCamera {
    /// `None` where the quaternion is none.
    pub(crate) fn link_from_camera(&self) -> Option<Isometry3<f64>> {
        isometry(&self.position_m, &self.quaternion_wxyz)
    }
}

fn isometry(position_m: &[f64; 3], [w, x, y, z]: &[f64; 4]) -> Option<Isometry3<f64>> {
    let rotation = UnitQuaternion::try_new(Quaternion::new(*w, *x, *y, *z), 1e-6)?;
    Some(Isometry3::from_parts(Vector3::from(*position_m).into(), rotation))
}

impl CameraMount {
    /// `None` where the quaternion is none.
    pub(crate) fn link_from_camera(&self) -> Option<Isometry3<f64>> {
        isometry(&self.position_m, &self.quaternion_wxyz)
    }

    /// Of `robot`, whose camera is where it was found to hang; `None` where no tag is on the gripper.
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

//! `[camera]` of robot.toml.

use std::path::Path;

use serde::Deserialize;

use super::error::{FileIssue, RobotError};
use crate::kinematics::Attachment;
use crate::optics::Fisheye;

/// The nominal camera.
#[derive(Clone, Debug)]
pub struct CameraSpec {
    /// Name of the camera's frame in recordings.
    pub name: String,
    /// Nominal `link_from_camera` on the link that carries it.
    pub mount: Attachment,
    /// Nominal lens.
    pub lens: Fisheye,
    /// One sigma of each coordinate of a detected corner.
    pub corner_std_px: f64,
    /// One sigma per axis of the mount's error.
    pub mount_std_m: f64,
    /// One sigma per axis of the mount's rotation error.
    pub mount_std_rad: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraFile {
    name: String,
    pub(super) link: String,
    model: String,
    resolution_px: [u32; 2],
    focal_px: [f64; 2],
    center_px: [f64; 2],
    distortion: [f64; 4],
    max_view_angle_rad: f64,
    corner_std_px: f64,
    mount_std_m: f64,
    mount_std_rad: f64,
}

pub(super) fn check_camera(file: &Path, raw: CameraFile, mount: Attachment) -> Result<CameraSpec, RobotError> {
    if raw.model != "equidistant" {
        let problem = format!("`{}` is not supported; use \"equidistant\" (Kannala-Brandt)", raw.model);
        return Err(FileIssue::new(file, "camera.model", problem).into());
    }
    let check = |key: &str, value: f64, range| FileIssue::check_range(file, &format!("camera.{key}"), value, range);
    for k in 0..2 {
        check("resolution_px", f64::from(raw.resolution_px[k]), 16.0..=65536.0)?;
        check("focal_px", raw.focal_px[k], 1.0..=1e6)?;
        check("center_px", raw.center_px[k], -1e6..=1e6)?;
    }
    for value in raw.distortion {
        check("distortion", value, -10.0..=10.0)?;
    }
    let max_view_angle_rad = check("max_view_angle_rad", raw.max_view_angle_rad, 0.1..=3.0)?;
    let lens = Fisheye {
        focal_px: raw.focal_px,
        center_px: raw.center_px,
        distortion: raw.distortion,
        resolution_px: raw.resolution_px,
        max_view_angle_rad,
    };
    if !lens.is_monotonic() {
        let problem =
            "the projected radius does not grow up to max_view_angle_rad; lower the angle or correct distortion";
        return Err(FileIssue::new(file, "camera.distortion", problem).into());
    }
    Ok(CameraSpec {
        name: raw.name,
        mount,
        lens,
        corner_std_px: check("corner_std_px", raw.corner_std_px, 1e-3..=100.0)?,
        mount_std_m: check("mount_std_m", raw.mount_std_m, 0.0..=1.0)?,
        mount_std_rad: check("mount_std_rad", raw.mount_std_rad, 0.0..=1.0)?,
    })
}

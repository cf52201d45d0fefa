//! Mount of a camera on its link.

use crate::model::blocks::value::pose_column;
use crate::model::blocks::{Std, Value, six};
use crate::model::scales::Hyperparameters;
use armcal_core::robot::{CameraSpec, Robot};

pub(super) fn drawn(robot: &Robot, camera: usize) -> Value {
    Value::Pose(robot.camera_at(camera).mount.link_from_frame)
}

pub(super) fn drawn_std(robot: &Robot, camera: usize, scales: &Hyperparameters) -> Std {
    let (spec, [shift, turn]) = (robot.camera_at(camera), scales.mount_scale[camera]);
    six(shift * spec.mount_std_m, turn * spec.mount_std_rad)
}

pub(super) fn name(robot: &Robot, camera: usize, column: usize) -> String {
    let axis = pose_column(column);
    match camera {
        0 => format!("camera mount {axis}"),
        _ => format!("mount of the camera {} {axis}", robot.camera_at(camera).name),
    }
}

/// Returns true if the nominal mount of a camera is not exact.
pub(super) fn is_loose(camera: &CameraSpec) -> bool {
    camera.mount_std_m > 0.0 || camera.mount_std_rad > 0.0
}

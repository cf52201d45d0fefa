//! A camera's intrinsics: focal lengths and centre px, then distortion.

use crate::model::blocks::{Std, Value};
use crate::model::scales::Hyperparameters;
use armcal_core::robot::{CameraSpec, LensPriors, Robot};

pub(super) fn drawn(robot: &Robot, camera: usize) -> Value {
    Value::Lens(robot.camera_at(camera).lens)
}

pub(super) fn drawn_std(robot: &Robot, camera: usize, scales: &Hyperparameters) -> Std {
    lens_std(robot.camera_at(camera)).map(|std| std * scales.lens_scale)
}

pub(super) fn name(robot: &Robot, camera: usize, column: usize) -> String {
    match camera {
        0 => format!("lens number {}", column + 1),
        _ => format!("lens number {} of the camera {}", column + 1, robot.camera_at(camera).name),
    }
}

/// Returns the standard deviation of each column as robot.toml states it.
fn lens_std(camera: &CameraSpec) -> Std {
    let LensPriors { focal_std, center_std_px, distortion_std } = camera.lens_priors;
    let [fx, fy] = camera.lens.focal_px().map(|px| px * focal_std);
    let [center, k] = [center_std_px, distortion_std];
    [fx, fy, center, center, k, k, k, k]
}

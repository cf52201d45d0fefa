//! The camera's mount as built.

use crate::as_built::pose::{PlainPose, normal_twist};
use crate::spec::CameraWorldSpec;
use armcal_core::robot::Robot;
use armcal_core::spatial::{Camera, Link, Pose};

/// Draws `link_from_camera`: the nominal mount with a random error of position and orientation.
pub(super) fn draw_camera_mount(robot: &Robot, spec: &CameraWorldSpec, seed: u64) -> PlainPose {
    let error = normal_twist(seed, "as_built/camera_mount", spec.mount_std_m, spec.mount_std_rad);
    PlainPose::of(&Pose::<Link, Camera>::from_isometry(robot.camera.mount.link_from_frame).perturbed(&error))
}

//! Pose of the tag on the gripper, on its link.

use nalgebra::Isometry3;

use crate::model::blocks::value::pose_column;
use crate::model::blocks::{MAX_COLUMNS, Std, Value, six};
use armcal_core::robot::Robot;

pub(super) fn drawn(robot: &Robot) -> Value {
    Value::Pose(robot.gripper_tag.map_or_else(Isometry3::identity, |tag| tag.mount.link_from_frame))
}

pub(super) fn drawn_std(robot: &Robot) -> Std {
    robot.gripper_tag.map_or([0.0; MAX_COLUMNS], |tag| six(tag.position_std_m, tag.rotation_std_rad))
}

pub(super) fn name(column: usize) -> String {
    format!("gripper tag {}", pose_column(column))
}

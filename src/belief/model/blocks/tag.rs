//! Pose of a tag that the views show.

use crate::model::blocks::value::pose_column;
use crate::model::blocks::{Std, Value, six};
use armcal_core::robot::Robot;

pub(super) fn drawn(robot: &Robot, tag: usize) -> Value {
    Value::Pose(*robot.tags[tag].base_from_tag.isometry())
}

pub(super) fn drawn_std(robot: &Robot, tag: usize) -> Std {
    six(robot.tags[tag].position_std_m, robot.tags[tag].rotation_std_rad)
}

pub(super) fn name(robot: &Robot, tag: usize, column: usize) -> String {
    format!("tag {} {}", robot.tags[tag].id, pose_column(column))
}

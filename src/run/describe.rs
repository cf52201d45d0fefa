//! Descriptions that viewers need to show the arm: its URDF with vehicle and tags, the camera's lens, the static
//! frames.

use crate::run::RunInputs;
use crate::run::scene::scene;
use armcal_core::log::ros::{CameraInfo, Header, SceneUpdate, StringMessage, TfMessage, Time, TransformStamped};
use armcal_core::log::{EncodeError, LogError, RecordingHeader, RecordingWriter, RosMessage, topics};
use armcal_core::robot::{Described, FrameTree, Robot};
use armcal_core::time::Stamp;

/// Writes the descriptions at `now`.
pub(super) fn describe(
    writer: &mut RecordingWriter,
    inputs: &RunInputs,
    tree: &FrameTree,
    now: Stamp,
) -> Result<(), LogError> {
    let robot = &inputs.robot;
    let Described { urdf, fixed } = Described::new(robot, &inputs.vehicle, tree);
    writer.write_ros(topics::ROBOT_DESCRIPTION, &StringMessage::SCHEMA, now, &StringMessage { data: urdf })?;
    writer.write_ros(topics::CAMERA_INFO, &CameraInfo::SCHEMA, now, &camera_info(robot))?;
    let transforms =
        fixed.iter().map(|frame| TransformStamped::new(now, [&frame.parent, &frame.child], &frame.parent_from_child));
    let transforms = transforms.collect::<Result<_, EncodeError>>();
    let transforms = transforms.map_err(|source| writer.encode_error(topics::TF_STATIC, source))?;
    writer.write_ros(topics::TF_STATIC, &TfMessage::SCHEMA, now, &TfMessage { transforms })?;
    let time = Time::try_from(now).map_err(|source| writer.encode_error(topics::SCENE, source))?;
    let task = &inputs.routine.task;
    let scene = scene(robot, &task.targets_m, task.tolerance_m, time);
    writer.write_ros(topics::SCENE, &SceneUpdate::SCHEMA, now, &scene)
}

fn camera_info(robot: &Robot) -> CameraInfo {
    let lens = &robot.camera.lens;
    let ([fx, fy], [cx, cy], [width, height]) = (lens.focal_px(), lens.center_px(), lens.resolution_px());
    CameraInfo {
        header: Header { frame_id: RecordingHeader::new(Vec::new()).camera_frame, ..Header::default() },
        width,
        height,
        distortion_model: lens.name().to_owned(),
        d: lens.distortion(),
        k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfo::default()
    }
}

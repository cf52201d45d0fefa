//! What viewers need to show the arm: its URDF, the camera's lens, and where the base is bolted on.

use crate::run::RunInputs;
use armcal_core::log::ros::{CameraInfo, Header, Quaternion, StringMessage, TfMessage, Transform, TransformStamped};
use armcal_core::log::{LogError, RecordingWriter, RosMessage, topics};
use armcal_core::robot::Robot;
use armcal_core::time::Stamp;

/// Writes the descriptions at `now`.
pub(super) fn describe(writer: &mut RecordingWriter, inputs: &RunInputs, now: Stamp) -> Result<(), LogError> {
    let robot = &inputs.robot;
    let urdf = StringMessage { data: robot.urdf_text.clone() };
    writer.write_ros(topics::ROBOT_DESCRIPTION, &StringMessage::SCHEMA, now, &urdf)?;
    writer.write_ros(topics::CAMERA_INFO, &CameraInfo::SCHEMA, now, &camera_info(robot))?;
    let pose = inputs.vehicle.vehicle_from_base;
    let transform = TransformStamped {
        header: Header { frame_id: "vehicle".to_owned(), ..Header::default() },
        child_frame_id: robot.base_link.clone(),
        transform: Transform {
            translation: pose.origin().to_array().into(),
            rotation: Quaternion::from_wxyz(pose.quaternion_wxyz()),
        },
    };
    writer.write_ros(topics::TF_STATIC, &TfMessage::SCHEMA, now, &TfMessage { transforms: vec![transform] })
}

fn camera_info(robot: &Robot) -> CameraInfo {
    let lens = &robot.camera.lens;
    let ([fx, fy], [cx, cy], [width, height]) = (lens.focal_px(), lens.center_px(), lens.resolution_px());
    CameraInfo {
        header: Header { frame_id: robot.camera.name.clone(), ..Header::default() },
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

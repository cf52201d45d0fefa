//! Exported files as read by Pinocchio and yourdfpy (tests/oracle/make_export_golden.py), compared with ours.

use armcal::sensor::ArmSensors;
use armcal::streams::JointCounts;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::{apart, arm_in, as_calibrated, calibration, exported, folder_with, frames};
use crate::support::{read, root, temp, titan};

#[derive(Deserialize)]
struct Golden {
    compared: usize,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    counts: Vec<f64>,
    joint_angles_rad: Vec<f64>,
    straight_angles_rad: Vec<f64>,
    tool_point_in_base_m: [f64; 3],
    base_from_camera: CameraPose,
}

#[derive(Deserialize)]
struct CameraPose {
    position_m: [f64; 3],
    rotation_matrix_rows: [[f64; 3]; 3],
}

impl CameraPose {
    fn isometry(&self) -> Isometry3<f64> {
        let rows = &self.rotation_matrix_rows;
        let turn = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, k| rows[i][k]));
        let place = Translation3::from(Vector3::from(self.position_m));
        Isometry3::from_parts(place, UnitQuaternion::from_rotation_matrix(&turn))
    }
}

fn golden() -> Golden {
    serde_json::from_str(&read(&root().join("tests/golden/export/poses.json"))).expect("the golden file")
}

/// Tolerance for the rounding errors of a chain of six joints.
const TOLERANCE: f64 = 1e-9;

#[test]
fn other_readers_of_the_exported_urdf_find_tool_and_camera_where_ours_do() {
    let folder = temp();
    folder_with(folder.path(), &exported("urdf"), "[tool]", "[tool]");
    let (read_back, calibrated) = (arm_in(folder.path()), as_calibrated(&titan(), &calibration()));
    let sensors = calibration().sensors(&titan()).expect("it fits");
    let golden = golden();
    assert_eq!((golden.cases.len(), golden.compared), (50, 1000));
    for case in &golden.cases {
        let angles = sensors.angles(&JointCounts::from_slice(&case.counts));
        for (ours, theirs) in angles.iter().zip(&case.joint_angles_rad) {
            assert!((ours - theirs).abs() < TOLERANCE, "{ours} {theirs}");
        }
        for robot in [&read_back, &calibrated] {
            let [tool, camera] = frames(robot, &angles);
            let off_m = (tool.translation.vector - Vector3::from(case.tool_point_in_base_m)).norm();
            let (camera_m, camera_rad) = apart(&camera, &case.base_from_camera.isometry());
            assert!(off_m.max(camera_m).max(camera_rad) < TOLERANCE, "{off_m} {camera_m} {camera_rad}");
        }
    }
}

/// The texts between `open` and the next `<`.
fn values(text: &str, open: &str) -> Vec<f64> {
    let parts = text.split(open).skip(1).filter_map(|part| part.split('<').next());
    parts.map(|value| value.parse().expect("a number")).collect()
}

/// From the datasheet's angle, `SimpleTransmission` computes gain and offset; only the terms are missing.
#[test]
fn transmissions_make_the_angle_without_terms() {
    let text = exported("ros2-control");
    let (reduction, offset) = (values(&text, "<mechanical_reduction>"), values(&text, "<offset>"));
    assert_eq!((reduction.len(), offset.len()), (6, 6));
    let datasheet = ArmSensors::nominal(&titan());
    let mut largest_rad = 0.0_f64;
    for case in &golden().cases {
        let actuators = datasheet.angles(&JointCounts::from_slice(&case.counts));
        for joint in 0..6 {
            let angle = actuators[joint] / reduction[joint] + offset[joint];
            assert!((angle - case.straight_angles_rad[joint]).abs() < TOLERANCE, "{joint}");
            largest_rad = largest_rad.max((angle - case.joint_angles_rad[joint]).abs());
        }
    }
    assert!(largest_rad > 1e-3, "these sensors have terms: {largest_rad}");
}

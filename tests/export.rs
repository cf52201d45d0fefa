//! `armcal export` in the forms of drivers: other programs read the arm as calibrated.

mod data_forms;
mod driver_forms;
mod golden;
mod lerobot;
mod link_poses;

use std::path::{Path, PathBuf};

use armcal::calib::Calibration;
use armcal::robot::{Robot, load_without_pairs};
use armcal::streams::JointAngles;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::support::{Answer, answer, program, read, robot_folder, root, write};

/// Calibration of the quickstart, with link corrections.
fn calibration_file() -> PathBuf {
    root().join("tests/golden/export/calibration.toml")
}

fn calibration() -> Calibration {
    Calibration::parse(&calibration_file(), &read(&calibration_file())).expect("it reads")
}

fn export(file: &Path, robot: Option<&Path>, form: &str) -> Answer {
    let mut command = program();
    command.arg("export").arg(file).args(["--as", form]);
    if let Some(robot) = robot {
        command.arg("--robot").arg(robot);
    }
    answer(&mut command)
}

/// Output of `export` for the Titan 4.
#[track_caller]
fn exported(form: &str) -> String {
    let told = export(&calibration_file(), Some(&robot_folder()), form);
    told.expect(form, 0, &[]);
    told.stdout
}

/// A robot folder like the Titan 4's with this URDF, and `from` in robot.toml replaced by `to`.
fn folder_with(folder: &Path, urdf: &str, from: &str, to: &str) {
    let robot = read(&robot_folder().join("robot.toml"));
    assert!(robot.contains(from), "{from}");
    write(&folder.join("robot.toml"), &robot.replace(from, to));
    write(&folder.join("titan4.urdf"), urdf);
}

fn arm_in(folder: &Path) -> Robot {
    load_without_pairs(folder).expect("the robot reads")
}

/// Poses `base_from_tool` and `base_from_camera` of `robot`.
fn frames(robot: &Robot, angles: &JointAngles) -> [Isometry3<f64>; 2] {
    [&robot.tool.mount, &robot.camera.mount].map(|mount| robot.chain.frame(angles, mount))
}

/// The robot with links and camera as calibrated, computed only by the library.
fn as_calibrated(robot: &Robot, calibration: &Calibration) -> Robot {
    let mut calibrated = calibration.scaled_robot(robot);
    let mount = calibration.camera_mount.as_ref().expect("a mount");
    let [w, x, y, z] = mount.quaternion_wxyz;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let place = Translation3::from(Vector3::from(mount.position_m));
    calibrated.camera.mount.link_from_frame = Isometry3::from_parts(place, rotation);
    calibrated
}

/// Distance (m) and turn (rad) between two poses.
fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    ((a.translation.vector - b.translation.vector).norm(), a.rotation.angle_to(&b.rotation))
}

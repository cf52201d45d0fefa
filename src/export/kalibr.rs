//! The camera as Kalibr's camchain.yaml, with its calibrated mount.
//!
//! `T_cn_cnm1` maps the frame of the previous camera to that of this camera: ethz-asl/kalibr 1f60227,
//! kalibr_common/ConfigReader.py, lines 675 to 704.

use armcal_core::codes::Code;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::Isometry3;

use crate::export::urdf::{carrier, further_from_camera, link_from_camera};
use crate::export::yaml_text::{doubles, quoted};
use armcal_belief::calib::Calibration;
use armcal_core::optics::LensModel;
use armcal_core::robot::{CameraSpec, FileIssue, Robot};

const HEAD: &str = "\
# The cameras of a robot calibrated by armcal: cam0 is [camera] of robot.toml, then each [[further_camera]] with a lens.
# Lens: as found, or else robot.toml's. T_link_camera: 4 x 4, maps the camera's optical frame to the frame of
# `link`; both keys are armcal's own, and Kalibr does not read them.
# Kalibr's own tools want `rostopic`, the topic of the images, as well.
";

/// Writes camchain.yaml with `cam0` and following: lens and `T_link_camera` of the calibration, or of robot.toml where
/// it has none. `T_cn_cnm1` is written between cameras of one link. Messages name `file`, the calibration's.
///
/// # Errors
/// [`FileIssue`]: a mount out of range, or a lens that Kalibr has no model for.
pub fn camchain(file: &Path, calibration: &Calibration, robot: &Robot) -> Result<String, FileIssue> {
    let robot = &calibration.with_lenses(robot);
    let mount = calibration.camera_mount.as_ref();
    let place = mount.map(|mount| link_from_camera(file, mount)).transpose()?;
    let mut last = (robot.camera.mount.n_joints, place.unwrap_or(robot.camera.mount.link_from_frame));
    let mut text = format!("{HEAD}{}", entry(robot, (0, "camera"), &robot.camera, &last.1)?);
    let with_lens = robot.further_cameras.iter().enumerate().filter(|(_, camera)| camera.lens.is_known());
    for (number, (at, camera)) in with_lens.enumerate() {
        let found = calibration.further_camera.iter().find(|found| found.name == camera.name);
        let place = found.map(|found| further_from_camera(file, found)).transpose()?;
        let place = place.unwrap_or(camera.mount.link_from_frame);
        text += &entry(robot, (number + 1, &format!("further_camera[{}]", at + 1)), camera, &place)?;
        // `T_cn_cnm1` between cameras on two links is not constant.
        if camera.mount.n_joints == last.0 {
            text += &matrix("T_cn_cnm1", &(place.inverse() * last.1));
        }
        last = (camera.mount.n_joints, place);
    }
    Ok(text)
}

/// Entry `cam` of that number: the camera that robot.toml has as `key`, with its pose `place` on its link.
fn entry(
    robot: &Robot,
    (number, key): (usize, &str),
    camera: &CameraSpec,
    place: &Isometry3<f64>,
) -> Result<String, FileIssue> {
    let robot_file = robot.folder.join("robot.toml");
    if camera.lens.port.is_some() {
        let problem = "is a flat window, which Kalibr has no model for";
        return Err(FileIssue::new(Code::ValueInvalid, &robot_file, format!("{key}.port"), problem));
    }
    let (model, coefficients) = match camera.lens.lens {
        LensModel::Equidistant(lens) => ("equidistant", lens.distortion),
        LensModel::Radtan(lens) => {
            let [k1, k2, p1, p2, k3] = lens.distortion;
            if k3 != 0.0 {
                let problem = format!("has k3 = {k3}, which Kalibr's radtan lacks; 0 is allowed");
                return Err(FileIssue::new(Code::ValueInvalid, &robot_file, format!("{key}.distortion"), problem));
            }
            ("radtan", [k1, k2, p1, p2])
        }
        LensModel::Unknown(_) => {
            let problem =
                "has no lens, which a camchain describes: add model, resolution_px, focal_px, center_px, distortion";
            return Err(FileIssue::new(Code::KeyMissing, &robot_file, format!("[{key}]"), problem));
        }
    };
    let ([fx, fy], [cx, cy]) = (camera.lens.focal_px(), camera.lens.center_px());
    let intrinsics = doubles([fx, fy, cx, cy]);
    let mut text = format!("cam{number}:\n  camera_model: pinhole\n  intrinsics: {intrinsics}\n");
    let _ = write!(text, "  distortion_model: {model}\n  distortion_coeffs: {}\n", doubles(coefficients));
    let _ = writeln!(text, "  resolution: {:?}", camera.lens.resolution_px());
    let _ = writeln!(text, "  link: {}", quoted(carrier(robot, camera)));
    Ok(text + &matrix("T_link_camera", place))
}

fn matrix(key: &str, pose: &Isometry3<f64>) -> String {
    let pose = pose.to_homogeneous();
    let row = |row: usize| format!("  - {}\n", doubles([0, 1, 2, 3].map(|column| pose[(row, column)])));
    format!("  {key}:\n{}", [0, 1, 2, 3].map(row).concat())
}

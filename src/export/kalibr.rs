//! The camera as Kalibr's camchain.yaml, with the place that the calibration found for it.

use std::fmt::Write as _;
use std::path::Path;

use crate::export::urdf::link_from_camera;
use crate::export::yaml_text::{doubles, quoted};
use armcal_belief::calib::Calibration;
use armcal_core::optics::LensModel;
use armcal_core::robot::{FileIssue, Robot};

const HEAD: &str = "\
# The wrist camera of a robot calibrated by armcal. Lens: robot.toml's; armcal does not change it. T_link_camera: 4 x 4,
# maps the camera's optical frame to the frame of `link`; both keys are armcal's own, and Kalibr does not read them.
# Kalibr's own tools want `rostopic`, the topic of the images, as well.
";

/// camchain.yaml with `cam0`: model, intrinsics and distortion of robot.toml, `T_link_camera` of the calibration, or of
/// the drawing where that has none. `file` is that of the calibration, for messages.
///
/// # Errors
/// [`FileIssue`]: a mount out of range, or a lens that Kalibr has no model for.
pub fn camchain(file: &Path, calibration: &Calibration, robot: &Robot) -> Result<String, FileIssue> {
    let camera = &robot.camera;
    let robot_file = robot.folder.join("robot.toml");
    if camera.lens.port.is_some() {
        let problem = "is a flat window, which Kalibr has no model for";
        return Err(FileIssue::new(&robot_file, "camera.port", problem));
    }
    let (model, coefficients) = match camera.lens.lens {
        LensModel::Equidistant(lens) => ("equidistant", lens.distortion),
        LensModel::Radtan(lens) => {
            let [k1, k2, p1, p2, k3] = lens.distortion;
            if k3 != 0.0 {
                let problem = format!("has k3 = {k3}, which Kalibr's radtan lacks; 0 is allowed");
                return Err(FileIssue::new(&robot_file, "camera.distortion", problem));
            }
            ("radtan", [k1, k2, p1, p2])
        }
        LensModel::Unknown(_) => {
            let problem =
                "has no lens, which a camchain describes: add model, resolution_px, focal_px, center_px, distortion";
            return Err(FileIssue::new(&robot_file, "[camera]", problem));
        }
    };
    let drawn = camera.mount.link_from_frame;
    let mount = calibration.camera_mount.as_ref();
    let pose = mount.map_or(Ok(drawn), |mount| link_from_camera(file, mount))?.to_homogeneous();
    let body = camera.mount.n_joints.checked_sub(1).and_then(|joint| robot.chain.joints().get(joint));
    let link = body.map_or(robot.base_link.as_str(), |joint| joint.child_link.as_str());
    let ([fx, fy], [cx, cy]) = (camera.lens.focal_px(), camera.lens.center_px());
    let mut text = format!("{HEAD}cam0:\n  camera_model: pinhole\n  intrinsics: {}\n", doubles([fx, fy, cx, cy]));
    let _ = write!(text, "  distortion_model: {model}\n  distortion_coeffs: {}\n", doubles(coefficients));
    let _ = writeln!(text, "  resolution: {:?}", camera.lens.resolution_px());
    let _ = write!(text, "  link: {}\n  T_link_camera:\n", quoted(link));
    for row in 0..4 {
        let _ = writeln!(text, "  - {}", doubles([0, 1, 2, 3].map(|column| pose[(row, column)])));
    }
    Ok(text)
}

//! Camera files: cameras.yaml of TagSLAM, camchain.yaml of Kalibr, and that of ROS (camera_calibration).

use armcal_core::codes::Code;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde::Deserialize;

use crate::tagmap::files::yaml;
use armcal_core::input::lens_of_camera_info;
use armcal_core::log::ros::CameraInfo;
use armcal_core::optics::{CameraModel, Fisheye, LensModel, Radtan, check_image_size};
use armcal_core::robot::{FileIssue, RobotError, read_text};

/// A camera as files describe it.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// Key of the camera in the file, such as `cam0`.
    pub name: String,
    /// Lens and resolution.
    pub model: CameraModel,
    /// Topic of the camera's images.
    pub image_topic: Option<String>,
    /// Topic of the tags detected in the images.
    pub tag_topic: Option<String>,
}

#[derive(Debug, Deserialize)]
struct CameraYaml {
    camera_model: String,
    intrinsics: Vec<f64>,
    distortion_model: String,
    #[serde(default)]
    distortion_coeffs: Vec<f64>,
    resolution: Vec<u32>,
    rostopic: Option<String>,
    tagtopic: Option<String>,
}

/// Camera file of ROS, written by `camera_calibration` and `camera_info_manager`. OpenCV's samples/cpp/calibration.cpp
/// writes the same keys without the model.
#[derive(Debug, Deserialize)]
struct RosCameraYaml {
    image_width: Option<u32>,
    image_height: Option<u32>,
    #[serde(default)]
    camera_name: String,
    camera_matrix: RosMatrix,
    distortion_model: Option<String>,
    distortion_coefficients: RosMatrix,
}

#[derive(Debug, Deserialize)]
struct RosMatrix {
    data: Vec<f64>,
}

const SUPPORTED: &str = "equidistant (fisheye), radtan (plumb_bob), none";

/// Reads all cameras of a file, in the order of their names.
///
/// # Errors
/// [`RobotError`] with file, key and what is supported or allowed.
pub fn read_cameras(file: &Path) -> Result<Vec<NamedCamera>, RobotError> {
    parse_cameras(file, &read_text(file)?)
}

/// Parses all cameras of a text; `file` names it in errors.
///
/// # Errors
/// Fails as [`read_cameras`] does.
pub fn parse_cameras(file: &Path, text: &str) -> Result<Vec<NamedCamera>, RobotError> {
    if text.lines().any(|line| line.starts_with("camera_matrix:")) {
        return Ok(vec![ros_camera(file, yaml::parse(file, text)?)?]);
    }
    let raw: BTreeMap<String, CameraYaml> = yaml::parse(file, text)?;
    if raw.is_empty() {
        return Err(FileIssue::new(Code::KeyMissing, file, "cam0", "the file names no camera").into());
    }
    let mut cameras: Vec<NamedCamera> =
        raw.iter().map(|(name, raw)| camera(file, name, raw)).collect::<Result<_, _>>()?;
    // The order has cam10 after cam9.
    cameras.sort_by_key(|camera| (camera.name.len(), camera.name.clone()));
    Ok(cameras)
}

/// Converts the camera as if its lens were stated in a message.
fn ros_camera(file: &Path, raw: RosCameraYaml) -> Result<NamedCamera, RobotError> {
    let issue = |key: &str, problem: String| FileIssue::new(Code::ValueInvalid, file, key, problem);
    let n = raw.camera_matrix.data.len();
    let k = raw.camera_matrix.data.try_into();
    let k = k.map_err(|_| issue("camera_matrix.data", format!("has {n} numbers, needs 9: row by row")))?;
    let missing = |key: &str, what: &str| {
        RobotError::from(FileIssue::new(Code::KeyMissing, file, key, format!("is missing; add the line {key}: {what}")))
    };
    let size = |key, side: Option<u32>| side.ok_or_else(|| missing(key, "the image's size, px"));
    // Only OpenCV's own model has five coefficients; a fisheye has four, too.
    let usual = (raw.distortion_coefficients.data.len() == 5).then(|| "plumb_bob".to_owned());
    let model = raw.distortion_model.or(usual);
    let info = CameraInfo {
        width: size("image_width", raw.image_width)?,
        height: size("image_height", raw.image_height)?,
        distortion_model: model.ok_or_else(|| missing("distortion_model", "plumb_bob, or equidistant"))?,
        d: raw.distortion_coefficients.data,
        k,
        ..CameraInfo::default()
    };
    let model = lens_of_camera_info(&info).map_err(|problem| issue("camera_matrix", problem))?;
    let name = if raw.camera_name.is_empty() { "camera".to_owned() } else { raw.camera_name };
    Ok(NamedCamera { name, model, image_topic: None, tag_topic: None })
}

fn camera(file: &Path, name: &str, raw: &CameraYaml) -> Result<NamedCamera, RobotError> {
    let key = |of: &str| format!("{name}.{of}");
    let issue =
        |of: &str, problem: String| RobotError::from(FileIssue::new(Code::ValueInvalid, file, key(of), problem));
    if raw.camera_model != "pinhole" {
        let problem =
            format!("`{}` is not supported; use pinhole, with distortion_model: {SUPPORTED}", raw.camera_model);
        return Err(issue("camera_model", problem));
    }
    let [fx, fy, cx, cy] = raw.intrinsics[..] else {
        return Err(issue("intrinsics", format!("has {} numbers, needs 4: fx, fy, cx, cy (px)", raw.intrinsics.len())));
    };
    let [width, height] = raw.resolution[..] else {
        return Err(issue("resolution", format!("has {} numbers, needs 2: width, height", raw.resolution.len())));
    };
    let check = |of: &str, value: f64, range| FileIssue::check_range(file, &key(of), value, range);
    for f in [fx, fy] {
        check("intrinsics", f, 1.0..=1e6)?;
    }
    for c in [cx, cy] {
        check("intrinsics", c, -1e6..=1e6)?;
    }
    check_image_size([width, height]).map_err(|problem| issue("resolution", format!("is {problem}")))?;
    for k in &raw.distortion_coeffs {
        check("distortion_coeffs", *k, -100.0..=100.0)?;
    }
    let (focal, center, resolution) = ([fx, fy], [cx, cy], [width, height]);
    let model = match (raw.distortion_model.as_str(), &raw.distortion_coeffs[..]) {
        ("equidistant" | "fisheye", &[k1, k2, k3, k4]) => {
            CameraModel::from(Fisheye::with_widest_view(focal, center, [k1, k2, k3, k4], resolution))
        }
        ("radtan" | "plumb_bob", &[k1, k2, p1, p2]) => {
            CameraModel::from(Radtan::new(focal, center, [k1, k2, p1, p2, 0.0], resolution))
        }
        ("radtan" | "plumb_bob", &[k1, k2, p1, p2, k3]) => {
            CameraModel::from(Radtan::new(focal, center, [k1, k2, p1, p2, k3], resolution))
        }
        ("none", coefficients) if coefficients.iter().all(|k| *k == 0.0) => {
            CameraModel::from(Radtan::new(focal, center, [0.0; 5], resolution))
        }
        ("none", _) => {
            return Err(issue("distortion_coeffs", "must be empty or zero where the model is none".to_owned()));
        }
        ("equidistant" | "fisheye" | "radtan" | "plumb_bob", coefficients) => {
            let needs = if raw.distortion_model.starts_with('r') || raw.distortion_model.starts_with('p') {
                "4 or 5: k1, k2, p1, p2 and k3"
            } else {
                "4: k1 to k4"
            };
            return Err(issue("distortion_coeffs", format!("has {} numbers, needs {needs}", coefficients.len())));
        }
        (other, _) => return Err(issue("distortion_model", format!("`{other}` is not supported; use {SUPPORTED}"))),
    };
    Ok(NamedCamera { name: name.to_owned(), model, image_topic: raw.rostopic.clone(), tag_topic: raw.tagtopic.clone() })
}

/// Formats the cameras as cameras.yaml, which Kalibr also reads.
#[must_use]
pub fn cameras_to_yaml(cameras: &[NamedCamera]) -> String {
    let mut out = String::new();
    for camera in cameras {
        let (model, coefficients) = match camera.model.lens {
            LensModel::Equidistant(lens) => ("equidistant", lens.distortion.to_vec()),
            LensModel::Radtan(lens) => ("radtan", lens.distortion.to_vec()),
            LensModel::Unknown(_) => continue,
        };
        let ([fx, fy], [cx, cy]) = (camera.model.focal_px(), camera.model.center_px());
        let _ = writeln!(out, "{}:\n  camera_model: pinhole", camera.name);
        let _ = writeln!(out, "  intrinsics: {:?}", [fx, fy, cx, cy]);
        let _ = writeln!(out, "  distortion_model: {model}\n  distortion_coeffs: {coefficients:?}");
        let _ = writeln!(out, "  resolution: {:?}", camera.model.resolution_px());
        for (key, topic) in [("rostopic", &camera.image_topic), ("tagtopic", &camera.tag_topic)] {
            if let Some(topic) = topic {
                let _ = writeln!(out, "  {key}: {topic}");
            }
        }
    }
    out
}

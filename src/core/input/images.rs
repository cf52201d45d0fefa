//! Images of a recording whose tags nobody has looked for yet; who finds them is not known here.

use std::path::Path;

use super::error::InputError;
use crate::log::ros::{CameraInfo, CompressedImage, Image};
use crate::log::{CdrError, RawMessage, decode, for_each_raw};
use crate::optics::{CameraModel, Fisheye, Radtan, TagFamily};

/// One image as recorded.
#[derive(Clone, Debug, PartialEq)]
pub enum RecordedImage {
    /// Pixels.
    Raw(Image),
    /// A PNG or JPEG file.
    Compressed(CompressedImage),
}

/// Number and corners of a tag, raw pixels: bottom left, bottom right, top right, top left as printed.
pub type TagCorners = (u32, [[f64; 2]; 4]);

/// Why an image has no tags.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ImageProblem {
    /// It is damaged; others may not be.
    Damaged,
    /// None of its kind can be used; the end of a sentence about the image.
    Unusable(String),
}

/// Finds tags in images.
pub trait ImageDetector {
    /// The family of tags that it knows.
    fn family(&self) -> TagFamily;

    /// The tags of one image of the robot's camera of that number.
    ///
    /// # Errors
    /// [`ImageProblem`].
    fn detect(&mut self, camera: usize, image: &RecordedImage) -> Result<Vec<TagCorners>, ImageProblem>;
}

/// Names of the types that hold images.
pub(super) const IMAGE_TYPES: [&str; 2] = ["Image", "CompressedImage"];

impl RecordedImage {
    /// Decodes a message of one of [`IMAGE_TYPES`].
    pub(super) fn of(raw: &RawMessage<'_>) -> Result<Self, CdrError> {
        if raw.schema_name().ends_with("/CompressedImage") {
            decode(raw.data).map(Self::Compressed)
        } else {
            decode(raw.data).map(Self::Raw)
        }
    }
}

/// The lens by the first `sensor_msgs/msg/CameraInfo` on `topic`.
///
/// # Errors
/// [`InputError`] where there is none, or its lens is of no model that is supported.
pub fn read_camera_info(path: &Path, topic: &str) -> Result<CameraModel, InputError> {
    let file = path.display().to_string();
    let mut found: Option<Result<CameraInfo, CdrError>> = None;
    for_each_raw(path, |raw| {
        if raw.topic() == topic && found.is_none() {
            found = Some(decode(raw.data));
        }
    })?;
    let issue = |problem: String| InputError::CameraInfo { file: file.clone(), topic: topic.to_owned(), problem };
    match found {
        None => Err(issue("has no message".to_owned())),
        Some(Err(error)) => Err(issue(format!("cannot be decoded: {error}"))),
        Some(Ok(info)) => lens(&info).map_err(issue),
    }
}

/// The lens of a `CameraInfo`; the error is the end of a sentence about it.
pub(super) fn lens(info: &CameraInfo) -> Result<CameraModel, String> {
    const ALLOWED: &str = "armcal knows \"plumb_bob\" and \"rational_polynomial\" without its last three coefficients, \
        and \"equidistant\"; give another lens in robot.toml";
    let (focal_px, center_px) = ([info.k[0], info.k[4]], [info.k[2], info.k[5]]);
    let resolution_px = [info.width, info.height];
    if !resolution_px.iter().all(|n| (16..=65536).contains(n)) {
        return Err(format!("has {} x {} pixels; 16 .. 65536 are allowed", info.width, info.height));
    }
    if !focal_px.iter().all(|f| (1.0..=1e6).contains(f)) || !center_px.iter().all(|c| c.abs() <= 1e6) {
        return Err(format!("has no calibration: focal lengths {focal_px:?} px, centre {center_px:?} px"));
    }
    if !info.d.iter().all(|d| d.abs() <= 10.0) {
        return Err(format!("has the distortion {:?}; -10 .. 10 are allowed", info.d));
    }
    if info.binning_x > 1 || info.binning_y > 1 || info.roi.x_offset > 0 || info.roi.y_offset > 0 {
        return Err("is of a part of the image, or a binned one; give the lens in robot.toml".to_owned());
    }
    match (info.distortion_model.as_str(), &info.d[..]) {
        ("equidistant" | "fisheye", &[k1, k2, k3, k4]) => {
            Ok(Fisheye::with_widest_view(focal_px, center_px, [k1, k2, k3, k4], resolution_px).into())
        }
        ("plumb_bob", d) if matches!(d.len(), 0 | 4 | 5) => Ok(radtan(focal_px, center_px, d, resolution_px)),
        ("rational_polynomial", d) if d.len() >= 8 && d[5..].iter().all(|k| *k == 0.0) => {
            Ok(radtan(focal_px, center_px, &d[..5], resolution_px))
        }
        (model, d) => Err(format!("has the model {model:?} with {} coefficients; {ALLOWED}", d.len())),
    }
}

fn radtan(focal_px: [f64; 2], center_px: [f64; 2], d: &[f64], resolution_px: [u32; 2]) -> CameraModel {
    let distortion = std::array::from_fn(|at| d.get(at).copied().unwrap_or(0.0));
    Radtan::new(focal_px, center_px, distortion, resolution_px).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::LensModel;

    fn info(model: &str, d: &[f64]) -> CameraInfo {
        CameraInfo {
            width: 640,
            height: 480,
            distortion_model: model.into(),
            d: d.to_vec(),
            k: [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        }
    }

    #[test]
    fn lenses_of_ros_become_those_of_the_same_equations() {
        let LensModel::Radtan(pinhole) = lens(&info("plumb_bob", &[0.1, -0.2, 0.01, 0.02, 0.3])).expect("known").lens
        else {
            panic!("a pinhole")
        };
        assert_eq!((pinhole.focal_px, pinhole.center_px), ([500.0, 510.0], [320.0, 240.0]));
        assert_eq!((pinhole.distortion, pinhole.resolution_px), ([0.1, -0.2, 0.01, 0.02, 0.3], [640, 480]));
        let rational = lens(&info("rational_polynomial", &[0.1, -0.2, 0.01, 0.02, 0.3, 0.0, 0.0, 0.0]));
        assert_eq!(rational.expect("known").lens, LensModel::Radtan(pinhole));
        let LensModel::Equidistant(fisheye) = lens(&info("equidistant", &[0.01, 0.0, 0.0, 0.0])).expect("known").lens
        else {
            panic!("a fisheye")
        };
        assert!(fisheye.distortion == [0.01, 0.0, 0.0, 0.0] && fisheye.max_view_angle_rad > 0.5);
    }

    #[test]
    fn lenses_that_are_not_known_are_named() {
        let uncalibrated = CameraInfo { k: [0.0; 9], ..info("plumb_bob", &[]) };
        let binned = CameraInfo { binning_x: 2, ..info("plumb_bob", &[]) };
        let faults = [
            info("rational_polynomial", &[0.1, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0]),
            info("plumb_bob", &[0.0; 3]),
            info("equidistant", &[f64::NAN; 4]),
            CameraInfo { width: 0, ..info("plumb_bob", &[]) },
            uncalibrated,
            binned,
        ];
        insta::assert_snapshot!("camera_info", faults.map(|info| lens(&info).expect_err("refused")).join("\n"));
    }
}

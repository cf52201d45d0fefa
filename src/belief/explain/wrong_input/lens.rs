//! Possible lenses other than robot.toml's: of another image size, focal length or model, or without distortion.

use super::SIZE_TOLERANCE;
use crate::explain::constants::wrong_input_lens::{FISHEYE_RAD, FOCAL_STEP, FOCAL_STEPS, IMAGE_SCALES};
use crate::say::wrong_input::WrongInputKind;
use armcal_core::optics::{CameraModel, Fisheye, LensModel, Radtan};

/// Possible meanings of the stated lens.
pub(crate) fn readings(lens: &CameraModel) -> Vec<(WrongInputKind, CameraModel)> {
    let sizes = IMAGE_SCALES.map(|scale| (WrongInputKind::ImageScale(scale), scaled(lens, 1.0 / scale)));
    let models =
        [(WrongInputKind::LensModel, of_other_model(lens)), (WrongInputKind::Distortion, without_distortion(lens))];
    let steps = (-FOCAL_STEPS..=FOCAL_STEPS).map(|k| (f64::from(k) * FOCAL_STEP).exp());
    let steps = steps.filter(|ratio| (ratio - 1.0).abs() > SIZE_TOLERANCE);
    let focal = steps.map(|ratio| (WrongInputKind::FocalLength(ratio), of_focal_length(lens, ratio)));
    sizes.into_iter().chain(models).chain(focal).collect()
}

/// The lens of an image of `scale` times the size.
pub(crate) fn scaled(lens: &CameraModel, scale: f64) -> CameraModel {
    let [fx, fy, cx, cy, k @ ..] = lens.intrinsics();
    let [a, b, c, d] = k;
    lens.with_intrinsics([fx * scale, fy * scale, cx * scale, cy * scale, a, b, c, d])
}

/// The lens with `ratio` times its focal length.
fn of_focal_length(lens: &CameraModel, ratio: f64) -> CameraModel {
    let [fx, fy, rest @ ..] = lens.intrinsics();
    let [cx, cy, a, b, c, d] = rest;
    lens.with_intrinsics([fx * ratio, fy * ratio, cx, cy, a, b, c, d])
}

/// The lens with only its stated focal length and centre.
fn without_distortion(lens: &CameraModel) -> CameraModel {
    let [fx, fy, cx, cy, ..] = lens.intrinsics();
    lens.with_intrinsics([fx, fy, cx, cy, 0.0, 0.0, 0.0, 0.0])
}

/// Lens of the other model with the same focal length and centre, without distortion: a fisheye for a pinhole, and the
/// reverse.
pub(crate) fn of_other_model(lens: &CameraModel) -> CameraModel {
    let (focal_px, center_px, resolution_px) = (lens.focal_px(), lens.center_px(), lens.resolution_px());
    let other: CameraModel = match lens.lens {
        LensModel::Radtan(_) => {
            Fisheye { focal_px, center_px, distortion: [0.0; 4], resolution_px, max_view_angle_rad: FISHEYE_RAD }.into()
        }
        _ => Radtan::new(focal_px, center_px, [0.0; 5], resolution_px).into(),
    };
    CameraModel { port: lens.port, ..other }
}

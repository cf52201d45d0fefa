//! The four corners of a tag.

use nalgebra::Isometry3;

use crate::measure::information::{LensInformation, PoseInformation, TwistSums};
use crate::measure::projection::ImagePoint;
use armcal_core::optics::CameraModel;
use armcal_core::spatial::adjoint;

/// Corner pixels and the inverse of their variance.
#[derive(Clone, Debug)]
pub(crate) struct WeightedCorners {
    pub corners_px: [[f64; 2]; 4],
    pub half_size_m: f64,
    /// Inverse of a pixel's variance, px^-2.
    pub info: f64,
    pub used: [bool; 4],
}

/// Returns the information of the corners, with `info` instead of their own weight.
pub(super) fn information(
    seen: &WeightedCorners,
    camera_from_tag: &Isometry3<f64>,
    lens: &CameraModel,
    (info, mut by_lens): (f64, Option<&mut LensInformation>),
) -> Option<PoseInformation> {
    let rotation = *camera_from_tag.rotation.to_rotation_matrix().matrix();
    let center = camera_from_tag.translation.vector;
    let (x, y) = (rotation.column(0) * seen.half_size_m, rotation.column(1) * seen.half_size_m);
    let points = [center - x - y, center + x - y, center + x + y, center - x + y];
    let mut projected = [None; 4];
    for (out, point) in projected.iter_mut().zip(&points) {
        *out = Some(ImagePoint::of(lens, point)?);
    }
    let mut sums = TwistSums::default();
    let (mut chi2, mut corner_chi2) = (0.0, [0.0; 4]);
    let corners = points.iter().zip(&seen.corners_px).zip(projected.iter().flatten());
    for (corner, ((point, measured), image)) in corners.enumerate() {
        let residual = image.residual_px(measured);
        corner_chi2[corner] = info * (residual[0] * residual[0] + residual[1] * residual[1]);
        if !seen.used[corner] {
            continue;
        }
        for (row, &r) in image.by_twist.iter().zip(&residual) {
            chi2 += r * r;
            sums.add(row, r, 1.0);
        }
        if let Some(by_lens) = &mut by_lens {
            by_lens.add(image, &lens.by_intrinsics(point)?, residual, 1.0);
        }
    }
    if let Some(by_lens) = by_lens {
        by_lens.weighted(info);
    }
    let (h, g) = sums.weighted(info);
    Some(PoseInformation { h, g, adjoint: adjoint(camera_from_tag), chi2: chi2 * info, corner_chi2 })
}

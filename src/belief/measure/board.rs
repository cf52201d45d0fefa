//! Corners of a calibration board: like a tag's corners, but each with its own weight.

use nalgebra::{Isometry3, Point3};

use crate::measure::information::{LensInformation, PoseInformation, TwistSums};
use crate::measure::projection::ImagePoint;
use armcal_core::optics::CameraModel;
use armcal_core::spatial::adjoint;

/// Corner of a board and its measured pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightedPoint {
    pub on_board: Point3<f64>,
    pub pixel: [f64; 2],
    /// Inverse of the pixel's variance, px^-2.
    pub info: f64,
}

/// Returns the information of the corners; `scale` multiplies the weights.
pub(super) fn information(
    points: &[WeightedPoint],
    camera_from_board: &Isometry3<f64>,
    lens: &CameraModel,
    (scale, mut by_lens): (f64, Option<&mut LensInformation>),
) -> Option<PoseInformation> {
    let (mut sums, mut chi2) = (TwistSums::default(), 0.0);
    for point in points {
        let in_camera = (camera_from_board * point.on_board).coords;
        let image = ImagePoint::of(lens, &in_camera)?;
        let info = scale * point.info;
        let residual = image.residual_px(&point.pixel);
        for (row, &r) in image.by_twist.iter().zip(&residual) {
            chi2 += info * r * r;
            sums.add(row, r, info);
        }
        if let Some(by_lens) = &mut by_lens {
            by_lens.add(&image, &lens.by_intrinsics(&in_camera)?, residual, info);
        }
    }
    let (h, g) = sums.weighted(1.0);
    Some(PoseInformation { h, g, adjoint: adjoint(camera_from_board), chi2, corner_chi2: [0.0; 4] })
}

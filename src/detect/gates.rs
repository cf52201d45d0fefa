//! Validation gates for detections, before and after the fit.

use nalgebra::Matrix2;

use crate::decoder::Candidate;
use crate::fit::Fit;
use crate::settings::DetectorSettings;
use armcal_core::optics::CameraModel;
use armcal_core::streams::RejectReason;

/// Gates before the fit: Hamming distance, id, field of view and size.
pub(super) fn gate_candidate(
    settings: &DetectorSettings,
    lens: &CameraModel,
    candidate: &Candidate,
) -> Result<(), RejectReason> {
    if candidate.hamming > settings.max_wrong_bits {
        return Err(RejectReason::WrongBits);
    }
    if settings.known_ids.as_ref().is_some_and(|ids| !ids.contains(&candidate.id)) {
        return Err(RejectReason::UnknownId);
    }
    gate_corners(settings, lens, &candidate.corners_px)
}

/// Gates after the fit: contrast, explained variance, corner displacement and corner covariance. `start_px`: corners
/// before the fit.
pub(super) fn gate_fit(
    settings: &DetectorSettings,
    lens: &CameraModel,
    start_px: &[[f64; 2]; 4],
    fit: &Fit,
) -> Result<(), RejectReason> {
    gate_corners(settings, lens, &fit.corners_px)?;
    if fit.contrast < settings.min_contrast || fit.contrast < settings.min_contrast_ratio * fit.residual_std {
        return Err(RejectReason::LowContrast);
    }
    let moved_px = (0..4)
        .map(|k| (fit.corners_px[k][0] - start_px[k][0]).hypot(fit.corners_px[k][1] - start_px[k][1]))
        .fold(0.0, f64::max);
    let max_moved_px = 2.0 + 0.15 * shortest_side_px(start_px);
    let std_px = fit.covariances_px2.iter().map(largest_std).fold(0.0, f64::max);
    if fit.explained < settings.min_explained
        || moved_px > max_moved_px
        || std_px.is_nan()
        || std_px > settings.max_corner_std_px
    {
        return Err(RejectReason::PoorEdges);
    }
    Ok(())
}

fn gate_corners(
    settings: &DetectorSettings,
    lens: &CameraModel,
    corners_px: &[[f64; 2]; 4],
) -> Result<(), RejectReason> {
    let is_in_view = |c: &[f64; 2]| lens.contains(&(*c).into()) && lens.unproject(&(*c).into()).is_some();
    if !corners_px.iter().all(is_in_view) {
        return Err(RejectReason::OutOfView);
    }
    if shortest_side_px(corners_px) < settings.min_side_px {
        return Err(RejectReason::TooSmall);
    }
    Ok(())
}

pub(super) fn shortest_side_px(corners_px: &[[f64; 2]; 4]) -> f64 {
    let side = |k: usize| {
        let (a, b) = (corners_px[k], corners_px[(k + 1) % 4]);
        (a[0] - b[0]).hypot(a[1] - b[1])
    };
    (0..4).map(side).fold(f64::INFINITY, f64::min)
}

/// The square root of the larger eigenvalue.
fn largest_std(covariance: &Matrix2<f64>) -> f64 {
    let half = 0.5 * (covariance[(0, 0)] + covariance[(1, 1)]);
    let difference = 0.5 * (covariance[(0, 0)] - covariance[(1, 1)]);
    (half + difference.hypot(covariance[(0, 1)])).sqrt()
}

/// Returns true if the center of one quadrilateral lies within the other: both are detections of one tag.
pub(super) fn are_nested(a: &[[f64; 2]; 4], b: &[[f64; 2]; 4]) -> bool {
    contains_center(a, b) || contains_center(b, a)
}

fn contains_center(outer: &[[f64; 2]; 4], inner: &[[f64; 2]; 4]) -> bool {
    let center = [0, 1].map(|axis| inner.iter().map(|c| c[axis]).sum::<f64>() / 4.0);
    let side_of = |k: usize| {
        let (a, b) = (outer[k], outer[(k + 1) % 4]);
        (b[0] - a[0]) * (center[1] - a[1]) - (b[1] - a[1]) * (center[0] - a[0])
    };
    (0..4).all(|k| side_of(k) > 0.0) || (0..4).all(|k| side_of(k) < 0.0)
}

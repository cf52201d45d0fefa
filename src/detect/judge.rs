//! Which detections are believed.

use nalgebra::Matrix2;

use super::fit::Fit;
use armcal_core::optics::Fisheye;
use armcal_core::streams::RejectReason;

/// What a detector looks for, and what it believes. The defaults are those that `study detection` measures.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectorSettings {
    /// Side of the blocks of pixels that the search for quadrilaterals takes for one: 1 finds small tags, 2 is faster.
    pub decimation: f32,
    /// The same for a second look, at the image with its local contrast evened out; 0 for none. It finds tags in haze.
    pub second_decimation: f32,
    /// Wrong bits of 36 that may be corrected, 0 .. 2. Ids differ in 11 and more.
    pub max_wrong_bits: usize,
    /// White minus black over the standard deviation of what the fitted pattern leaves.
    pub min_contrast_ratio: f64,
    /// White minus black, grey levels.
    pub min_contrast: f64,
    /// Shortest side, px.
    pub min_side_px: f64,
    /// Share of the pixels' variance that the fitted pattern must explain.
    pub min_explained: f64,
    /// Largest standard deviation of a corner in any direction, px.
    pub max_corner_std_px: f64,
    /// Other ids are rejected; `None`: any id of the family is welcome.
    pub known_ids: Option<Vec<u32>>,
}

impl Default for DetectorSettings {
    fn default() -> Self {
        Self {
            decimation: 1.0,
            second_decimation: 2.0,
            max_wrong_bits: 2,
            min_contrast_ratio: 3.0,
            min_contrast: 4.0,
            min_side_px: 8.0,
            min_explained: 0.5,
            max_corner_std_px: 1.5,
            known_ids: None,
        }
    }
}

/// A decoded quadrilateral before it is fitted.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub id: u32,
    pub hamming: usize,
    pub decision_margin: f64,
    pub corners_px: [[f64; 2]; 4],
}

/// Before the fit, which costs time and needs bearings.
pub(super) fn judge_candidate(
    settings: &DetectorSettings,
    lens: &Fisheye,
    candidate: &Candidate,
) -> Result<(), RejectReason> {
    if candidate.hamming > settings.max_wrong_bits {
        return Err(RejectReason::WrongBits);
    }
    if settings.known_ids.as_ref().is_some_and(|ids| !ids.contains(&candidate.id)) {
        return Err(RejectReason::UnknownId);
    }
    judge_place(settings, lens, &candidate.corners_px)
}

/// After the fit. `start_px`: where the corners were before.
pub(super) fn gate_fit(
    settings: &DetectorSettings,
    lens: &Fisheye,
    start_px: &[[f64; 2]; 4],
    fit: &Fit,
) -> Result<(), RejectReason> {
    judge_place(settings, lens, &fit.corners_px)?;
    if fit.contrast < settings.min_contrast || fit.contrast < settings.min_contrast_ratio * fit.residual_std {
        return Err(RejectReason::LowContrast);
    }
    let moved_px = (0..4)
        .map(|k| (fit.corners_px[k][0] - start_px[k][0]).hypot(fit.corners_px[k][1] - start_px[k][1]))
        .fold(0.0, f64::max);
    let may_move_px = 2.0 + 0.15 * shortest_side_px(start_px);
    let std_px = fit.covariances_px2.iter().map(largest_std).fold(0.0, f64::max);
    if fit.explained < settings.min_explained
        || moved_px > may_move_px
        || std_px.is_nan()
        || std_px > settings.max_corner_std_px
    {
        return Err(RejectReason::PoorEdges);
    }
    Ok(())
}

fn judge_place(settings: &DetectorSettings, lens: &Fisheye, corners_px: &[[f64; 2]; 4]) -> Result<(), RejectReason> {
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

/// Whether the middle of one quadrilateral lies within the other: two readings of one tag, not two tags.
pub(super) fn are_nested(a: &[[f64; 2]; 4], b: &[[f64; 2]; 4]) -> bool {
    holds_middle(a, b) || holds_middle(b, a)
}

fn holds_middle(outer: &[[f64; 2]; 4], inner: &[[f64; 2]; 4]) -> bool {
    let middle = [0, 1].map(|axis| inner.iter().map(|c| c[axis]).sum::<f64>() / 4.0);
    let turn = |k: usize| {
        let (a, b) = (outer[k], outer[(k + 1) % 4]);
        (b[0] - a[0]) * (middle[1] - a[1]) - (b[1] - a[1]) * (middle[0] - a[0])
    };
    (0..4).all(|k| turn(k) > 0.0) || (0..4).all(|k| turn(k) < 0.0)
}

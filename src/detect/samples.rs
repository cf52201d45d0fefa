//! The pixels that a fit looks at: those of the tag and its white rim where the pattern changes, and few of the others.

use nalgebra::{Matrix2, Vector2};

use super::GreyImage;
use super::bearings::RectifiedView;
use super::homography::Homography;
use super::pattern::{Cells, N_CELLS};

/// Half of the tag's side in cells: s = +-1 at u = 0 and 8.
pub(super) const HALF: f64 = N_CELLS as f64 / 2.0;
/// Blur expected before anything is known, px.
const TYPICAL_BLUR_PX: f64 = 0.8;
/// A pixel this far from the next edge of a cell tells nothing of where the edge is.
const EDGE_REACH_PX: f64 = 3.0;
/// Every so many of the others tell black and white.
const FLAT_STRIDE: u32 = 23;

/// One pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Its line of sight in the tag's plane view, and d(plane)/d(pixel).
    pub plane: Vector2<f64>,
    pub jacobian: Matrix2<f64>,
    pub value: f64,
    /// Orders the samples at random, the same in every run.
    order: u32,
}

/// Fills `samples` with at most `limit` pixels, in an order whose every beginning is spread over the tag.
pub(super) fn collect(
    samples: &mut Vec<Sample>,
    image: &GreyImage,
    view: &RectifiedView,
    start: &Homography,
    cells: &Cells,
    corners_px: &[[f64; 2]; 4],
    limit: usize,
) {
    samples.clear();
    let Some([columns, rows]) = window(image, corners_px) else { return };
    for y in rows {
        let line = &image.data[y * image.width..][..image.width];
        for x in columns.clone() {
            let pixel = [x as f64, y as f64];
            let Some(plane) = view.plane(pixel) else { continue };
            let place = start.place(&plane);
            // The plane's horizon: what lies behind it is no part of the tag.
            if place.scale <= 0.0 || place.s.abs().max(place.t.abs()) > 1.25 {
                continue;
            }
            let Some((_, jacobian)) = view.plane_with_jacobian(pixel) else { continue };
            let slope = start.slope(&place) * jacobian * HALF;
            let cells_per_px = [slope.row(0).norm(), slope.row(1).norm()];
            let at = [(place.s + 1.0) * HALF, (place.t + 1.0) * HALF];
            let is_within = |k: usize| {
                // The rim is one cell wide; what lies beyond it must not shine in.
                let rim = (1.0 - 2.5 * TYPICAL_BLUR_PX * cells_per_px[k]).clamp(0.3, 0.8);
                (-rim..=2.0 * HALF + rim).contains(&at[k])
            };
            if !(is_within(0) && is_within(1)) {
                continue;
            }
            let order = scatter(x as u32, y as u32);
            let is_flat = cells.is_flat(at, cells_per_px.map(|c| EDGE_REACH_PX * c));
            if is_flat && !order.is_multiple_of(FLAT_STRIDE) {
                continue;
            }
            samples.push(Sample { plane, jacobian, value: f64::from(line[x]), order });
        }
    }
    samples.sort_unstable_by_key(|sample| sample.order);
    samples.truncate(limit);
}

/// Columns and rows about the tag with its rim.
fn window(image: &GreyImage, corners_px: &[[f64; 2]; 4]) -> Option<[std::ops::Range<usize>; 2]> {
    let sizes = [image.width, image.height];
    let mut ranges = [0..0, 0..0];
    for (k, range) in ranges.iter_mut().enumerate() {
        let low = corners_px.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min);
        let high = corners_px.iter().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max);
        let rim = 3.0 + 0.2 * (high - low);
        let (low, high) = ((low - rim).floor().max(0.0), (high + rim).ceil().min(sizes[k] as f64 - 1.0));
        if low.is_nan() || high.is_nan() || low >= high {
            return None;
        }
        *range = low as usize..high as usize + 1;
    }
    Some(ranges)
}

/// A hash of a pixel's place (the finalizer of MurmurHash3), different for every pixel of images below 65536 px.
fn scatter(x: u32, y: u32) -> u32 {
    let mut h = x ^ (y << 16);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

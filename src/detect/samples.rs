//! Pixels of a fit: those of the print near an edge of the pattern, and a few in flat areas.

use nalgebra::{Matrix2, Vector2};

use crate::bearings::RectifiedView;
use crate::homography::Homography;
use crate::image::GreyImage;
use crate::pattern::Cells;

/// Std of the blur assumed before the fit, px.
const TYPICAL_BLUR_PX: f64 = 0.8;
/// A pixel farther than this from the next cell edge has no information on the edge's position.
const EDGE_REACH_PX: f64 = 3.0;
/// Stride of the flat pixels that the fit uses, for the grey levels of black and white.
const FLAT_STRIDE: u32 = 23;

/// One pixel of a fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Position in the rectified view; `jacobian` is d(plane)/d(pixel).
    pub plane: Vector2<f64>,
    pub jacobian: Matrix2<f64>,
    pub value: f64,
    /// Pseudo-random sort key, the same in every run.
    order: u32,
}

/// A tag in an image, by its initial corners.
pub(super) struct TagRegion<'a> {
    pub image: &'a GreyImage<'a>,
    pub view: &'a RectifiedView<'a>,
    pub homography: &'a Homography,
    pub cells: &'a Cells,
    pub corners_px: &'a [[f64; 2]; 4],
}

impl TagRegion<'_> {
    /// Fills `samples` with at most `limit` pixels in pseudo-random order, so that every prefix is spread over the tag.
    pub(super) fn sample(&self, limit: usize, samples: &mut Vec<Sample>) {
        samples.clear();
        // Share of a square's side; it is larger where the camera views the tag obliquely.
        let margin_share = 0.8 * self.cells.margin() / self.cells.half();
        let Some([columns, rows]) = window(self.image, self.corners_px, margin_share) else { return };
        for y in rows {
            let line = &self.image.data[y * self.image.width..][..self.image.width];
            for x in columns.clone() {
                samples.extend(self.sample_pixel(x, y, f64::from(line[x])));
            }
        }
        samples.sort_unstable_by_key(|sample| sample.order);
        samples.truncate(limit);
    }

    /// Returns the sample of a pixel; `None` outside the tag and in most of its flat areas.
    #[inline]
    fn sample_pixel(&self, x: usize, y: usize, value: f64) -> Option<Sample> {
        let pixel = [x as f64, y as f64];
        let plane = self.view.plane(pixel)?;
        let point = self.homography.map(&plane);
        // A scale of 0 or less is beyond the horizon of the tag's plane.
        let (half, margin) = (self.cells.half(), self.cells.margin());
        if point.scale <= 0.0 || point.s.abs().max(point.t.abs()) > (half + margin) / half {
            return None;
        }
        let (_, jacobian) = self.view.plane_with_jacobian(pixel)?;
        let cells_by_pixel = self.homography.jacobian(&point) * jacobian * half;
        let cells_per_px = [cells_by_pixel.row(0).norm(), cells_by_pixel.row(1).norm()];
        let at = [(point.s + 1.0) * half, (point.t + 1.0) * half];
        let is_within = |k: usize| {
            // The blur must not carry in light from beyond the print's outermost cells.
            let rim = margin - 1.0 + (1.0 - 2.5 * TYPICAL_BLUR_PX * cells_per_px[k]).clamp(0.3, 0.8);
            (-rim..=2.0 * half + rim).contains(&at[k])
        };
        let from_blank = cells_per_px.map(|c| (2.5 * TYPICAL_BLUR_PX * c).clamp(0.2, 0.7));
        if !(is_within(0) && is_within(1) && self.cells.is_printed(at, from_blank)) {
            return None;
        }
        let order = hash_pixel(x as u32, y as u32);
        let is_flat = self.cells.is_flat(at, cells_per_px.map(|c| EDGE_REACH_PX * c));
        let is_wanted = !is_flat || order.is_multiple_of(FLAT_STRIDE);
        is_wanted.then_some(Sample { plane, jacobian, value, order })
    }
}

/// Columns and rows that hold the print, which is `margin_share` of the border square larger on each side.
fn window(image: &GreyImage, corners_px: &[[f64; 2]; 4], margin_share: f64) -> Option<[std::ops::Range<usize>; 2]> {
    let sizes = [image.width, image.height];
    let mut ranges = [0..0, 0..0];
    for (k, range) in ranges.iter_mut().enumerate() {
        let low = corners_px.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min);
        let high = corners_px.iter().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max);
        let rim = 3.0 + margin_share * (high - low);
        let (low, high) = ((low - rim).floor().max(0.0), (high + rim).ceil().min(sizes[k] as f64 - 1.0));
        if low.is_nan() || high.is_nan() || low >= high {
            return None;
        }
        *range = low as usize..high as usize + 1;
    }
    Some(ranges)
}

/// Hash of a pixel's coordinates (the finalizer of MurmurHash3), unique in images below 65536 px.
fn hash_pixel(x: u32, y: u32) -> u32 {
    let mut h = x ^ (y << 16);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

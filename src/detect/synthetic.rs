//! Images of tags by brute force, for tests: every pixel is the mean of many rays. Shares no code with the fit but the
//! lens.

use std::ops::Range;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use armcal_core::optics::{CameraModel, TagCells, TagFamily, square_corners};

/// A tag in the camera frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedTag {
    pub family: TagFamily,
    pub id: u32,
    pub size_m: f64,
    pub camera_from_tag: Isometry3<f64>,
}

impl PlacedTag {
    /// A tag of family 36h11 at `center_m` that faces the camera, tilted by `incidence_rad` about a line at
    /// `azimuth_rad`, turned by `spin_rad`.
    pub(super) fn new(
        id: u32,
        size_m: f64,
        center_m: Vector3<f64>,
        [incidence_rad, azimuth_rad, spin_rad]: [f64; 3],
    ) -> Self {
        let facing = UnitQuaternion::rotation_between(&Vector3::z(), &-center_m).expect("ahead");
        let axis = Vector3::new(azimuth_rad.cos(), azimuth_rad.sin(), 0.0);
        let lean = UnitQuaternion::from_scaled_axis(axis * incidence_rad);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * spin_rad);
        let camera_from_tag = Isometry3::from_parts(Translation3::from(center_m), facing * lean * turn);
        Self { family: TagFamily::Tag36h11, id, size_m, camera_from_tag }
    }

    pub(super) fn corners_px(&self, lens: &CameraModel) -> Option<[[f64; 2]; 4]> {
        let pixels = square_corners(self.size_m).map(|c| lens.project(&(self.camera_from_tag * c).coords));
        let mut out = [[0.0; 2]; 4];
        for (corner, pixel) in out.iter_mut().zip(pixels) {
            *corner = pixel.filter(|p| lens.contains(p))?.into();
        }
        Some(out)
    }
}

/// Light, blur and noise of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rendering {
    pub black: f64,
    pub white: f64,
    pub around: f64,
    /// Standard deviation of the blur, px.
    pub blur_px: f64,
    /// White noise of a pixel, grey levels.
    pub noise: f64,
}

pub(super) const CLEAN: Rendering = Rendering { black: 30.0, white: 200.0, around: 90.0, blur_px: 0.5, noise: 0.0 };

/// Reflectance at (x, y), m; `None` where nothing is printed.
fn reflectance(tag: &PlacedTag, cells: &TagCells, x: f64, y: f64) -> Option<bool> {
    let cell = tag.size_m / tag.family.n_cells() as f64;
    let half = 0.5 * cells.n() as f64;
    let (column, row) = ((x / cell + half).floor(), (half - y / cell).floor());
    if column < 0.0 || row < 0.0 {
        return None;
    }
    cells.get(row as usize, column as usize)
}

fn ray(lens: &CameraModel, rendering: &Rendering, tags: &[(PlacedTag, TagCells)], pixel: Vector2<f64>) -> f64 {
    let Some(bearing) = lens.unproject(&pixel) else { return 0.0 };
    for (tag, cells) in tags {
        let inverse = tag.camera_from_tag.inverse();
        let (origin, direction) = (inverse.translation.vector, inverse.rotation * bearing.into_inner());
        let along = -origin.z / direction.z;
        if along > 0.0 {
            let at = origin + direction * along;
            if let Some(is_white) = reflectance(tag, cells, at.x, at.y) {
                return if is_white { rendering.white } else { rendering.black };
            }
        }
    }
    rendering.around
}

/// Rays along a pixel's side.
const N: usize = 8;

/// Renders tags, the first in front; pixels beside them are not traced.
pub(super) fn render(lens: &CameraModel, rendering: &Rendering, tags: &[PlacedTag], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let [width, height] = lens.resolution_px().map(|n| n as usize);
    let mut grey = vec![rendering.around; width * height];
    for tag in tags {
        let Some(corners) = tag.corners_px(lens) else { continue };
        let range = |axis: usize, size: usize| {
            let low = corners.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
            let high = corners.iter().map(|c| c[axis]).fold(0.0, f64::max);
            let print = 1.7 * tag.family.n_margin_cells() as f64 / tag.family.n_cells() as f64;
            let rim = print.max(0.3) * (high - low) + 4.0;
            (low - rim).max(0.0) as usize..((high + rim) as usize + 1).min(size)
        };
        draw(lens, rendering, tags, [range(0, width), range(1, height)], &mut grey);
    }
    let mut noisy = |value: f64| {
        let normal: f64 = if rendering.noise > 0.0 { StandardNormal.sample(rng) } else { 0.0 };
        (value + rendering.noise * normal).round().clamp(0.0, 255.0) as u8
    };
    grey.into_iter().map(&mut noisy).collect()
}

/// Traces a window at N x N rays a pixel, blurs that, and averages.
fn draw(
    lens: &CameraModel,
    rendering: &Rendering,
    tags: &[PlacedTag],
    [columns, rows]: [Range<usize>; 2],
    grey: &mut [f64],
) {
    let width = lens.resolution_px()[0] as usize;
    let (nx, ny) = (columns.len() * N, rows.len() * N);
    let at = |start: usize, k: usize| start as f64 - 0.5 + (k as f64 + 0.5) / N as f64;
    let printed = |tag: &PlacedTag| (*tag, tag.family.cells(tag.id).expect("an id of the family"));
    let tags: Vec<(PlacedTag, TagCells)> = tags.iter().map(printed).collect();
    let fine: Vec<f64> = (0..nx * ny)
        .map(|i| ray(lens, rendering, &tags, Vector2::new(at(columns.start, i % nx), at(rows.start, i / nx))))
        .collect();
    let across = blur(&fine, nx, 1, rendering.blur_px);
    let both = blur(&across, ny, nx, rendering.blur_px);
    for (j, y) in rows.enumerate() {
        for (i, x) in columns.clone().enumerate() {
            let rays = (0..N * N).map(|k| both[(j * N + k / N) * nx + i * N + k % N]);
            grey[y * width + x] = rays.sum::<f64>() / (N * N) as f64;
        }
    }
}

/// Convolves lines of `n` values, `stride` apart, with a Gaussian.
fn blur(values: &[f64], n: usize, stride: usize, std_px: f64) -> Vec<f64> {
    let std = (std_px * N as f64).max(1e-3);
    let reach = (4.0 * std) as isize;
    let weights: Vec<f64> = (-reach..=reach).map(|k| (-0.5 * (k as f64 / std).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let mut out = vec![0.0; values.len()];
    for (i, out) in out.iter_mut().enumerate() {
        let index = (i / stride % n) as isize;
        for (k, weight) in (-reach..=reach).zip(&weights) {
            let other = (index + k).clamp(0, n as isize - 1);
            *out += weight / sum * values[(i as isize + (other - index) * stride as isize) as usize];
        }
    }
    out
}

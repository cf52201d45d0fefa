//! Images of tags by brute force, for tests: every pixel is the mean of many rays. Shares no code with the fit but the
//! lens.

use std::ops::Range;

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector2, Vector3};
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

    /// Columns and rows that hold the print and its blur, as far as the lens projects the corners.
    pub(super) fn window(&self, lens: &CameraModel) -> Option<Window> {
        let corners = square_corners(self.size_m).map(|c| lens.project(&(self.camera_from_tag * c).coords));
        let margin_share = 1.7 * self.family.n_margin_cells() as f64 / self.family.n_cells() as f64;
        let range = |axis: usize| {
            let places = || corners.iter().flatten().map(|corner| corner[axis]);
            let low = places().reduce(f64::min)?;
            let high = places().reduce(f64::max)?;
            let rim = margin_share.max(0.3) * (high - low) + 4.0;
            let end = f64::from(lens.resolution_px()[axis]);
            let range = (low - rim).clamp(0.0, end) as usize..(high + rim + 1.0).clamp(0.0, end) as usize;
            (!range.is_empty()).then_some(range)
        };
        Some([range(0)?, range(1)?])
    }
}

/// Columns and rows.
pub(super) type Window = [Range<usize>; 2];

pub(super) fn overlap(a: &Window, b: &Window) -> bool {
    (0..2).all(|k| a[k].start < b[k].end && b[k].start < a[k].end)
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
    let (column, row) = (x / cell + half, half - y / cell);
    if column < 0.0 || row < 0.0 {
        return None;
    }
    cells.get(row as usize, column as usize)
}

/// Tag with precomputed quantities for its rays.
struct Printed {
    tag: PlacedTag,
    cells: TagCells,
    /// The camera in the tag's frame.
    origin: Vector3<f64>,
    tag_from_camera: Matrix3<f64>,
}

impl Printed {
    fn new(tag: &PlacedTag) -> Self {
        let inverse = tag.camera_from_tag.inverse();
        let cells = tag.family.cells(tag.id).expect("an id of the family");
        let (origin, tag_from_camera) =
            (inverse.translation.vector, inverse.rotation.to_rotation_matrix().into_inner());
        Self { tag: *tag, cells, origin, tag_from_camera }
    }
}

fn ray(rendering: &Rendering, tags: &[Printed], bearing: &Vector3<f64>) -> f64 {
    for Printed { tag, cells, origin, tag_from_camera } in tags {
        let direction = tag_from_camera * bearing;
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

/// Renders tags, the first in front; pixels outside of them are not traced.
pub(super) fn render(lens: &CameraModel, rendering: &Rendering, tags: &[PlacedTag], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let [width, height] = lens.resolution_px().map(|n| n as usize);
    let mut grey = vec![rendering.around; width * height];
    let windows: Vec<(&PlacedTag, Window)> = tags.iter().filter_map(|tag| Some((tag, tag.window(lens)?))).collect();
    for (_, window) in &windows {
        let near = windows.iter().filter(|(_, other)| overlap(window, other)).map(|(tag, _)| Printed::new(tag));
        draw(lens, rendering, &near.collect::<Vec<_>>(), window, &mut grey);
    }
    let mut noisy = |value: f64| {
        let normal: f64 = if rendering.noise > 0.0 { StandardNormal.sample(rng) } else { 0.0 };
        (value + rendering.noise * normal).round().clamp(0.0, 255.0) as u8
    };
    grey.into_iter().map(&mut noisy).collect()
}

/// Traces a window at N x N rays a pixel, blurs that, and averages.
fn draw(lens: &CameraModel, rendering: &Rendering, tags: &[Printed], [columns, rows]: &Window, grey: &mut [f64]) {
    let width = lens.resolution_px()[0] as usize;
    let fine = traced(lens, rendering, tags, [columns, rows]);
    let (reach, weights) = pixel_weights(rendering.blur_px);
    let clamped = |first: usize, k: usize, n: usize| (first + k).saturating_sub(reach).min(n - 1);
    let (nx, ny) = (columns.len() * N, rows.len() * N);
    let mean_across = |line: &[f64], i: usize| {
        weights.iter().enumerate().map(|(k, weight)| weight * line[clamped(i * N, k, nx)]).sum::<f64>()
    };
    let across: Vec<f64> =
        fine.chunks_exact(nx).flat_map(|line| (0..columns.len()).map(move |i| mean_across(line, i))).collect();
    for (j, y) in rows.clone().enumerate() {
        let out = &mut grey[y * width..][columns.clone()];
        out.fill(0.0);
        for (k, weight) in weights.iter().enumerate() {
            let line = &across[clamped(j * N, k, ny) * columns.len()..];
            for (out, value) in out.iter_mut().zip(line) {
                *out += weight * value;
            }
        }
    }
}

/// Values that N x N rays a pixel meet, line by line. The lens gives the bearings of points half a pixel apart; between
/// them they are interpolated, which moves a ray by less than 2e-4 px.
fn traced(
    lens: &CameraModel,
    rendering: &Rendering,
    tags: &[Printed],
    [columns, rows]: [&Range<usize>; 2],
) -> Vec<f64> {
    const RAYS_A_STEP: usize = N / 2;
    let at = |start: usize, rays: f64| start as f64 - 0.5 + rays / N as f64;
    let bearing = |x: f64, y: f64| lens.unproject(&Vector2::new(x, y)).map(|bearing| bearing.into_inner());
    let n_nodes = 2 * columns.len() + 1;
    let nodes: Vec<Option<Vector3<f64>>> = (0..=2 * rows.len())
        .flat_map(|j| (0..n_nodes).map(move |i| [i, j].map(|k| (k * RAYS_A_STEP) as f64)))
        .map(|[i, j]| bearing(at(columns.start, i), at(rows.start, j)))
        .collect();
    let between = |a: Option<Vector3<f64>>, b: Option<Vector3<f64>>, k: usize| {
        Some(a?.lerp(&b?, (k as f64 + 0.5) / RAYS_A_STEP as f64))
    };
    let mut fine = Vec::with_capacity(columns.len() * rows.len() * N * N);
    for j in 0..rows.len() * N {
        let (above, below) = nodes[j / RAYS_A_STEP * n_nodes..].split_at(n_nodes);
        let line: Vec<_> = above.iter().zip(below).map(|(a, b)| between(*a, *b, j % RAYS_A_STEP)).collect();
        fine.extend((0..columns.len() * N).map(|i| {
            let exact = || bearing(at(columns.start, i as f64 + 0.5), at(rows.start, j as f64 + 0.5));
            let [a, b] = [line[i / RAYS_A_STEP], line[i / RAYS_A_STEP + 1]];
            between(a, b, i % RAYS_A_STEP).or_else(exact).map_or(0.0, |bearing| ray(rendering, tags, &bearing))
        }));
    }
    fine
}

/// Weights of the rays about a pixel, the first of them `reach` before its own: a Gaussian blur, then the pixel's mean.
fn pixel_weights(blur_px: f64) -> (usize, Vec<f64>) {
    let std = (blur_px * N as f64).max(1e-3);
    let reach = (4.0 * std) as usize;
    let gauss: Vec<f64> = (0..=2 * reach).map(|k| (-0.5 * ((k as f64 - reach as f64) / std).powi(2)).exp()).collect();
    let sum = N as f64 * gauss.iter().sum::<f64>();
    let mut weights = vec![0.0; gauss.len() + N - 1];
    for first in 0..N {
        for (weight, density) in weights[first..].iter_mut().zip(&gauss) {
            *weight += density / sum;
        }
    }
    (reach, weights)
}

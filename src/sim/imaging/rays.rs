//! Ray of each pixel, computed once for a camera.

use rayon::prelude::*;

use crate::imaging::math::{Lanes, Vec3};
use armcal_core::optics::CameraModel;

/// Unit vectors in the camera's frame, pixel by pixel, rows from the top. Beyond the lens's field of view they are
/// zero.
#[derive(Clone, Debug)]
pub(super) struct Rays {
    pub width: usize,
    pub height: usize,
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub z: Vec<f32>,
    /// Range of pixels in each row that are in the field of view: the first, and one after the last.
    pub spans: Vec<[usize; 2]>,
    pub focal_px: f32,
    pub center_px: [f32; 2],
}

impl Rays {
    pub(super) fn new(lens: &CameraModel) -> Self {
        let [width, height] = lens.resolution_px().map(|n| n as usize);
        let n = width * height;
        let (mut x, mut y, mut z) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut spans = vec![[0; 2]; height];
        let rows = x.par_chunks_mut(width).zip(y.par_chunks_mut(width)).zip(z.par_chunks_mut(width));
        rows.zip(spans.par_iter_mut()).enumerate().for_each(|(row, (((x, y), z), span))| {
            let mut seeing = [width, 0];
            for column in 0..width {
                let pixel = nalgebra::Vector2::new(column as f64, row as f64);
                let Some(ray) = lens.unproject(&pixel) else { continue };
                (x[column], y[column], z[column]) = (ray.x as f32, ray.y as f32, ray.z as f32);
                seeing = [seeing[0].min(column), column + 1];
            }
            *span = if seeing[0] < seeing[1] { seeing } else { [0, 0] };
        });
        Self {
            width,
            height,
            x,
            y,
            z,
            spans,
            focal_px: lens.focal_px().iter().fold(0.0, |a: f64, b| a.max(*b)) as f32,
            center_px: lens.center_px().map(|c| c as f32),
        }
    }

    #[inline]
    pub(super) fn at(&self, column: usize, row: usize) -> Vec3 {
        let i = row * self.width + column;
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    /// Returns the rays of consecutive pixels in a row, from the `i`th pixel on.
    #[inline]
    pub(super) fn several<const N: usize>(&self, i: usize) -> Lanes<N> {
        [first_of(&self.x[i..]), first_of(&self.y[i..]), first_of(&self.z[i..])]
    }

    #[inline]
    pub(super) fn sees(&self, column: usize, row: usize) -> bool {
        (self.spans[row][0]..self.spans[row][1]).contains(&column)
    }

    /// Returns the direction at a pixel and its change by one pixel across and down. At the edge of the image or the
    /// field of view, the change is that to the opposite side.
    pub(super) fn with_slopes(&self, column: usize, row: usize) -> (Vec3, Vec3, Vec3) {
        let here = self.at(column, row);
        let slope = |before: Option<Vec3>, after: Option<Vec3>| match (before, after) {
            (Some(before), Some(after)) => (after - before) * 0.5,
            (None, Some(after)) => after - here,
            (Some(before), None) => here - before,
            (None, None) => Vec3::zeros(),
        };
        let look = |column: usize, row: usize| {
            (column < self.width && row < self.height && self.sees(column, row)).then(|| self.at(column, row))
        };
        let across = slope(look(column.wrapping_sub(1), row), look(column + 1, row));
        let down = slope(look(column, row.wrapping_sub(1)), look(column, row + 1));
        (here, across, down)
    }
}

/// Returns the first few values; zero where there are no more.
#[inline(always)]
pub(super) fn first_of<const N: usize>(values: &[f32]) -> [f32; N] {
    if let Some(whole) = values.first_chunk() {
        return *whole;
    }
    let mut some = [0.0; N];
    some[..values.len()].copy_from_slice(values);
    some
}

//! Marine snow: particles in the water in front of the camera, redrawn for each image as soft discs over the
//! background.
//!
//! A particle of radius a at range r with an albedo of one half (assumed) sends as much light as a disc of its size.
//! The disc has the radiance `E / pi` and `pi (f a / r)^2` px, spread as a Gaussian.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use crate::imaging::math::{Vec3, exp, hash, lanes, unit};
use crate::imaging::rays::Rays;
use crate::imaging::shader::Shader;
use crate::spec::ImageSpec;
use armcal_core::optics::CameraModel;

/// Largest range of visible particles, m.
const FAR_M: f32 = 2.0;
const NEAR_M: f32 = 0.04;
const ALBEDO: f32 = 0.5;
/// Largest standard deviation of a disc, px.
const LARGEST_PX: f32 = 20.0;

/// Disc in the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flake {
    column: f32,
    row: f32,
    sigma_px: f32,
    range_m: f32,
    /// Radiance in the middle, cd/m2.
    peak: [f32; 3],
}

/// Draws the particles of one image into `out`; `key` selects their random numbers.
pub(super) fn fall(spec: &ImageSpec, lens: &CameraModel, shader: &Shader, key: u64, out: &mut Vec<Flake>) {
    out.clear();
    let cos_least = lens.max_view_angle_rad().cos() as f32;
    let volume_m3 = TAU / 3.0 * (1.0 - cos_least) * FAR_M.powi(3);
    let n = (spec.snow_per_m3 as f32 * volume_m3).round() as u64;
    for k in 0..n {
        let draw = |what: u64| unit(hash(key ^ (8 * k + what)));
        let range_m = FAR_M * draw(0).cbrt();
        if range_m < NEAR_M {
            continue;
        }
        let cos = 1.0 - draw(1) * (1.0 - cos_least);
        let (sin, azimuth) = ((1.0 - cos * cos).max(0.0).sqrt(), TAU * draw(2));
        let point = Vec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos) * range_m;
        let Some(pixel) = lens.project(&point.cast()) else { continue };
        // The sizes are exponential, so that few are large.
        let radius_m = spec.snow_radius_m as f32 * -(1.0 - draw(3)).ln();
        let focal_px = lens.focal_px()[0] as f32;
        let radius_px = focal_px * radius_m / range_m;
        let sigma_px = (0.25 * radius_px * radius_px + 0.16).sqrt().min(LARGEST_PX);
        let mut lux = [[0.5 * spec.ambient_lux as f32]; 3];
        for lamp in &shader.lamps {
            lamp.light_up_all_sides(&lanes(&[point]), &shader.water.direct_per_m, &mut lux);
        }
        let area_px = PI * radius_px * radius_px;
        let share = ALBEDO * FRAC_1_PI * area_px / (TAU * sigma_px * sigma_px);
        let peak = std::array::from_fn(|c| lux[c][0] * share * exp(-shader.water.direct_per_m[c] * range_m));
        out.push(Flake { column: pixel.x as f32, row: pixel.y as f32, sigma_px, range_m, peak });
    }
}

/// Adds the particles on the rows from `top` on.
pub(super) fn draw(flakes: &[Flake], rays: &Rays, ranges: &[f32], top: usize, planes: &mut [&mut [f32]; 3]) {
    let width = rays.width;
    let rows = planes[0].len() / width;
    for flake in flakes {
        let reach = 3.0 * flake.sigma_px;
        let first = |middle: f32| (middle - reach).ceil().max(0.0) as usize;
        let behind = |middle: f32, n: usize| ((middle + reach).floor() + 1.0).clamp(0.0, n as f32) as usize;
        for row in first(flake.row).max(top)..behind(flake.row, rays.height).min(top + rows) {
            let [from, to] = rays.spans[row];
            for column in first(flake.column).max(from)..behind(flake.column, width).min(to) {
                let i = row * width + column;
                if ranges[i] < flake.range_m {
                    continue;
                }
                let (dx, dy) = (column as f32 - flake.column, row as f32 - flake.row);
                let share = exp(-0.5 * (dx * dx + dy * dy) / (flake.sigma_px * flake.sigma_px));
                for (plane, peak) in planes.iter_mut().zip(flake.peak) {
                    plane[i - top * width] += share * peak;
                }
            }
        }
    }
}

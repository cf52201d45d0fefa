//! From radiance to bytes: the lens's blur and vignetting, exposure, shot and read noise, 8 bits.
//!
//! A pixel collects `N = q e V L` electrons, q electrons for 1 cd/m2, `V = 1 - v (r / r_max)^2`, and reads
//! `N + sqrt(s^2 N + n^2)` times a normal number. The camera chooses the exposure share e <= 1 and the gain g >= 1 so
//! that its bright pixels come to a set share of full scale. The response is linear, as machine vision cameras have it.

use rayon::prelude::*;

use crate::imaging::auto_exposure::Exposure;
use crate::imaging::math::{Lanes, hash, image_key, max, min};
use crate::imaging::rays::{Rays, first_of};
use crate::spec::ImageSpec;
use armcal_core::numeric::whole_part;

/// Number of rows that one thread processes.
pub(super) const BAND_ROWS: usize = 32;
const NORMALS: usize = 4096;
/// Number of pixels that are read out together.
const LANES: usize = 8;

/// Image sensor with its precomputed tables.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
    /// Half of a symmetric kernel, its middle first; empty without blur.
    kernel: Vec<f32>,
    /// Quantiles of the normal distribution, scaled to unit variance.
    normals: Box<[f32; NORMALS]>,
    spare: Vec<f32>,
    seed: u64,
}

impl Sensor {
    pub(super) fn new(spec: &ImageSpec, seed: u64) -> Self {
        Self { kernel: gaussian(spec.blur_px), normals: normals(), spare: Vec::new(), seed }
    }

    /// Applies the lens's blur.
    pub(super) fn blur(&mut self, planes: &mut [Vec<f32>; 3], width: usize) {
        let Some((middle, sides)) = self.kernel.split_first() else { return };
        let height = planes[0].len() / width;
        for plane in planes {
            self.spare.resize(plane.len(), 0.0);
            self.spare.par_chunks_mut(width).zip(plane.par_chunks(width)).for_each(|(out, line)| {
                across(line, *middle, sides, out);
            });
            let spare = &self.spare;
            let row_of = |row: usize| &spare[row * width..(row + 1) * width];
            plane.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
                out.iter_mut().zip(row_of(row)).for_each(|(out, value)| *out = middle * value);
                for (k, weight) in sides.iter().enumerate() {
                    let (above, below) = (row_of(row.saturating_sub(k + 1)), row_of((row + k + 1).min(height - 1)));
                    for ((out, a), b) in out.iter_mut().zip(above).zip(below) {
                        *out += weight * (a + b);
                    }
                }
            });
        }
    }

    /// Returns the readout of image `number`.
    pub(super) fn readout(&self, spec: &ImageSpec, exposure: Exposure, rays: &Rays, number: u64) -> Readout<'_> {
        Readout::new(spec, exposure, rays, image_key(self.seed, number), &self.normals)
    }
}

/// Values common to all pixels of an image.
pub(super) struct Readout<'a> {
    electrons_per_cd_m2: f32,
    counts_per_electron: f32,
    read_variance: f32,
    shot_variance: f32,
    is_noisy: bool,
    vignetting: f32,
    center_px: [f32; 2],
    key: u64,
    normals: &'a [f32; NORMALS],
}

impl<'a> Readout<'a> {
    fn new(spec: &ImageSpec, exposure: Exposure, rays: &Rays, key: u64, normals: &'a [f32; NORMALS]) -> Self {
        let (read, shot) = (spec.read_noise_electrons as f32, spec.shot_noise as f32);
        let half_diagonal_px = 0.5 * (rays.width as f32).hypot(rays.height as f32);
        Self {
            electrons_per_cd_m2: spec.electrons_per_cd_m2 as f32 * exposure.share,
            counts_per_electron: 255.0 * exposure.gain / spec.full_well_electrons as f32,
            read_variance: read * read,
            shot_variance: shot * shot,
            is_noisy: read > 0.0 || shot > 0.0,
            vignetting: spec.vignetting as f32 / (half_diagonal_px * half_diagonal_px),
            center_px: rays.center_px,
            key,
            normals,
        }
    }

    /// Writes the bytes of an image.
    pub(super) fn write(&self, planes: &[Vec<f32>; 3], width: usize, rgb: &mut [u8]) {
        rgb.par_chunks_mut(3 * width * BAND_ROWS).enumerate().for_each(|(band, out)| {
            for (k, line) in out.chunks_mut(3 * width).enumerate() {
                let row = band * BAND_ROWS + k;
                let at = row * width..(row + 1) * width;
                self.line(row, [&planes[0][at.clone()], &planes[1][at.clone()], &planes[2][at]], line);
            }
        });
    }

    fn line(&self, row: usize, planes: [&[f32]; 3], out: &mut [u8]) {
        for (n, out) in out.chunks_mut(3 * LANES).enumerate() {
            let (first, n_pixels) = (n * LANES, out.len() / 3);
            // Zeros fill up the end of a row; their results are dropped.
            let of = first..first + n_pixels;
            let [red, green, blue] = planes;
            let radiance = [first_of(&red[of.clone()]), first_of(&green[of.clone()]), first_of(&blue[of])];
            let rgb = self.pixels(row, first, &radiance);
            for (k, out) in out.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                *out = [rgb[0][k], rgb[1][k], rgb[2][k]];
            }
        }
    }

    /// Returns the bytes of several pixels in a row, from column `first` on.
    #[inline]
    fn pixels(&self, row: usize, first: usize, radiance: &Lanes<LANES>) -> [[u8; LANES]; 3] {
        let dy = row as f32 - self.center_px[1];
        let mut kept = [0.0; LANES];
        for (k, kept) in kept.iter_mut().enumerate() {
            let dx = (first + k) as f32 - self.center_px[0];
            *kept = max(1.0 - self.vignetting * (dx * dx + dy * dy), 0.0) * self.electrons_per_cd_m2;
        }
        let key = self.key.wrapping_add((row as u64) << 32);
        let mut bits = [0; LANES];
        if self.is_noisy {
            for (k, bits) in bits.iter_mut().enumerate() {
                *bits = hash(key.wrapping_add((first + k) as u64));
            }
        }
        let mut out = [[0; LANES]; 3];
        for (c, out) in out.iter_mut().enumerate() {
            let mut electrons = [0.0; LANES];
            for k in 0..LANES {
                electrons[k] = kept[k] * radiance[c][k];
            }
            if self.is_noisy {
                let mut normals = [0.0; LANES];
                for k in 0..LANES {
                    normals[k] = self.normals[(bits[k] >> (20 * c)) as usize & (NORMALS - 1)];
                }
                for k in 0..LANES {
                    electrons[k] += normals[k] * (self.read_variance + self.shot_variance * electrons[k]).sqrt();
                }
            }
            for k in 0..LANES {
                out[k] = whole_part(min(max(electrons[k] * self.counts_per_electron + 0.5, 0.0), 255.0));
            }
        }
        out
    }
}

/// Blurs a row; the last pixels continue beyond its ends.
fn across(line: &[f32], middle: f32, sides: &[f32], out: &mut [f32]) {
    let (n, reach) = (line.len(), sides.len());
    let slow = |i: usize| {
        let side = |(k, weight): (usize, &f32)| weight * (line[i.saturating_sub(k + 1)] + line[(i + k + 1).min(n - 1)]);
        middle * line[i] + sides.iter().enumerate().map(side).sum::<f32>()
    };
    if n <= 2 * reach {
        out.iter_mut().enumerate().for_each(|(i, out)| *out = slow(i));
        return;
    }
    for i in (0..reach).chain(n - reach..n) {
        out[i] = slow(i);
    }
    let inner = &mut out[reach..n - reach];
    inner.iter_mut().zip(&line[reach..]).for_each(|(out, value)| *out = middle * value);
    for (k, weight) in sides.iter().enumerate() {
        let (before, after) = (&line[reach - k - 1..], &line[reach + k + 1..]);
        for ((out, a), b) in inner.iter_mut().zip(before).zip(after) {
            *out += weight * (a + b);
        }
    }
}

/// Returns half of a Gaussian kernel of unit sum, out to 3 sigma and half a pixel.
fn gaussian(sigma_px: f64) -> Vec<f32> {
    if sigma_px <= 0.0 {
        return Vec::new();
    }
    let reach = (3.0 * sigma_px + 0.5).floor() as i32;
    let weight = |k: i32| (-0.5 * (f64::from(k) / sigma_px).powi(2)).exp();
    let sum: f64 = (-reach..=reach).map(weight).sum();
    (0..=reach).map(|k| (weight(k) / sum) as f32).collect()
}

/// Returns the normal distribution's quantiles at the middles of even shares, scaled to a variance of one. They are
/// found by bisection of its distribution function (the series of Marsaglia 2004).
fn normals() -> Box<[f32; NORMALS]> {
    let below = |x: f64| {
        let (mut sum, mut term, mut n) = (x, x, 1.0);
        while f64::abs(term) > 1e-17 {
            n += 2.0;
            term *= x * x / n;
            sum += term;
        }
        0.5 + sum * (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt()
    };
    let quantile = |share: f64| {
        let (mut low, mut high) = (-5.0, 5.0);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if below(middle) < share { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    };
    let half: Vec<f64> = (0..NORMALS / 2).map(|k| -quantile((k as f64 + 0.5) / NORMALS as f64)).collect();
    let variance = half.iter().map(|x| x * x).sum::<f64>() / half.len() as f64;
    let mut normals = Box::new([0.0; NORMALS]);
    for (pair, x) in normals.as_chunks_mut::<2>().0.iter_mut().zip(half) {
        *pair = [1.0, -1.0].map(|sign| (sign * x / variance.sqrt()) as f32);
    }
    normals
}

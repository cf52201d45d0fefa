//! Texture of the seafloor: smooth noise on all scales, periodic, with ever coarser copies for the distance. Assumed.

use crate::imaging::math::{Rgb, hash, unit};

/// Side of the finest level, texels.
const SIDE: usize = 512;
const TEXEL_M: f32 = 0.01;
/// Reflectance of sand.
const SAND: Rgb = [0.34, 0.30, 0.23];

#[derive(Clone, Debug)]
pub(super) struct Texture {
    /// Factors about 1; each level has half the side of the one before.
    levels: Vec<Vec<f32>>,
}

impl Texture {
    pub(super) fn new() -> Self {
        let mut finest = vec![0.0_f32; SIDE * SIDE];
        // Scales from 2.56 m to 2 cm; the share falls with the root of the scale.
        for octave in 0..8 {
            let cells = 2_usize << octave;
            let share = 0.28 * 0.76_f32.powi(octave);
            for (i, texel) in finest.iter_mut().enumerate() {
                *texel += share * smooth_noise(i % SIDE, i / SIDE, cells, octave as u64);
            }
        }
        finest.iter_mut().for_each(|texel| *texel = (1.0 + *texel).clamp(0.3, 1.9));
        let mut levels = vec![finest];
        while levels.last().is_some_and(|level| level.len() > 4) {
            let next = levels.last().map(|level| halved(level)).unwrap_or_default();
            levels.push(next);
        }
        Self { levels }
    }

    /// Returns the copy for a pixel that covers `footprint_m`.
    pub(super) fn level(&self, footprint_m: f32) -> usize {
        let halvings = (footprint_m / TEXEL_M).log2().round();
        halvings.clamp(0.0, (self.levels.len() - 1) as f32) as usize
    }

    /// Returns the reflectance at a position, m.
    #[inline]
    pub(super) fn albedo(&self, x_m: f32, y_m: f32, level: usize) -> Rgb {
        let texels = &self.levels[level];
        let side = SIDE >> level;
        let scale = 1.0 / (TEXEL_M * (1 << level) as f32);
        // Adds whole periods, so that the cast rounds down.
        let away = (side << 12) as f32;
        let (x, y) = (x_m * scale + away, y_m * scale + away);
        let (i, j) = (x as i32 as usize, y as i32 as usize);
        let (u, v) = (x - i as f32, y - j as f32);
        let mask = side - 1;
        let at = |dx: usize, dy: usize| texels[((j + dy) & mask) * side + ((i + dx) & mask)];
        let top = at(0, 0) + u * (at(1, 0) - at(0, 0));
        let bottom = at(0, 1) + u * (at(1, 1) - at(0, 1));
        let factor = top + v * (bottom - top);
        SAND.map(|sand| sand * factor)
    }
}

/// Returns noise in -1..1 that is smooth between the nodes of a periodic grid of `cells` squared.
fn smooth_noise(x: usize, y: usize, cells: usize, octave: u64) -> f32 {
    let at =
        |i: usize, j: usize| 2.0 * unit(hash((octave << 40) ^ ((i % cells) as u64) << 20 ^ (j % cells) as u64)) - 1.0;
    let split = |k: usize| {
        let place = k as f32 * cells as f32 / SIDE as f32;
        let part = place.fract();
        (place as usize, part * part * (3.0 - 2.0 * part))
    };
    let ((i, u), (j, v)) = (split(x), split(y));
    let top = at(i, j) + u * (at(i + 1, j) - at(i, j));
    let bottom = at(i, j + 1) + u * (at(i + 1, j + 1) - at(i, j + 1));
    top + v * (bottom - top)
}

fn halved(level: &[f32]) -> Vec<f32> {
    let side = level.len().isqrt();
    let half = side / 2;
    let mean = |n: usize| {
        let i = 2 * (n / half) * side + 2 * (n % half);
        0.25 * (level[i] + level[i + 1] + level[i + side] + level[i + side + 1])
    };
    (0..half * half).map(mean).collect()
}

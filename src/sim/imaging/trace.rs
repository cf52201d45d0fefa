//! From rays to what they meet, and in which order an image comes about.

use rayon::prelude::*;

use super::Vec3;
use super::band::Band;
use super::math::max;
use super::rays::Rays;
use super::scene::{FACE_BITS, Object, TILE_PX, candidates, first_met};
use super::shade::Shader;
use super::shape::Lanes;
use super::texture::Texture;

/// Rays traced together.
const LANES: usize = 8;
/// How far moving edges are looked for, px.
const FARTHEST_SWEEP_PX: usize = 48;

/// What each pixel sees, and how bright, cd/m2.
#[derive(Clone, Debug, Default)]
pub(super) struct Canvas {
    /// Object and face of the ray through each pixel's centre.
    faces: Vec<u16>,
    /// Range, m; infinite in open water.
    pub ranges: Vec<f32>,
    /// 1 where samples are needed although no neighbour differs.
    swept: Vec<u8>,
    spare: Vec<u8>,
    pub planes: [Vec<f32>; 3],
}

/// All that pixels are made from.
#[derive(Clone, Copy)]
pub(super) struct Tracer<'a> {
    pub rays: &'a Rays,
    pub objects: &'a [Object<'a>],
    pub shader: &'a Shader,
    pub texture: &'a Texture,
}

/// Objects that the rays of one tile may meet.
pub(super) type Candidates = Vec<(f32, u16)>;

impl Canvas {
    pub(super) fn new(n_pixels: usize) -> Self {
        Self {
            faces: vec![0; n_pixels],
            ranges: vec![f32::INFINITY; n_pixels],
            swept: vec![0; n_pixels],
            spare: vec![0; n_pixels],
            planes: std::array::from_fn(|_| vec![0.0; n_pixels]),
        }
    }

    pub(super) fn trace(&mut self, tracer: &Tracer) {
        let rays = tracer.rays;
        let band = rays.width * TILE_PX;
        let Self { faces, ranges, swept, spare, planes } = self;
        let bands = faces.par_chunks_mut(band).zip(ranges.par_chunks_mut(band)).enumerate();
        let tiles: Vec<Vec<Candidates>> =
            bands.map(|(n, (faces, ranges))| tracer.meet_band(n * TILE_PX, faces, ranges)).collect();
        let sweep_px = tracer.sweep_px(faces);
        if sweep_px > 0 {
            mark_swept(rays, faces, sweep_px, swept, spare);
        }
        let swept = (sweep_px > 0).then_some(&swept[..]);
        let [red, green, blue] = planes;
        let bands = red.par_chunks_mut(band).zip(green.par_chunks_mut(band)).zip(blue.par_chunks_mut(band));
        bands.zip(&tiles).enumerate().for_each(|(n, (((red, green), blue), tiles))| {
            Band { tracer, faces, ranges, swept, top: n * TILE_PX, planes: [red, green, blue] }.shade(tiles);
        });
    }
}

/// The object that a face belongs to.
#[inline]
pub(super) fn object_of(face: u16) -> Option<usize> {
    (face >> FACE_BITS).checked_sub(1).map(usize::from)
}

impl Tracer<'_> {
    fn meet_band(&self, top: usize, faces: &mut [u16], ranges: &mut [f32]) -> Vec<Candidates> {
        let rays = self.rays;
        let tile = |column: usize| {
            let found = candidates(self.objects, rays, column, top);
            let behind = (column + TILE_PX).min(rays.width);
            for row in 0..faces.len() / rays.width {
                let mut x = column;
                while x < behind {
                    let n = LANES.min(behind - x);
                    let out = row * rays.width + x..row * rays.width + x + n;
                    self.meet(&found, top * rays.width + out.start, &mut faces[out.clone()], &mut ranges[out]);
                    x += n;
                }
            }
            found
        };
        (0..rays.width).step_by(TILE_PX).map(tile).collect()
    }

    /// A few pixels from the `i`th on.
    fn meet(&self, found: &[(f32, u16)], i: usize, faces: &mut [u16], ranges: &mut [f32]) {
        faces.fill(0);
        ranges.fill(f32::INFINITY);
        if found.is_empty() {
            return;
        }
        let n = faces.len();
        let lanes: Lanes<LANES> =
            [&self.rays.x, &self.rays.y, &self.rays.z].map(|plane| match plane[i..].first_chunk() {
                Some(whole) => *whole,
                None => std::array::from_fn(|k| plane.get(i + k).copied().unwrap_or(0.0)),
            });
        let (range, number) = first_met(self.objects, found, &lanes);
        for k in 0..n {
            let ray = Vec3::new(lanes[0][k], lanes[1][k], lanes[2][k]);
            // A ray beyond the field of view is zero and meets nothing that counts.
            if number[k] > 0 && ray != Vec3::zeros() {
                let object = &self.objects[usize::from(number[k] - 1)];
                // Neighbours on a fine pattern always differ.
                let face =
                    if object.is_fine { ((i + k) & 1) as u16 } else { object.form.face(&object.place, &ray, range[k]) };
                ranges[k] = object.form.true_range(&object.place, &ray, range[k]);
                faces[k] = number[k] << FACE_BITS | face;
            }
        }
    }

    /// How far edges move in the image, px; 0 where nothing does.
    fn sweep_px(&self, faces: &[u16]) -> usize {
        if self.objects.iter().all(|object| object.moving.is_none()) {
            return 0;
        }
        let mut is_seen = vec![false; self.objects.len()];
        faces.iter().filter_map(|face| object_of(*face)).for_each(|n| is_seen[n] = true);
        let seen = self.objects.iter().zip(&is_seen).filter(|(_, is_seen)| **is_seen);
        let farthest = seen.map(|(object, _)| object.motion_px).fold(0.0, max);
        // Halfway is the middle of the sweep.
        ((0.5 * farthest).ceil() as usize).min(FARTHEST_SWEEP_PX)
    }
}

/// Marks the pixels within `reach` of an edge.
fn mark_swept(rays: &Rays, faces: &[u16], reach: usize, swept: &mut [u8], spare: &mut [u8]) {
    let (width, height) = (rays.width, rays.height);
    spare.par_chunks_mut(width).enumerate().for_each(|(row, line)| {
        spread(width, reach, |x| has_other_face(faces, width, height, x, row), line);
    });
    let spare = &*spare;
    let column = |x: usize| {
        let mut column = vec![0; height];
        spread(height, reach, |row| spare[row * width + x] == 1, &mut column);
        column
    };
    let columns: Vec<Vec<u8>> = (0..width).into_par_iter().map(column).collect();
    swept.par_chunks_mut(width).enumerate().for_each(|(row, line)| {
        line.iter_mut().zip(&columns).for_each(|(mark, column)| *mark = column[row]);
    });
}

/// Whether a pixel's neighbourhood shows more than one face.
#[inline]
pub(super) fn has_other_face(faces: &[u16], width: usize, height: usize, column: usize, row: usize) -> bool {
    let own = faces[row * width + column];
    let (left, right) = (column.saturating_sub(1), (column + 1).min(width - 1));
    (row.saturating_sub(1)..=(row + 1).min(height - 1))
        .any(|y| faces[y * width + left..=y * width + right].iter().any(|face| *face != own))
}

/// 1 within `reach` of where `is_set`.
fn spread(n: usize, reach: usize, is_set: impl Fn(usize) -> bool, out: &mut [u8]) {
    // The last one set up to k + reach.
    let mut last: Option<usize> = None;
    let mut next = 0;
    for (k, out) in out.iter_mut().enumerate().take(n) {
        while next < n && next <= k + reach {
            if is_set(next) {
                last = Some(next);
            }
            next += 1;
        }
        *out = u8::from(last.is_some_and(|set| set + reach >= k));
    }
}

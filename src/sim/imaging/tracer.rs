//! Intersection of rays with objects, in tiles of the image.

use crate::imaging::math::Vec3;
use crate::imaging::rays::Rays;
use crate::imaging::scene::{FACE_BITS, Object, TILE_PX, candidates, first_met};
use crate::imaging::seafloor_texture::Texture;
use crate::imaging::shader::Shader;
use crate::imaging::shape::Lanes;

/// Rays traced together.
const LANES: usize = 8;

/// Rays, objects and shading of one image.
#[derive(Clone, Copy)]
pub(super) struct Tracer<'a> {
    pub rays: &'a Rays,
    pub objects: &'a [Object<'a>],
    pub shader: &'a Shader,
    pub texture: &'a Texture,
}

/// Objects that the rays of one tile may meet.
pub(super) type Candidates = Vec<(f32, u16)>;

/// The object that a face belongs to.
#[inline]
pub(super) fn object_of(face: u16) -> Option<usize> {
    (face >> FACE_BITS).checked_sub(1).map(usize::from)
}

impl Tracer<'_> {
    pub(super) fn meet_band(&self, top: usize, faces: &mut [u16], ranges: &mut [f32]) -> Vec<Candidates> {
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
}

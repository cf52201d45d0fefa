//! Intersection of rays with objects, in tiles of the image.

use crate::imaging::math::Lanes;
use crate::imaging::rays::Rays;
use crate::imaging::scene::{Object, TILE_PX, candidates, first_met, narrow};
use crate::imaging::seafloor_texture::Texture;
use crate::imaging::shader::Shader;
use crate::imaging::shape::FACE_BITS;

/// Number of rays traced together.
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

/// Returns the object of a face.
#[inline]
pub(super) fn object_of(face: u16) -> Option<usize> {
    (face >> FACE_BITS).checked_sub(1).map(usize::from)
}

impl Tracer<'_> {
    pub(super) fn meet_band(&self, top: usize, faces: &mut [u16], ranges: &mut [f32]) -> Vec<Candidates> {
        let rays = self.rays;
        let rows = faces.len() / rays.width;
        let mut near = Candidates::new();
        let tile = |column: usize| {
            let found = candidates(self.objects, rays, column, top);
            let behind = (column + TILE_PX).min(rays.width);
            for y in (0..rows).step_by(LANES) {
                let below = (y + LANES).min(rows);
                for x in (column..behind).step_by(LANES) {
                    let right = (x + LANES).min(behind);
                    narrow(self.objects, rays, &found, [x, top + y, right, top + below], &mut near);
                    for row in y..below {
                        let out = row * rays.width + x..row * rays.width + right;
                        self.meet(&near, top * rays.width + out.start, &mut faces[out.clone()], &mut ranges[out]);
                    }
                }
            }
            found
        };
        (0..rays.width).step_by(TILE_PX).map(tile).collect()
    }

    /// Traces a few pixels from the `i`th on.
    fn meet(&self, found: &[(f32, u16)], i: usize, faces: &mut [u16], ranges: &mut [f32]) {
        let lanes: Lanes<LANES> = self.rays.several(i);
        let (range_m, number) = first_met(self.objects, found, &lanes);
        // A ray outside the field of view is zero, and its result is ignored.
        let sees = |k: usize| lanes.iter().any(|axis| axis[k] != 0.0);
        if number[0] > 0 && number == [number[0]; LANES] && (0..LANES).all(sees) {
            return self.mark(number[0], &Met { rays: lanes, range_m, first: i }, (faces, ranges));
        }
        faces.fill(0);
        ranges.fill(f32::INFINITY);
        for k in 0..faces.len() {
            if number[k] > 0 && sees(k) {
                let met = Met { rays: lanes.map(|axis| [axis[k]]), range_m: [range_m[k]], first: i + k };
                self.mark(number[k], &met, (&mut faces[k..=k], &mut ranges[k..=k]));
            }
        }
    }

    /// Writes faces and ranges of rays that all meet object `number` less one.
    #[inline]
    fn mark<const N: usize>(&self, number: u16, met: &Met<N>, (faces, ranges): (&mut [u16], &mut [f32])) {
        let object = &self.objects[usize::from(number - 1)];
        let (of_rays, true_m) = object.form.faces(&object.place, &met.rays, &met.range_m);
        ranges.copy_from_slice(&true_m[..ranges.len()]);
        for (k, face) in faces.iter_mut().enumerate() {
            // Neighbours on a fine pattern always differ.
            let of_pixel = if object.is_fine { ((met.first + k) & 1) as u16 } else { of_rays[k] };
            *face = number << FACE_BITS | of_pixel;
        }
    }
}

/// Rays of pixels in a row that meet one object.
struct Met<const N: usize> {
    rays: Lanes<N>,
    /// Ranges as returned by [`first_met`].
    range_m: [f32; N],
    /// Index of the first pixel.
    first: usize,
}

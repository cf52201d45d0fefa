//! Radiance of the pixels in a band of rows.
//!
//! A block of pixels that see one face is shaded at its corners and linear in between. A pixel with another face in its
//! neighbourhood, or swept by one while the shutter is open, is the mean of `SAMPLES` rays.

use crate::imaging::edges::has_other_face;
use crate::imaging::math::{Rgb, Vec3, lanes};
use crate::imaging::rays::first_of;
use crate::imaging::scene::{Appearance, Object, TILE_PX};
use crate::imaging::shader::Shade;
use crate::imaging::shape::FACE_BITS;
use crate::imaging::tag_board;
use crate::imaging::tracer::{Candidates, Tracer, object_of};

/// Sides of blocks that share their shading, px.
const BLOCKS_PX: [usize; 2] = [8, 4];

/// Rows of the image that one thread shades.
pub(super) struct Band<'a> {
    pub tracer: &'a Tracer<'a>,
    pub faces: &'a [u16],
    pub ranges: &'a [f32],
    pub swept: Option<&'a [u8]>,
    pub top: usize,
    pub planes: [&'a mut [f32]; 3],
}

/// Intersection of a ray with an object.
pub(super) struct Intersection {
    pub ray: Vec3,
    pub range_m: f32,
    pub face: u16,
    /// Outer normal, camera frame.
    pub normal: Vec3,
}

/// Shades of flat faces that a smallest block has already computed: they are the same within a few pixels.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ShadeCache {
    shades: [(u16, Shade); 4],
    n: usize,
}

impl ShadeCache {
    #[inline]
    pub(super) fn shade(&mut self, key: u16, object: &Object, make: impl FnOnce() -> Shade) -> Shade {
        if !object.form.is_flat() {
            return make();
        }
        let before = &self.shades[..self.n.min(self.shades.len())];
        if let Some((_, shade)) = before.iter().find(|(other, _)| *other == key) {
            return *shade;
        }
        let shade = make();
        self.shades[self.n % self.shades.len()] = (key, shade);
        self.n += 1;
        shade
    }
}

impl Tracer<'_> {
    /// Returns the shades of a face on the rays of some pixels at `range_m`, and the intersections.
    fn surface<const N: usize>(
        &self,
        face: u16,
        range_m: [f32; N],
        pixels: &[[usize; 2]; N],
    ) -> ([Shade; N], Option<[Intersection; N]>) {
        let Some(n) = object_of(face) else {
            return (pixels.map(|[column, row]| self.shader.open(column, row)), None);
        };
        let object = &self.objects[n];
        let met: [Intersection; N] = std::array::from_fn(|k| {
            let ray = self.rays.at(pixels[k][0], pixels[k][1]);
            let (_, _, normal) = object.form.meet(&object.place, &ray, range_m[k]);
            Intersection { ray, range_m: range_m[k], face, normal }
        });
        let points = std::array::from_fn(|k| met[k].ray * met[k].range_m);
        let normals = std::array::from_fn(|k| met[k].normal);
        (self.shader.shade(&points, &normals, pixels), Some(met))
    }

    #[inline]
    pub(super) fn albedo(&self, object: &Object, at: &Intersection) -> Rgb {
        match object.look {
            Appearance::Tag => tag_board::albedo(at.face & ((1 << FACE_BITS) - 1)),
            Appearance::Plain(albedo) => albedo,
            Appearance::Ground => {
                let [[x_m], [y_m], _] = object.place.points(&lanes(&[at.ray]), &[at.range_m]);
                self.texture.albedo(x_m, y_m, self.ground_level(&at.ray, at.range_m, &at.normal))
            }
        }
    }

    /// Returns the copy of the texture for a pixel.
    fn ground_level(&self, ray: &Vec3, range_m: f32, normal: &Vec3) -> usize {
        self.texture.level(range_m / (self.rays.focal_px * ray.dot(normal).abs().max(0.05)))
    }
}

impl Band<'_> {
    /// Shades the band; `tiles` has the candidates of each tile.
    pub(super) fn shade(&mut self, tiles: &[Candidates]) {
        let width = self.tracer.rays.width;
        let rows = self.planes[0].len() / width;
        for (column, found) in (0..width).step_by(TILE_PX).zip(tiles) {
            let right = (column + TILE_PX).min(width);
            for y in (0..rows).step_by(BLOCKS_PX[0]) {
                for x in (column..right).step_by(BLOCKS_PX[0]) {
                    let block = [x, y, (x + BLOCKS_PX[0]).min(right), (y + BLOCKS_PX[0]).min(rows)];
                    self.shade_block(block, 0, found);
                }
            }
        }
    }

    /// Shades a block of left, top, right, bottom; the last two are exclusive. Rows count within the band.
    fn shade_block(&mut self, block: [usize; 4], level: usize, found: &[(f32, u16)]) {
        let [left, top, right, bottom] = block;
        if self.is_uniform(block) {
            return self.fill(block);
        }
        if let Some(side) = BLOCKS_PX.get(level + 1) {
            for y in (top..bottom).step_by(*side) {
                for x in (left..right).step_by(*side) {
                    self.shade_block([x, y, (x + side).min(right), (y + side).min(bottom)], level + 1, found);
                }
            }
            return;
        }
        let mut known = ShadeCache::default();
        for y in top..bottom {
            for x in left..right {
                let rgb = self.pixel(x, self.top + y, found, &mut known);
                self.set(x, y, rgb);
            }
        }
    }

    fn pixel(&self, x: usize, row: usize, found: &[(f32, u16)], known: &mut ShadeCache) -> Rgb {
        let Tracer { rays, objects, .. } = self.tracer;
        if !rays.sees(x, row) {
            return [0.0; 3];
        }
        let i = row * rays.width + x;
        if let Some(swept) = self.swept {
            if swept[i] == 1 {
                return self.tracer.sampled(found, x, row, known);
            }
        } else if has_other_face(self.faces, rays.width, rays.height, x, row) {
            let mut near = [(0.0, 0_u16); 9];
            let n = self.neighbours(x, row, &mut near);
            return self.tracer.sampled(&near[..n], x, row, known);
        }
        let Some(object) = object_of(self.faces[i]).map(|n| &objects[n]) else {
            return self.tracer.shader.open(x, row).veil;
        };
        if object.look == Appearance::Tag {
            let tracer = self.tracer;
            let key = self.faces[i] & !((1 << FACE_BITS) - 1);
            let shade = known.shade(key, object, || {
                let ([shade], _) = tracer.surface(self.faces[i], [self.ranges[i]], &[[x, row]]);
                shade
            });
            return shade.radiance(&tag_board::albedo(self.faces[i] & ((1 << FACE_BITS) - 1)));
        }
        let ([shade], met) = self.tracer.surface(self.faces[i], [self.ranges[i]], &[[x, row]]);
        let albedo = met.map_or([0.0; 3], |[at]| self.tracer.albedo(object, &at));
        shade.radiance(&albedo)
    }

    /// Finds the objects that a pixel and its neighbours see, as candidates; returns their number.
    fn neighbours(&self, x: usize, row: usize, near: &mut [(f32, u16); 9]) -> usize {
        let Tracer { rays, .. } = self.tracer;
        let mut n = 0;
        for y in row.saturating_sub(1)..=(row + 1).min(rays.height - 1) {
            for x in x.saturating_sub(1)..=(x + 1).min(rays.width - 1) {
                let Some(object) = object_of(self.faces[y * rays.width + x]) else { continue };
                if near[..n].iter().all(|(_, other)| usize::from(*other) != object) {
                    near[n] = (0.0, object as u16);
                    n += 1;
                }
            }
        }
        n
    }

    /// Returns true if a block and the pixels around it show one face, in full view.
    fn is_uniform(&self, [left, top, right, bottom]: [usize; 4]) -> bool {
        let Tracer { rays, .. } = self.tracer;
        let (x0, x1) = (left.saturating_sub(1), (right + 1).min(rays.width));
        let (y0, y1) = ((self.top + top).saturating_sub(1), (self.top + bottom + 1).min(rays.height));
        let own = self.faces[y0 * rays.width + x0];
        (y0..y1).all(|y| {
            let line = y * rays.width + x0..y * rays.width + x1;
            let [first, behind] = rays.spans[y];
            x0 >= first
                && x1 <= behind
                // No branch per pixel.
                && self.faces[line.clone()].iter().fold(0, |other, face| other | (face ^ own)) == 0
                && self.swept.is_none_or(|swept| swept[line].iter().fold(0, |any, mark| any | mark) == 0)
        })
    }

    /// Shades a uniform block by its corners.
    fn fill(&mut self, block: [usize; 4]) {
        let [left, top, right, bottom] = block;
        let width = self.tracer.rays.width;
        let face = self.faces[(self.top + top) * width + left];
        let (above, below) = (self.top + top, self.top + bottom - 1);
        let corners = [[left, above], [right - 1, above], [left, below], [right - 1, below]];
        let range_m = corners.map(|[x, y]| self.ranges[y * width + x]);
        let (shades, met) = self.tracer.surface(face, range_m, &corners);
        let object = object_of(face).map(|n| &self.tracer.objects[n]);
        let radiance = match object.zip(met) {
            None => shades.map(|shade| shade.veil),
            Some((object, met)) if object.look == Appearance::Ground => {
                return self.fill_ground(block, object, &met[0], &shades);
            }
            Some((object, met)) => std::array::from_fn(|k| shades[k].radiance(&self.tracer.albedo(object, &met[k]))),
        };
        for y in top..bottom {
            for channel in 0..3 {
                let corner = radiance.map(|rgb| rgb[channel]);
                let (start, step) = line(&corner, y - top, bottom - top, right - left);
                let out = &mut self.planes[channel][y * width + left..y * width + right];
                out.iter_mut().enumerate().for_each(|(k, value)| *value = start + step * k as f32);
            }
        }
    }

    /// Shades a block of the seafloor: its light is linear, the texture is not. `first` is the pixel at the top left.
    fn fill_ground(
        &mut self,
        [left, top, right, bottom]: [usize; 4],
        object: &Object,
        first: &Intersection,
        corners: &[Shade; 4],
    ) {
        let Tracer { rays, texture, .. } = self.tracer;
        let level = self.tracer.ground_level(&first.ray, first.range_m, &first.normal);
        for y in top..bottom {
            let (row, rows, columns) = (y - top, bottom - top, right - left);
            let factor: [_; 3] = std::array::from_fn(|c| line(&corners.map(|s| s.factor[c]), row, rows, columns));
            let veil: [_; 3] = std::array::from_fn(|c| line(&corners.map(|s| s.veil[c]), row, rows, columns));
            let i = (self.top + y) * rays.width + left;
            let range_m = first_of(&self.ranges[i..]);
            let [x_m, y_m, _] = object.place.points::<{ BLOCKS_PX[0] }>(&rays.several(i), &range_m);
            for k in 0..columns {
                let albedo = texture.albedo(x_m[k], y_m[k], level);
                let at = |(start, step): (f32, f32)| start + step * k as f32;
                self.set(left + k, y, std::array::from_fn(|c| at(factor[c]) * albedo[c] + at(veil[c])));
            }
        }
    }

    #[inline]
    fn set(&mut self, x: usize, y: usize, rgb: Rgb) {
        let i = y * self.tracer.rays.width + x;
        self.planes.iter_mut().zip(rgb).for_each(|(plane, value)| plane[i] = value);
    }
}

/// Interpolates one row between four corners (top left, top right, bottom left, bottom right): returns the first value
/// and the step.
#[inline]
fn line(corner: &[f32; 4], row: usize, rows: usize, columns: usize) -> (f32, f32) {
    let down = row as f32 / (rows.max(2) - 1) as f32;
    let first = corner[0] + down * (corner[2] - corner[0]);
    let last = corner[1] + down * (corner[3] - corner[1]);
    (first, (last - first) / (columns.max(2) - 1) as f32)
}

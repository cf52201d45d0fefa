//! Objects of one image in the camera's frame, and the candidates of each tile of the image.

use nalgebra::{Isometry3, Point3};

use crate::imaging::math::{Lanes, Rgb, Vec3, max};
use crate::imaging::rays::Rays;
use crate::imaging::shape::{Form, Place};
use armcal_core::spatial::{exp, log};

/// Number of samples of position and time on a pixel that an edge crosses.
pub(super) const SAMPLES: usize = 32;
/// Side of a tile, px.
pub(super) const TILE_PX: usize = 32;
/// Smallest image motion during the exposure that counts as motion, px.
const STILL_PX: f32 = 0.01;
/// Width of cells in the image below which they are sampled everywhere, px.
const FINE_CELL_PX: f32 = 2.5;

/// Appearance of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Appearance {
    Tag,
    Plain(Rgb),
    /// Texture of the seafloor.
    Ground,
}

/// Object in front of the camera.
#[derive(Clone, Debug)]
pub(super) struct Object<'a> {
    pub form: &'a Form,
    pub look: Appearance,
    /// Pose halfway through the exposure.
    pub place: Place,
    /// Poses at each sample's time, if it moves against the camera.
    pub moving: Option<Box<[Place; SAMPLES]>>,
    /// Largest motion of its points in the image while the shutter is open, px.
    pub motion_px: f32,
    /// True if its pattern is too small in the image to find edges by comparing neighbouring pixels.
    pub is_fine: bool,
    /// Spheres that together contain it, camera frame.
    bounds: Vec<Bound>,
}

/// Poses at the three instants of an exposure.
pub(super) type Instants = [Isometry3<f64>; 3];

impl<'a> Object<'a> {
    /// Builds the object from `base_from_object` and `base_from_camera` when the shutter opens, halfway and when it
    /// closes.
    pub(super) fn new(
        form: &'a Form,
        look: Appearance,
        base_from_object: &Instants,
        base_from_camera: &Instants,
        focal_px: f32,
    ) -> Self {
        let relative: Instants = std::array::from_fn(|k| base_from_object[k].inverse() * base_from_camera[k]);
        let camera_from_object = relative[1].inverse();
        let (first, last) = (log(&(relative[1].inverse() * relative[0])), log(&(relative[1].inverse() * relative[2])));
        let bounds: Vec<(Vec3, f32)> = form
            .bounds()
            .into_iter()
            .map(|(center, radius)| ((camera_from_object * Point3::from(center)).coords.cast(), radius))
            .collect();
        let largest = |v: &dyn Fn(&nalgebra::Vector6<f64>) -> f64| v(&first).max(v(&last)) as f32;
        let (way_m, turn_rad) =
            (largest(&|xi| xi.fixed_rows::<3>(0).norm()), largest(&|xi| xi.fixed_rows::<3>(3).norm()));
        let range_m = bounds.iter().map(|(c, r)| c.norm() - r).fold(f32::INFINITY, f32::min).max(0.1);
        let motion_px = 2.0 * focal_px * (way_m / range_m + turn_rad);
        let moving = (motion_px > STILL_PX).then(|| {
            // Parabola through the three poses, in the tangent space at the middle one.
            Box::new(std::array::from_fn(|sample| {
                let t = 2.0 * f64::from(offset(sample)[2]);
                Place::new(&(relative[1] * exp(&(first * (0.5 * t * (t - 1.0)) + last * (0.5 * t * (t + 1.0))))))
            }))
        });
        let is_fine = matches!(form, Form::Tag(board) if {
            let eye = relative[1].translation.vector;
            let range_m = eye.norm().max(1e-3);
            focal_px * board.cell_m() * (eye.z.abs() / (range_m * range_m)) as f32 <= FINE_CELL_PX
        });
        let margin_rad = motion_px / focal_px;
        let bounds = bounds.iter().map(|(center, radius)| Bound::new(center, *radius, margin_rad)).collect();
        Self { form, look, place: Place::new(&relative[1]), moving, motion_px, is_fine, bounds }
    }

    /// Returns the pose at the time of a sample.
    #[inline]
    pub(super) fn place_at(&self, sample: usize) -> &Place {
        self.moving.as_ref().map_or(&self.place, |places| &places[sample])
    }
}

/// Returns a sample's position on its pixel, px from the centre, and its time in the exposure. Each is in -0.5..0.5
/// with mean 0. The samples are a rank-1 lattice (1, 7, 5)/32: its planes are 0.18 apart, and each coordinate takes 32
/// even steps.
pub(super) fn offset(sample: usize) -> [f32; 3] {
    [1, 7, 5].map(|step| (((sample * step) % SAMPLES) as f32 + 0.5) / SAMPLES as f32 - 0.5)
}

/// Sphere around part of an object, as a cone seen from the eye.
#[derive(Clone, Copy, Debug)]
struct Bound {
    towards: Vec3,
    nearest_m: f32,
    /// Cosine of the cone's half angle; a sphere that contains the eye fills all directions.
    cos: f32,
    sin: f32,
}

impl Bound {
    fn new(center: &Vec3, radius_m: f32, margin_rad: f32) -> Self {
        let range_m = center.norm();
        let half_rad =
            if range_m <= radius_m { std::f32::consts::PI } else { (radius_m / range_m).asin() + margin_rad };
        let half_rad = half_rad.min(std::f32::consts::PI);
        Self {
            towards: center / range_m.max(1e-6),
            nearest_m: (range_m - radius_m).max(0.0),
            cos: half_rad.cos(),
            sin: half_rad.sin(),
        }
    }
}

/// Cone around a tile's rays.
struct Cone {
    axis: Vec3,
    cos: f32,
    sin: f32,
}

/// Returns the objects that a tile's rays may meet, the nearest first, each with a lower bound of its range.
pub(super) fn candidates(objects: &[Object], rays: &Rays, column: usize, row: usize) -> Vec<(f32, u16)> {
    let Some(cone) = Cone::new(rays, column, row) else { return Vec::new() };
    let nearest = |object: &Object| {
        let seen = object.bounds.iter().filter(|bound| cone.touches(bound));
        seen.map(|bound| bound.nearest_m).fold(f32::INFINITY, f32::min)
    };
    let mut found: Vec<(f32, u16)> = objects
        .iter()
        .enumerate()
        .map(|(n, object)| (nearest(object), n as u16))
        .filter(|(m, _)| m.is_finite())
        .collect();
    found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    found
}

/// Selects the candidates of a tile that the rays of a small block in it may meet, in the same order. The block is
/// left, top, right, bottom; the last two are exclusive.
pub(super) fn narrow(
    objects: &[Object],
    rays: &Rays,
    found: &[(f32, u16)],
    block: [usize; 4],
    out: &mut Vec<(f32, u16)>,
) {
    out.clear();
    match Cone::of_block(rays, block) {
        None => out.extend_from_slice(found),
        Some(cone) => {
            let is_near =
                |(_, n): &&(f32, u16)| objects[usize::from(*n)].bounds.iter().any(|bound| cone.touches(bound));
            out.extend(found.iter().filter(is_near));
        }
    }
}

impl Cone {
    /// Returns the cone of a block; `None` if a corner is outside the field of view.
    fn of_block(rays: &Rays, [left, top, right, bottom]: [usize; 4]) -> Option<Self> {
        /// Margin for rounding, and for rays between the corners that are farther from the axis.
        const MARGIN_PX: f32 = 2.0;
        let corners = [(left, top), (right - 1, top), (left, bottom - 1), (right - 1, bottom - 1)];
        if !corners.iter().all(|&(x, y)| rays.sees(x, y)) {
            return None;
        }
        let corners = corners.map(|(x, y)| rays.at(x, y));
        let axis = corners.iter().sum::<Vec3>().try_normalize(1e-6)?;
        let cos = corners.iter().map(|ray| ray.dot(&axis)).fold(1.0, f32::min);
        let sin = max(1.0 - cos * cos, 0.0).sqrt();
        let margin_sin = MARGIN_PX / rays.focal_px;
        let margin_cos = (1.0 - margin_sin * margin_sin).sqrt();
        Some(Self { axis, cos: cos * margin_cos - sin * margin_sin, sin: sin * margin_cos + cos * margin_sin })
    }

    /// Returns the cone of a tile; `None` if it is outside the field of view.
    fn new(rays: &Rays, column: usize, row: usize) -> Option<Self> {
        /// Spacing of the rays on the rim that are used.
        const EVERY_PX: usize = 8;
        let (right, bottom) = ((column + TILE_PX).min(rays.width) - 1, (row + TILE_PX).min(rays.height) - 1);
        let steps = |from: usize, to: usize| (from..to).step_by(EVERY_PX).chain([to]);
        let rim = || {
            steps(column, right)
                .flat_map(move |x| [(x, row), (x, bottom)])
                .chain(steps(row, bottom).flat_map(move |y| [(column, y), (right, y)]))
                .filter(|&(x, y)| rays.sees(x, y))
                .map(|(x, y)| rays.at(x, y))
        };
        let axis = rim().sum::<Vec3>().try_normalize(1e-6)?;
        let cos = rim().map(|ray| ray.dot(&axis)).fold(1.0, f32::min);
        // The margin is for samples off the pixel centres, rays between those of the rim, and the edge of the field of
        // view.
        let half_rad = cos.clamp(-1.0, 1.0).acos() + 10.0 / rays.focal_px;
        Some(Self { axis, cos: half_rad.cos(), sin: half_rad.sin() })
    }

    #[inline]
    fn touches(&self, bound: &Bound) -> bool {
        // Compares the angle between the axes with the sum of the half angles, by their cosines.
        let together_cos = self.cos * bound.cos - self.sin * bound.sin;
        bound.cos <= -self.cos || bound.towards.dot(&self.axis) >= together_cos
    }
}

impl Form {
    /// Returns spheres that contain the form, own frame: several in a row if it is long.
    fn bounds(&self) -> Vec<(nalgebra::Vector3<f64>, f32)> {
        let half = match self {
            Self::Tag(board) => [board.half_m, board.half_m, 0.0],
            Self::Box { half } => *half,
            Self::Cylinder { radius, half } => [*radius, *radius, *half],
            Self::Capsule { radius, half } => [*radius, *radius, half + radius],
            Self::Sphere { radius } => return vec![(nalgebra::Vector3::zeros(), *radius)],
            Self::Hull { radius, .. } => return vec![(nalgebra::Vector3::zeros(), *radius)],
        };
        let long = (0..3).fold(0, |best, i| if half[i] > half[best] { i } else { best });
        let across = (0..3).filter(|&i| i != long).map(|i| half[i] * half[i]).sum::<f32>().sqrt();
        let n = (half[long] / across.max(1e-3)).ceil().clamp(1.0, 16.0);
        let each = half[long] / n;
        let radius = across.hypot(each) * 1.0001;
        (0..n as usize)
            .map(|k| {
                let mut center = nalgebra::Vector3::zeros();
                center[long] = f64::from(-half[long] + each * (2.0 * k as f32 + 1.0));
                (center, radius)
            })
            .collect()
    }
}

/// Returns the largest of several ranges.
#[inline]
pub(super) fn farthest<const N: usize>(range: &[f32; N]) -> f32 {
    range.iter().fold(f32::NEG_INFINITY, |most, range| max(most, *range))
}

/// Returns the nearest object on each of several rays at one time: range, and number plus one.
#[inline]
pub(super) fn first_met<const N: usize>(
    objects: &[Object],
    candidates: &[(f32, u16)],
    rays: &Lanes<N>,
) -> ([f32; N], [u16; N]) {
    let (mut range, mut number) = ([f32::INFINITY; N], [0; N]);
    for &(nearest_m, n) in candidates {
        if farthest(&range) < nearest_m {
            break;
        }
        let object = &objects[n as usize];
        let entered = object.form.enter(&object.place, rays);
        for k in 0..N {
            if entered[k] < range[k] {
                (range[k], number[k]) = (entered[k], n + 1);
            }
        }
    }
    (range, number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::optics::fixture::lens;
    use armcal_core::robot::Shape;
    use armcal_core::stats::stream_rng;
    use nalgebra::Vector3;
    use rand::RngExt;

    /// Every pixel of every block meets the same object, at the same range, as with all objects as candidates.
    #[test]
    fn narrowed_candidates_lack_nothing_that_a_ray_meets() {
        let shapes = [
            Shape::Box { size_m: [0.02, 0.03, 1.2] },
            Shape::Cylinder { radius_m: 0.05, length_m: 0.6 },
            Shape::Capsule { radius_m: 0.03, length_m: 0.5 },
            Shape::Sphere { radius_m: 0.01 },
        ];
        let forms = shapes.map(|shape| Form::of_shape(&shape));
        let mut rng = stream_rng(5, "narrow");
        let mut draw = |span: f64| rng.random_range(-span..span);
        let objects: Vec<Object> = (0..60)
            .map(|n| {
                let place = Vector3::new(draw(2.0), draw(2.0), 1.0 + draw(0.9));
                let base_from_object = Isometry3::new(place, Vector3::new(draw(3.0), draw(3.0), draw(3.0)));
                let look = Appearance::Plain([0.5; 3]);
                Object::new(&forms[n % 4], look, &[base_from_object; 3], &[Isometry3::identity(); 3], 400.0)
            })
            .collect();
        let all: Vec<(f32, u16)> = (0..60).map(|n| (0.0, n)).collect();
        let rays = Rays::new(&lens());
        let (mut near, mut n_met, mut n_left) = (Vec::new(), 0, 0);
        for row in (0..rays.height).step_by(8) {
            for column in (0..rays.width).step_by(8) {
                let (right, bottom) = ((column + 8).min(rays.width), (row + 8).min(rays.height));
                let tile = candidates(&objects, &rays, column / TILE_PX * TILE_PX, row / TILE_PX * TILE_PX);
                narrow(&objects, &rays, &tile, [column, row, right, bottom], &mut near);
                n_left += tile.len() - near.len();
                for y in row..bottom {
                    let ray: Lanes<8> = rays.several(y * rays.width + column);
                    let sees = (0..right - column).filter(|k| rays.sees(column + k, y));
                    let (narrowed, whole) = (first_met(&objects, &near, &ray), first_met(&objects, &all, &ray));
                    for k in sees {
                        assert_eq!((narrowed.0[k], narrowed.1[k]), (whole.0[k], whole.1[k]), "{} {y}", column + k);
                        n_met += usize::from(whole.1[k] > 0);
                    }
                }
            }
        }
        assert!(n_met > 50_000 && n_left > 5_000, "{n_met} met, {n_left} left out");
    }
}

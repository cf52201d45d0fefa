//! Radiance of a surface: `albedo * factor + veil`.
//!
//! Lambert: `factor = E / pi exp(-bD z)` with the illuminance E of lamps and sun. The veil at infinity is the light
//! that the water itself sends back. Lit by the lamps it is `Binf = integral of b p E(s) exp(-bD s) ds` along the ray
//! (single scattering), on a coarse grid of rays. Lit by the sun it is `E b / (4 pi bB)` (assumed: even in all
//! directions). Lamps cast no shadows.

use std::f32::consts::{FRAC_1_PI, PI};

use nalgebra::Isometry3;

use crate::imaging::light::{Lamp, Light};
use crate::imaging::math::{Lanes, Rgb, Vec3, exp, lanes};
use crate::imaging::rays::Rays;
use crate::imaging::water::Water;
use crate::spec::ImageSpec;

/// Spacing of the veil's nodes, px.
const NODE_PX: usize = 16;
/// Number of ranges at which the veil's integral is sampled: even steps of the root, so that near ones are close.
const STEPS: usize = 16;

/// Lights and water of one image.
#[derive(Clone, Debug)]
pub(super) struct Shader {
    pub water: Water,
    pub lamps: Vec<Lamp>,
    ambient_lux: f32,
    /// Direction to the surface of the sea, camera frame.
    up: Vec3,
    veil: Veil,
    /// True without lamps and water: then light comes evenly from all sides, and there is no up and down.
    is_even: bool,
}

/// Veil `Binf` on a grid over the image, linear in between.
#[derive(Clone, Debug, Default)]
struct Veil {
    columns: usize,
    nodes: Vec<Rgb>,
}

/// Coefficients of the radiance: `radiance = albedo * factor + veil`, cd/m2.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shade {
    pub factor: Rgb,
    pub veil: Rgb,
}

impl Shader {
    pub(super) fn new(
        spec: &ImageSpec,
        lights: &[Light],
        camera_from_base: &Isometry3<f64>,
        up: &nalgebra::Vector3<f64>,
        rays: &Rays,
    ) -> Self {
        let mut shader = Self {
            water: Water::new(spec),
            lamps: lights.iter().map(|light| Lamp::new(light, camera_from_base)).collect(),
            ambient_lux: spec.ambient_lux as f32,
            up: (camera_from_base.rotation * up).cast(),
            veil: Veil::default(),
            is_even: lights.is_empty() && spec.turbidity == 0.0,
        };
        shader.veil = shader.spread_veil(spec, rays);
        shader
    }

    fn spread_veil(&self, spec: &ImageSpec, rays: &Rays) -> Veil {
        use rayon::prelude::*;
        let columns = rays.width.div_ceil(NODE_PX) + 1;
        let rows = rays.height.div_ceil(NODE_PX) + 1;
        let given = spec.veil_cd_m2.map(|veil| veil.map(|v| v as f32));
        let has_lamps = !self.lamps.is_empty() && self.water.in_scatter_per_m_sr.iter().any(|b| *b > 0.0);
        let sunny: Rgb = std::array::from_fn(|k| {
            let back = self.water.backscatter_per_m[k];
            if back > 0.0 { self.ambient_lux * self.water.scatter_per_m[k] / (4.0 * PI * back) } else { 0.0 }
        });
        let path = BackPath::new(&self.water);
        let node = |n: usize| {
            if let Some(given) = given {
                return given;
            }
            let (column, row) =
                ((n % columns * NODE_PX).min(rays.width - 1), (n / columns * NODE_PX).min(rays.height - 1));
            let mut veil = sunny;
            if has_lamps {
                // Outside the field of view, the nearest ray in it is used.
                let [first, behind] = rays.spans[row];
                if first < behind {
                    self.scattered_back(&path, &rays.at(column.clamp(first, behind - 1), row), &mut veil);
                }
            }
            veil
        };
        Veil { columns, nodes: (0..columns * rows).into_par_iter().map(node).collect() }
    }

    /// Adds the lamps' light that the water on a ray sends back.
    fn scattered_back(&self, path: &BackPath, ray: &Vec3, sum: &mut Rgb) {
        let points: Lanes<STEPS> = std::array::from_fn(|axis| path.middle_m.map(|m| ray[axis] * m));
        let mut lux = [[0.0; STEPS]; 3];
        for lamp in &self.lamps {
            lamp.light_up_all_sides(&points, &self.water.direct_per_m, &mut lux);
        }
        for c in 0..3 {
            let kept = self.water.in_scatter_per_m_sr[c];
            for ((lux, left), length_m) in lux[c].iter().zip(&path.left[c]).zip(&path.length_m) {
                sum[c] += kept * lux * left * length_m;
            }
        }
    }

    /// Returns the veil at infinity at a pixel.
    #[inline]
    pub(super) fn veil_at(&self, column: usize, row: usize) -> Rgb {
        let Veil { columns, nodes } = &self.veil;
        let (i, j) = (column / NODE_PX, row / NODE_PX);
        let part = |x: usize| (x % NODE_PX) as f32 / NODE_PX as f32;
        let (u, v) = (part(column), part(row));
        let n = j * columns + i;
        let (a, b, c, d) = (&nodes[n], &nodes[n + 1], &nodes[n + columns], &nodes[n + columns + 1]);
        std::array::from_fn(|k| (1.0 - v) * (a[k] + u * (b[k] - a[k])) + v * (c[k] + u * (d[k] - c[k])))
    }

    /// Returns the shade of open water.
    #[inline]
    pub(super) fn open(&self, column: usize, row: usize) -> Shade {
        Shade { factor: [0.0; 3], veil: self.veil_at(column, row) }
    }

    /// Returns the shades of surfaces at `points` (camera frame) with unit normals `normals`, seen at pixels (column,
    /// row).
    #[inline]
    pub(super) fn shade<const N: usize>(
        &self,
        points: &[Vec3; N],
        normals: &[Vec3; N],
        pixels: &[[usize; 2]; N],
    ) -> [Shade; N] {
        let sky = normals.map(|normal| if self.is_even { 1.0 } else { 0.5 + 0.5 * normal.dot(&self.up) });
        let mut lux: Lanes<N> = [sky.map(|sky| self.ambient_lux * sky); 3];
        let (points, normals) = (lanes(points), lanes(normals));
        for lamp in &self.lamps {
            lamp.light_up(&points, &normals, &self.water.direct_per_m, &mut lux);
        }
        let mut range_m = [0.0; N];
        for (k, range_m) in range_m.iter_mut().enumerate() {
            *range_m = points.iter().map(|axis| axis[k] * axis[k]).sum::<f32>().sqrt();
        }
        let (mut left, mut veiled) = ([[0.0; N]; 3], [[0.0; N]; 3]);
        for c in 0..3 {
            let (direct, back) = (self.water.direct_per_m[c], self.water.backscatter_per_m[c]);
            for k in 0..N {
                left[c][k] = exp(-direct * range_m[k]);
                veiled[c][k] = 1.0 - exp(-back * range_m[k]);
            }
        }
        std::array::from_fn(|k| {
            let far = self.veil_at(pixels[k][0], pixels[k][1]);
            Shade {
                factor: std::array::from_fn(|c| lux[c][k] * FRAC_1_PI * left[c][k]),
                veil: std::array::from_fn(|c| far[c] * veiled[c][k]),
            }
        })
    }
}

/// Steps of the veil's integral, the same for all rays of an image.
struct BackPath {
    middle_m: [f32; STEPS],
    length_m: [f32; STEPS],
    /// Transmission of the water on the way back, by colour.
    left: Lanes<STEPS>,
}

impl BackPath {
    fn new(water: &Water) -> Self {
        let clearest_per_m = water.direct_per_m.iter().fold(f32::INFINITY, |a, b| a.min(*b));
        let far_m = (4.0 / clearest_per_m.max(0.01)).min(12.0);
        let at = |k: f32| far_m * (k / STEPS as f32).powi(2);
        let middle_m: [f32; STEPS] = std::array::from_fn(|step| at(step as f32 + 0.5));
        Self {
            middle_m,
            length_m: std::array::from_fn(|step| at(step as f32 + 1.0) - at(step as f32)),
            left: water.direct_per_m.map(|per_m| middle_m.map(|m| exp(-per_m * m))),
        }
    }
}

impl Shade {
    #[inline]
    pub(super) fn radiance(&self, albedo: &Rgb) -> Rgb {
        std::array::from_fn(|k| albedo[k] * self.factor[k] + self.veil[k])
    }
}

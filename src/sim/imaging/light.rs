//! Lamps: a beam with inverse square falloff, attenuated on its way.

use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::imaging::math::{Lanes, Rgb, Vec3, exp, exp2, max};

/// White lamp in the base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Position of the source.
    pub position_m: Point3<f64>,
    /// Axis of the beam, away from the source.
    pub direction: Unit<Vector3<f64>>,
    /// Luminous flux.
    pub flux_lm: f64,
    /// Angle from the beam's axis to half of the intensity, rad.
    pub half_angle_rad: f64,
}

/// Lamp in the camera's frame. At angle `a` from its axis its intensity is `I0 2^(-(1 - cos a)/(1 - cos half))` cd
/// (assumed); `I0` follows from the flux over the whole sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lamp {
    position: Vec3,
    direction: Vec3,
    intensity_cd: f32,
    /// Beam coefficient `1 / (1 - cos(half))`.
    narrowness: f32,
}

impl Lamp {
    pub(super) fn new(light: &Light, camera_from_base: &Isometry3<f64>) -> Self {
        let narrowness = 1.0 / (1.0 - light.half_angle_rad.cos());
        let solid_angle_sr =
            std::f64::consts::TAU * (1.0 - (-2.0 * narrowness).exp2()) / (narrowness * std::f64::consts::LN_2);
        Self {
            position: (camera_from_base * light.position_m).coords.cast(),
            direction: (camera_from_base.rotation * light.direction.into_inner()).cast(),
            intensity_cd: (light.flux_lm / solid_angle_sr) as f32,
            narrowness: narrowness as f32,
        }
    }

    /// Returns the light through a unit area across the rays at `points`, lx, without the water's losses. The other
    /// results are the lengths of the paths, m, and the unit vectors towards the lamp.
    #[inline]
    fn arriving<const N: usize>(&self, points: &Lanes<N>) -> ([f32; N], [f32; N], Lanes<N>) {
        /// Square of the distance within which a lamp is not a point source, m2.
        const SIZE_M2: f32 = 0.0025;
        let (mut lux, mut way_m, mut towards) = ([0.0; N], [0.0; N], [[0.0; N]; 3]);
        let [ax, ay, az]: [f32; 3] = self.direction.into();
        for k in 0..N {
            let [x, y, z]: [f32; 3] = std::array::from_fn(|axis| self.position[axis] - points[axis][k]);
            let square = max(x * x + y * y + z * z, SIZE_M2);
            way_m[k] = square.sqrt();
            let [x, y, z] = [x / way_m[k], y / way_m[k], z / way_m[k]];
            let cos = -(x * ax + y * ay + z * az);
            lux[k] = self.intensity_cd / square * exp2((cos - 1.0) * self.narrowness);
            (towards[0][k], towards[1][k], towards[2][k]) = (x, y, z);
        }
        (lux, way_m, towards)
    }

    /// Adds the illuminance of surfaces of unit normals `normals` at `points`, lx, to `sum`, colour by colour.
    #[inline]
    pub(super) fn light_up<const N: usize>(
        &self,
        points: &Lanes<N>,
        normals: &Lanes<N>,
        per_m: &Rgb,
        sum: &mut Lanes<N>,
    ) {
        let (mut lux, way_m, towards) = self.arriving(points);
        for k in 0..N {
            let across = towards[0][k] * normals[0][k] + towards[1][k] * normals[1][k] + towards[2][k] * normals[2][k];
            lux[k] *= max(across, 0.0);
        }
        add_attenuated(&lux, &way_m, per_m, sum);
    }

    /// Adds the illuminance of particles at `points`, lx, to `sum`, colour by colour.
    #[inline]
    pub(super) fn light_up_all_sides<const N: usize>(&self, points: &Lanes<N>, per_m: &Rgb, sum: &mut Lanes<N>) {
        let (lux, way_m, _) = self.arriving(points);
        add_attenuated(&lux, &way_m, per_m, sum);
    }
}

/// Adds `lux` after its attenuation by the water over `way_m`.
#[inline]
fn add_attenuated<const N: usize>(lux: &[f32; N], way_m: &[f32; N], per_m: &Rgb, sum: &mut Lanes<N>) {
    for (sum, per_m) in sum.iter_mut().zip(per_m) {
        for k in 0..N {
            sum[k] += lux[k] * exp(-per_m * way_m[k]);
        }
    }
}

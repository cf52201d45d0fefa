//! Lamps: a beam with inverse square falloff, attenuated on its way.

use nalgebra::{Isometry3, Point3, Unit, Vector3};

use crate::imaging::math::{Rgb, Vec3, exp, exp2, max};

/// A white lamp in the base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Position of the source.
    pub position_m: Point3<f64>,
    /// Axis of the beam, away from the source.
    pub direction: Unit<Vector3<f64>>,
    /// Luminous flux.
    pub flux_lm: f64,
    /// From the beam's axis to where it has half its intensity, rad.
    pub half_angle_rad: f64,
}

/// A lamp in the camera's frame. At angle `a` from its axis it has `I0 2^(-(1 - cos a)/(1 - cos half))` cd (assumed);
/// `I0` follows from the flux over the whole sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lamp {
    position: Vec3,
    direction: Vec3,
    intensity_cd: f32,
    /// 1 / (1 - cos(half)).
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

    /// Light through a unit area across the ray at `point`, lx, without the water's losses, the way's length, and the
    /// unit vector towards the lamp.
    #[inline]
    fn arriving(&self, point: &Vec3) -> (f32, f32, Vec3) {
        /// Nearer than this a lamp is no point.
        const SIZE_M2: f32 = 0.0025;
        let to_lamp = self.position - point;
        let square = max(to_lamp.norm_squared(), SIZE_M2);
        let way_m = square.sqrt();
        let towards = to_lamp / way_m;
        let cos = -towards.dot(&self.direction);
        (self.intensity_cd / square * exp2((cos - 1.0) * self.narrowness), way_m, towards)
    }

    /// Illuminance of a surface of unit normal `normal` at `point`, lx, added to `sum`.
    #[inline]
    pub(super) fn light_up(&self, point: &Vec3, normal: &Vec3, per_m: &Rgb, sum: &mut Rgb) {
        let (lux, way_m, towards) = self.arriving(point);
        let across = towards.dot(normal);
        if across <= 0.0 {
            return;
        }
        for (sum, per_m) in sum.iter_mut().zip(per_m) {
            *sum += lux * across * exp(-per_m * way_m);
        }
    }

    /// Illuminance of a particle at `point`, lx, added to `sum`.
    #[inline]
    pub(super) fn light_up_all_sides(&self, point: &Vec3, per_m: &Rgb, sum: &mut Rgb) {
        let (lux, way_m, _) = self.arriving(point);
        for (sum, per_m) in sum.iter_mut().zip(per_m) {
            *sum += lux * exp(-per_m * way_m);
        }
    }
}

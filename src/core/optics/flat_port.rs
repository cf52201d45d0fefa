//! Refraction by a flat window between lens and water.
//!
//! The lens's pupil is on the optical axis, which is the window's normal. A ray of tangent u in air has the sine
//! `s = u / sqrt(1 + u^2)` times the index in each layer. At depth z it reaches the radius
//! `r = d u + t s / sqrt(ng^2 - s^2) + (z - d - t) s / sqrt(nw^2 - s^2)` (Snell; the axial camera of Agrawal et al.
//! 2012). Newton's method solves for u; its derivatives by r and z follow from the same equation.

use nalgebra::{Matrix3, Unit, Vector3};

/// A plane window in front of the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatPort {
    /// Distance from the lens's pupil to the window.
    pub distance_m: f64,
    /// Thickness of the window.
    pub thickness_m: f64,
    /// Refractive index of the window over that of air.
    pub glass_index: f64,
    /// Refractive index of the water over that of air.
    pub water_index: f64,
}

/// Range at which rays through the port are treated as rays from the pupil, m.
const USUAL_RANGE_M: f64 = 1.0;
/// Largest tangent in air: half a milliradian from grazing.
const STEEPEST: f64 = 2000.0;

/// A ray in air that reaches a point, and the derivatives of its tangent.
struct Ray {
    /// Tangent over the point's radius.
    tangent_per_m: f64,
    by_radius: f64,
    by_depth: f64,
}

impl FlatPort {
    /// Returns the radius that a ray of tangent `u` reaches at a depth beyond the window, and d/du.
    fn radius(&self, u: f64, wet_m: f64) -> [f64; 2] {
        let sine = u / (1.0 + u * u).sqrt();
        let sine_slope = (1.0 + u * u).powf(-1.5);
        let layers = [(self.thickness_m, self.glass_index), (wet_m, self.water_index)];
        layers.iter().fold([self.distance_m * u, self.distance_m], |[radius, slope], (length_m, index)| {
            let below = index * index - sine * sine;
            let by_sine = length_m * index * index * below.powf(-1.5);
            [radius + length_m * sine / below.sqrt(), slope + by_sine * sine_slope]
        })
    }

    /// Returns the ray that reaches a point; `None` if the point is not in the water or no ray reaches it.
    fn ray(&self, radius_m: f64, depth_m: f64) -> Option<Ray> {
        let wet_m = depth_m - self.distance_m - self.thickness_m;
        if wet_m.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) || self.radius(STEEPEST, wet_m)[0] < radius_m {
            return None;
        }
        // Newton's method in a shrinking bracket, from the ray near the axis.
        let (mut low, mut high) = (0.0, STEEPEST);
        let mut u = (radius_m / self.radius(0.0, wet_m)[1]).min(STEEPEST);
        for _ in 0..100 {
            let [reached_m, slope] = self.radius(u, wet_m);
            if reached_m > radius_m {
                high = u;
            } else {
                low = u;
            }
            let newton = u - (reached_m - radius_m) / slope;
            let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
            let is_done = (next - u).abs() <= 1e-15 * (1.0 + u);
            u = next;
            if is_done {
                break;
            }
        }
        let slope = self.radius(u, wet_m)[1];
        let sine = u / (1.0 + u * u).sqrt();
        let by_depth = -sine / (self.water_index * self.water_index - sine * sine).sqrt() / slope;
        let tangent_per_m = if radius_m > 1e-12 * depth_m { u / radius_m } else { 1.0 / slope };
        Some(Ray { tangent_per_m, by_radius: 1.0 / slope, by_depth })
    }

    /// Returns the direction in air, at unit depth, of the ray from a point in the water (camera frame, m) to the lens.
    #[must_use]
    pub fn direction_in_air(&self, point_m: &Vector3<f64>) -> Option<Vector3<f64>> {
        let ray = self.ray(point_m.x.hypot(point_m.y), point_m.z)?;
        Some(Vector3::new(point_m.x * ray.tangent_per_m, point_m.y * ray.tangent_per_m, 1.0))
    }

    /// Returns the direction in air, at unit depth, with d(direction)/d(point).
    #[must_use]
    pub fn direction_with_jacobian(&self, point_m: &Vector3<f64>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let (x, y) = (point_m.x, point_m.y);
        let radius_m = x.hypot(y);
        let Ray { tangent_per_m: across, by_radius: along, by_depth } = self.ray(radius_m, point_m.z)?;
        let (ux, uy) = if radius_m > 0.0 { (x / radius_m, y / radius_m) } else { (0.0, 0.0) };
        let both = (along - across) * ux * uy;
        let jacobian = Matrix3::new(
            across + (along - across) * ux * ux,
            both,
            by_depth * ux,
            both,
            across + (along - across) * uy * uy,
            by_depth * uy,
            0.0,
            0.0,
            0.0,
        );
        Some((Vector3::new(x * across, y * across, 1.0), jacobian))
    }

    /// Returns the direction from the pupil to the point at 1 m on the ray of `direction` in air. Rays through a window
    /// do not meet in one point, so the direction is exact at 1 m and approximate at other ranges. `None` for a ray
    /// that does not pass the window.
    #[must_use]
    pub fn direction_in_water(&self, direction: &Unit<Vector3<f64>>) -> Option<Unit<Vector3<f64>>> {
        let sine = direction.x.hypot(direction.y);
        if direction.z <= 1.0 / STEEPEST {
            return None;
        }
        let u = sine / direction.z;
        let tangent = sine / (self.water_index * self.water_index - sine * sine).sqrt();
        let wet_m = USUAL_RANGE_M / tangent.hypot(1.0);
        let radius_m = self.radius(u, wet_m)[0];
        let scale = if sine > 0.0 { radius_m / sine } else { 0.0 };
        let depth_m = self.distance_m + self.thickness_m + wet_m;
        Some(Unit::new_normalize(Vector3::new(direction.x * scale, direction.y * scale, depth_m)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Applies Snell's law in vectors at a plane across z.
    fn refracted(direction: &Vector3<f64>, from: f64, to: f64) -> Vector3<f64> {
        let (ratio, normal) = (from / to, -Vector3::z());
        let cos_in = -normal.dot(direction);
        let cos_out = (1.0 - ratio * ratio * (1.0 - cos_in * cos_in)).sqrt();
        direction * ratio + normal * (ratio * cos_in - cos_out)
    }

    fn traced(port: &FlatPort, start: &Vector3<f64>, range_m: f64) -> Vector3<f64> {
        let direction = start.normalize();
        let glass = refracted(&direction, 1.0, port.glass_index);
        let water = refracted(&glass, port.glass_index, port.water_index);
        direction * (port.distance_m / direction.z) + glass * (port.thickness_m / glass.z) + water * range_m
    }

    fn port(distance_m: f64, thickness_m: f64) -> FlatPort {
        FlatPort { distance_m, thickness_m, glass_index: 1.49, water_index: 1.333 }
    }

    proptest! {
        #[test]
        fn a_traced_ray_is_found_again(
            angle in 0.0f64..1.45, azimuth in -3.1f64..3.1, range_m in 0.05f64..5.0,
            distance_m in 0.0f64..0.2, thickness_m in 0.0f64..0.05,
        ) {
            let start = Vector3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos());
            let port = port(distance_m, thickness_m);
            let seen = port.direction_in_air(&traced(&port, &start, range_m)).expect("a ray reaches it");
            let apart = seen.normalize().cross(&start).norm();
            prop_assert!(apart < 1e-12, "{apart} rad apart");
        }

        #[test]
        fn a_ray_in_air_meets_its_point_in_water(angle in 0.0f64..1.4, azimuth in -3.1f64..3.1) {
            let start = Vector3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos());
            let port = port(0.02, 0.01);
            let ahead = port.direction_in_water(&Unit::new_normalize(start)).expect("leaves");
            let point = traced(&port, &start, 1.0);
            prop_assert!(ahead.cross(&point.normalize()).norm() < 1e-12);
        }

        #[test]
        fn the_jacobian_is_that_of_differences(
            x in -1.5f64..1.5, y in -1.5f64..1.5, z in 0.1f64..2.0,
            distance_m in 0.001f64..0.05, thickness_m in 0.0f64..0.03,
        ) {
            let (port, point) = (port(distance_m, thickness_m), Vector3::new(x, y, z));
            let Some((_, jacobian)) = port.direction_with_jacobian(&point) else { return Ok(()) };
            let h = 1e-6;
            for axis in 0..3 {
                let step = Vector3::ith(axis, h);
                let ends = [point + step, point - step].map(|p| port.direction_in_air(&p));
                let [Some(plus), Some(minus)] = ends else { return Ok(()) };
                let difference = (plus - minus) / (2.0 * h);
                prop_assert!((jacobian.column(axis) - difference).norm() < 1e-5 * (1.0 + difference.norm()));
            }
        }
    }

    #[test]
    fn near_the_axis_angles_grow_by_the_waters_index() {
        let port = port(1e-9, 0.0);
        let (seen, jacobian) = port.direction_with_jacobian(&Vector3::new(0.0, 0.0, 1.0)).expect("in the water");
        assert_eq!(seen, Vector3::z());
        assert!((jacobian[(0, 0)] - 1.333).abs() < 1e-8 && jacobian[(2, 2)] == 0.0);
    }
}

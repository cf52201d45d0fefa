//! Refraction by the port between lens and water.
//!
//! Flat port: with `s = sin` of the angle in air, a ray reaches the radius
//! `d tan(a) + t s / sqrt(ng^2 - s^2) + (z - d - t) s / sqrt(nw^2 - s^2)` at depth z. Dome: concentric spheres keep
//! `n b` constant (b the ray's distance from their centre; Bouguer's formula). A ray leaves with `b / nw`, turned
//! towards the centre's side by `asin(b / Ri) - asin(b / ng Ri) + asin(b / ng Ro) - asin(b / nw Ro)`. Both are solved
//! for the ray that meets a point. Indices: air 1, acrylic 1.49, water 1.333 (sea water: up to 1.34).

use nalgebra::Vector3;

/// Refractive index of acrylic.
pub(super) const GLASS_INDEX: f64 = 1.49;
pub(super) const WATER_INDEX: f64 = 1.333;

/// Window in front of a lens; lengths in the camera's frame.
#[derive(Clone, Copy, Debug)]
pub(super) enum Port {
    None,
    Dome { center_m: Vector3<f64>, inner_radius_m: f64, thickness_m: f64 },
    Flat { distance_m: f64, thickness_m: f64 },
}

impl Port {
    /// Returns the direction in air of the ray from a point in the water to the lens (camera frame, any length). `None`
    /// for a point that is not in the water or that no ray reaches.
    pub(super) fn direction_in_air(&self, point_m: &Vector3<f64>) -> Option<Vector3<f64>> {
        match *self {
            Self::None => Some(*point_m),
            Self::Flat { distance_m, thickness_m } => through_plane(point_m, distance_m, thickness_m),
            Self::Dome { center_m, inner_radius_m, thickness_m } => {
                through_sphere(point_m, &center_m, inner_radius_m, inner_radius_m + thickness_m)
            }
        }
    }
}

fn through_plane(point_m: &Vector3<f64>, distance_m: f64, thickness_m: f64) -> Option<Vector3<f64>> {
    /// Largest tangent in air: half a milliradian from grazing.
    const STEEPEST: f64 = 2000.0;
    let wet_m = point_m.z - distance_m - thickness_m;
    let radius_m = point_m.x.hypot(point_m.y);
    if wet_m <= 0.0 {
        return None;
    }
    if radius_m < 1e-12 * point_m.z {
        return Some(*point_m);
    }
    // Radius that a ray of tangent u in air reaches, and its derivative.
    let radius_at = |u: f64| {
        let sine = u / (1.0 + u * u).sqrt();
        let sine_slope = (1.0 + u * u).powf(-1.5);
        let layer = |length_m: f64, index: f64| {
            let below = index * index - sine * sine;
            (length_m * sine / below.sqrt(), length_m * index * index * below.powf(-1.5) * sine_slope)
        };
        let ((glass, glass_slope), (water, water_slope)) = (layer(thickness_m, GLASS_INDEX), layer(wet_m, WATER_INDEX));
        (distance_m * u + glass + water, distance_m + glass_slope + water_slope)
    };
    if radius_at(STEEPEST).0 < radius_m {
        return None;
    }
    // Newton's method with a shrinking bracket, from the paraxial ray.
    let (mut low, mut high) = (0.0, STEEPEST);
    let mut u = (WATER_INDEX * radius_m / point_m.z).min(STEEPEST);
    for _ in 0..100 {
        let (radius_at_u_m, slope) = radius_at(u);
        if radius_at_u_m > radius_m {
            high = u
        } else {
            low = u
        }
        let newton = u - (radius_at_u_m - radius_m) / slope;
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        let is_done = (next - u).abs() <= 1e-15 * (1.0 + u);
        u = next;
        if is_done {
            break;
        }
    }
    Some(Vector3::new(point_m.x / radius_m * u, point_m.y / radius_m * u, 1.0))
}

fn through_sphere(point_m: &Vector3<f64>, center_m: &Vector3<f64>, inner_m: f64, outer_m: f64) -> Option<Vector3<f64>> {
    // Pupil and point relative to the sphere's centre. All normals pass through the centre, so the ray stays in the
    // plane of the three, with axes along the line of sight and across it.
    let (pupil, point) = (-center_m, point_m - center_m);
    if point.norm() <= outer_m {
        return None;
    }
    let along = point_m.normalize();
    let across = pupil - along * pupil.dot(&along);
    let aside_m = across.norm();
    if aside_m < 1e-15 {
        return Some(*point_m);
    }
    let across = across / aside_m;
    let ahead_m = pupil.dot(&along);
    let point_ahead_m = ahead_m + point_m.norm();
    let mut angle: f64 = 0.0;
    for _ in 0..50 {
        let (sin, cos) = angle.sin_cos();
        let lever_m = ahead_m * sin - aside_m * cos;
        let lever_slope = ahead_m * cos + aside_m * sin;
        let (turn, turn_slope) = turn_in_dome(lever_m, inner_m, outer_m);
        let (wet_sin, wet_cos) = (angle - turn).sin_cos();
        let miss_m = point_ahead_m * wet_sin - aside_m * wet_cos - lever_m / WATER_INDEX;
        let slope = (point_ahead_m * wet_cos + aside_m * wet_sin) * (1.0 - turn_slope * lever_slope)
            - lever_slope / WATER_INDEX;
        let step = miss_m / slope;
        angle -= step;
        if step.abs() < 1e-16 {
            break;
        }
    }
    angle.is_finite().then(|| along * angle.cos() + across * angle.sin())
}

/// Returns the angle by which a dome turns a ray that starts `lever_m` from its centre, rad, and its derivative by the
/// lever, rad/m.
fn turn_in_dome(lever_m: f64, inner_m: f64, outer_m: f64) -> (f64, f64) {
    let refractions =
        [(inner_m, 1.0), (GLASS_INDEX * inner_m, -1.0), (GLASS_INDEX * outer_m, 1.0), (WATER_INDEX * outer_m, -1.0)];
    refractions.iter().fold((0.0, 0.0), |(turn, slope), (radius_at_u_m, sign)| {
        let root = (radius_at_u_m * radius_at_u_m - lever_m * lever_m).sqrt();
        (turn + sign * (lever_m / radius_at_u_m).asin(), slope + sign / root)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Refracts a ray by Snell's law in vectors: `direction` (unit) meets a surface of normal `normal` (unit, against
    /// the ray).
    fn refracted(direction: &Vector3<f64>, normal: &Vector3<f64>, from: f64, to: f64) -> Vector3<f64> {
        let ratio = from / to;
        let cos_in = -normal.dot(direction);
        let cos_out = (1.0 - ratio * ratio * (1.0 - cos_in * cos_in)).sqrt();
        direction * ratio + normal * (ratio * cos_in - cos_out)
    }

    /// Traces a ray from the pupil into the water, by intersections and Snell's law. Returns a point on it and its
    /// direction.
    fn traced(port: &Port, start: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let direction = start.normalize();
        match *port {
            Port::None => (Vector3::zeros(), direction),
            Port::Flat { distance_m, thickness_m } => {
                let back = -Vector3::z();
                let inner = direction * (distance_m / direction.z);
                let glass = refracted(&direction, &back, 1.0, GLASS_INDEX);
                let outer = inner + glass * (thickness_m / glass.z);
                (outer, refracted(&glass, &back, GLASS_INDEX, WATER_INDEX))
            }
            Port::Dome { center_m, inner_radius_m, thickness_m } => {
                let leave = |from: &Vector3<f64>, along: &Vector3<f64>, radius: f64| {
                    let q = from - center_m;
                    let half = q.dot(along);
                    from + along * (-half + (half * half - q.norm_squared() + radius * radius).sqrt())
                };
                let inner = leave(&Vector3::zeros(), &direction, inner_radius_m);
                let inward_normal = |place: &Vector3<f64>| (center_m - place).normalize();
                let glass = refracted(&direction, &inward_normal(&inner), 1.0, GLASS_INDEX);
                let outer = leave(&inner, &glass, inner_radius_m + thickness_m);
                (outer, refracted(&glass, &inward_normal(&outer), GLASS_INDEX, WATER_INDEX))
            }
        }
    }

    fn assert_round_trip(port: &Port, start: &Vector3<f64>, range_m: f64) -> Result<(), TestCaseError> {
        let (outer, wet) = traced(port, start);
        let seen = port.direction_in_air(&(outer + wet * range_m)).expect("a ray reaches it");
        let apart = seen.normalize().cross(&start.normalize()).norm();
        prop_assert!(apart < 1e-12, "{apart} rad apart");
        Ok(())
    }

    proptest! {
        #[test]
        fn a_flat_port_inverts_a_traced_ray(
            angle in 0.0f64..1.45, azimuth in -3.1f64..3.1, range_m in 0.05f64..5.0,
            distance_m in 0.0f64..0.2, thickness_m in 0.0f64..0.05,
        ) {
            let start = Vector3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos());
            assert_round_trip(&Port::Flat { distance_m, thickness_m }, &start, range_m)?;
        }

        #[test]
        fn a_dome_inverts_a_traced_ray(
            angle in 0.0f64..1.6, azimuth in -3.1f64..3.1, range_m in 0.05f64..5.0,
            x in -0.014f64..0.014, y in -0.014f64..0.014, z in -0.014f64..0.014,
            thickness_m in 0.0f64..0.05,
        ) {
            let start = Vector3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), angle.cos());
            let port = Port::Dome { center_m: Vector3::new(x, y, z), inner_radius_m: 0.05, thickness_m };
            assert_round_trip(&port, &start, range_m)?;
        }
    }

    /// Regression test: Newton's method did not converge in this case.
    #[test]
    fn a_thick_decentred_dome_inverts_a_ray_from_its_surface() {
        let center_m = Vector3::new(0.0, -0.005_984_014_066_287_652, 0.0);
        let port = Port::Dome { center_m, inner_radius_m: 0.05, thickness_m: 0.019_330_072_291_360_43 };
        assert_round_trip(&port, &Vector3::z(), 0.05).expect("seen again");
    }

    #[test]
    fn a_centred_dome_turns_no_ray_and_no_port_projects_points_inside_it() {
        let point = Vector3::new(0.3, -0.2, 0.5);
        let dome = Port::Dome { center_m: Vector3::zeros(), inner_radius_m: 0.05, thickness_m: 0.01 };
        assert_eq!(dome.direction_in_air(&point), Some(point));
        assert!(dome.direction_in_air(&Vector3::new(0.0, 0.01, 0.055)).is_none());
        let flat = Port::Flat { distance_m: 0.02, thickness_m: 0.01 };
        assert!(flat.direction_in_air(&Vector3::new(0.0, 0.01, 0.025)).is_none());
    }

    /// To first order, a thin dome with its centre at a distance e turns the line of sight by `e (1 - 1/n) (1/R -
    /// 1/range)`.
    #[test]
    fn a_dome_beside_the_pupil_turns_the_view_by_its_closed_form() {
        const ASIDE_M: f64 = 1e-6;
        for range_m in [0.2, 1.0, 5.0] {
            let center_m = Vector3::new(ASIDE_M, 0.0, 0.0);
            let dome = Port::Dome { center_m, inner_radius_m: 0.05, thickness_m: 0.0 };
            let seen = dome.direction_in_air(&Vector3::new(0.0, 0.0, range_m)).expect("in the water");
            let expected = ASIDE_M * (1.0 - 1.0 / WATER_INDEX) * (1.0 / 0.05 - 1.0 / range_m);
            let angle = seen.x.abs().atan2(seen.z);
            assert!((angle / expected - 1.0).abs() < 1e-6, "{angle} against {expected}");
        }
    }

    /// A plane port magnifies angles by the water's index, near the axis and far from the port.
    #[test]
    fn a_flat_port_magnifies_by_the_waters_index() {
        let flat = Port::Flat { distance_m: 0.0, thickness_m: 0.0 };
        let seen = flat.direction_in_air(&Vector3::new(1e-5, 0.0, 1.0)).expect("in the water");
        assert!((seen.x / seen.z / 1e-5 - WATER_INDEX).abs() < 1e-9);
    }
}

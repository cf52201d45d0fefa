//! The outline of convex shapes in a plane.

use nalgebra::{Isometry3, Point3};

use armcal_core::robot::{PlacedShape, Shape};

/// Number of points on a circle.
const AROUND: usize = 16;

/// Points whose hull is the shape, or close to it in a picture; relative to its own centre, m.
fn corners(shape: &Shape) -> Vec<Point3<f64>> {
    let ring = |radius_m: f64, z: f64| {
        (0..AROUND).map(move |n| {
            let angle = std::f64::consts::TAU * n as f64 / AROUND as f64;
            Point3::new(radius_m * angle.cos(), radius_m * angle.sin(), z)
        })
    };
    let ball = |radius_m: f64, z: f64| {
        let heights = (0..=8).map(|n| f64::from(n) * std::f64::consts::PI / 8.0);
        heights.flat_map(move |polar| ring(radius_m * polar.sin(), z + radius_m * polar.cos()))
    };
    match shape {
        Shape::Box { size_m } => {
            let half = size_m.map(|edge| 0.5 * edge);
            let sign = |n: usize, axis: usize| if n >> axis & 1 == 0 { -half[axis] } else { half[axis] };
            (0..8).map(|n| Point3::new(sign(n, 0), sign(n, 1), sign(n, 2))).collect()
        }
        Shape::Cylinder { radius_m, length_m } => {
            ring(*radius_m, -0.5 * length_m).chain(ring(*radius_m, 0.5 * length_m)).collect()
        }
        Shape::Capsule { radius_m, length_m } => {
            ball(*radius_m, -0.5 * length_m).chain(ball(*radius_m, 0.5 * length_m)).collect()
        }
        Shape::Sphere { radius_m } => ball(*radius_m, 0.0).collect(),
        Shape::Hull(hull) => hull.corners_m().iter().map(|corner| Point3::from(*corner)).collect(),
    }
}

/// The shape's outline as seen along a direction: `project` gives the two coordinates in the picture.
pub(super) fn outline(
    placed: &PlacedShape,
    base_from_owner: &Isometry3<f64>,
    project: impl Fn(&Point3<f64>) -> [f64; 2],
) -> Vec<[f64; 2]> {
    let pose = base_from_owner * placed.owner_from_shape;
    hull(corners(&placed.shape).iter().map(|corner| project(&(pose * corner))).collect())
}

/// Corners of the convex hull, one way round (Andrew's monotone chain).
fn hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turns_left =
        |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0;
    let half = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while chain.len() >= 2 && !turns_left(chain[chain.len() - 2], chain[chain.len() - 1], *point) {
                chain.pop();
            }
            chain.push(*point);
        }
        chain.pop();
        chain
    };
    let mut around = half(&mut points.iter());
    around.extend(half(&mut points.iter().rev()));
    around
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_goes_around_and_leaves_out_what_is_inside() {
        let square = vec![[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [1.0, 1.0], [0.0, 1.0], [0.5, 0.0]];
        assert_eq!(hull(square), [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    }

    #[test]
    fn a_turned_cylinder_is_as_wide_as_it_is_long() {
        let shape = Shape::Cylinder { radius_m: 0.1, length_m: 2.0 };
        let placed = PlacedShape { owner_from_shape: Isometry3::identity(), shape, color_rgb: [0; 3] };
        let lying = Isometry3::rotation(nalgebra::Vector3::y() * std::f64::consts::FRAC_PI_2);
        let seen = outline(&placed, &lying, |p| [p.x, p.z]);
        let reach = |axis: usize| seen.iter().map(|p| p[axis]).fold(0.0, f64::max);
        assert!((reach(0) - 1.0).abs() < 1e-9 && (reach(1) - 0.1).abs() < 1e-9, "{seen:?}");
    }
}

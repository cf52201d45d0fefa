//! Convex hulls of points: meshes for clearance, contact and visibility.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use parry3d::math::Vec3;
use parry3d::shape::{ConvexPolyhedron, SharedShape};
use parry3d::transformation::try_convex_hull;

/// Limit of a hull's corners: each costs time in every distance.
pub const MAX_HULL_POINTS: usize = 2000;
/// Smallest thickness of a body, m.
const THINNEST_M: f64 = 1e-4;

/// A convex body with its corners, m.
#[derive(Clone, Debug)]
pub struct Hull {
    /// Points that the hull was made from; some may lie inside.
    points_m: Vec<[f64; 3]>,
    corners_m: Vec<[f64; 3]>,
    /// Corners of each outer triangle, counter-clockwise from outside.
    triangles: Vec<[u32; 3]>,
    shape: SharedShape,
    radius_m: f64,
}

/// A hull's corners relative to the centre of their bounding box, and that centre, m.
#[derive(Clone, Debug)]
pub(super) struct CenteredHull {
    pub points_m: Vec<[f64; 3]>,
    pub center_m: [f64; 3],
}

struct Outline {
    corners_m: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// Reason why points have no convex body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum HullError {
    #[error("has {got} points in its hull, at most {MAX_HULL_POINTS} are allowed; simplify the mesh")]
    TooManyPoints { got: usize },
    #[error("is flat: {thickness_m:.1e} m thick, at least {THINNEST_M:.0e} m are needed")]
    Flat { thickness_m: f64 },
    #[error("needs {n:.0} {what} to be decomposed, at most {max:.0} are allowed; simplify it or use convex = \"hull\"")]
    TooComplex { what: &'static str, n: f64, max: f64 },
    #[error("has no convex body: {0}")]
    Degenerate(String),
}

impl PartialEq for Hull {
    /// Returns true for equal points, which have equal hulls.
    fn eq(&self, other: &Self) -> bool {
        self.points_m == other.points_m
    }
}

impl Hull {
    /// Builds the hull of `points_m`, which must be finite.
    ///
    /// # Errors
    /// [`HullError`] if the points lie in one plane, are too many, or have no convex body.
    pub fn new(points_m: &[[f64; 3]]) -> Result<Arc<Self>, HullError> {
        let Outline { corners_m, triangles } = outline(points_m)?;
        if corners_m.len() > MAX_HULL_POINTS {
            return Err(HullError::TooManyPoints { got: corners_m.len() });
        }
        let corners: Vec<Vec3> = corners_m.iter().map(|p| Vec3::from_array(*p)).collect();
        let body = ConvexPolyhedron::from_convex_mesh(corners, &triangles)
            .ok_or_else(|| HullError::Degenerate("its triangles do not close".to_owned()))?;
        Ok(Arc::new(Self {
            points_m: points_m.to_vec(),
            radius_m: corners_m.iter().map(|p| Vector3::from(*p).norm()).fold(0.0, f64::max),
            corners_m,
            triangles,
            shape: SharedShape::new(body),
        }))
    }

    /// Returns only the hull's corners, relative to their centre.
    pub(super) fn centered(points_m: &[[f64; 3]]) -> Result<CenteredHull, HullError> {
        let Outline { corners_m, .. } = outline(points_m)?;
        let bound = |pick: fn(f64, f64) -> f64, start: f64| {
            [0, 1, 2].map(|axis| corners_m.iter().map(|p| p[axis]).fold(start, pick))
        };
        let (low, high) = (bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY));
        let center_m = [0, 1, 2].map(|axis| 0.5 * (low[axis] + high[axis]));
        let points_m = corners_m.iter().map(|p| [0, 1, 2].map(|axis| p[axis] - center_m[axis])).collect();
        Ok(CenteredHull { points_m, center_m })
    }

    /// Returns the hull's corners in the frame of the points that it was made from.
    #[must_use]
    pub fn corners_m(&self) -> &[[f64; 3]] {
        &self.corners_m
    }

    /// Indices of the corners of each outer triangle, counter-clockwise from outside.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the shape for parry and rapier.
    #[must_use]
    pub fn shape(&self) -> SharedShape {
        self.shape.clone()
    }

    /// Radius of the smallest sphere about the origin that contains the hull, m.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Sides of the hull's bounding box along the axes, m.
    #[must_use]
    pub fn box_m(&self) -> [f64; 3] {
        let half = self.shape.compute_local_aabb().half_extents();
        [2.0 * half.x, 2.0 * half.y, 2.0 * half.z]
    }
}

/// Returns corners and triangles of the hull, after a check for points on which parry would panic.
fn outline(points_m: &[[f64; 3]]) -> Result<Outline, HullError> {
    let thickness_m = thickness_m(points_m);
    if thickness_m < THINNEST_M {
        return Err(HullError::Flat { thickness_m });
    }
    let points: Vec<Vec3> = points_m.iter().map(|p| Vec3::from_array(*p)).collect();
    let (corners, triangles) = try_convex_hull(&points).map_err(|error| HullError::Degenerate(error.to_string()))?;
    Ok(Outline { corners_m: corners.iter().map(|p| p.to_array()).collect(), triangles })
}

/// Returns the extent along the direction in which the points spread least, m.
fn thickness_m(points_m: &[[f64; 3]]) -> f64 {
    if points_m.is_empty() {
        return 0.0;
    }
    let mean = points_m.iter().map(|p| Vector3::from(*p)).sum::<Vector3<f64>>() / points_m.len() as f64;
    let spread = |p: &[f64; 3]| {
        let d = Vector3::from(*p) - mean;
        d * d.transpose()
    };
    let scatter: Matrix3<f64> = points_m.iter().map(spread).sum();
    let eigen = scatter.symmetric_eigen();
    let thin = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let heights = points_m.iter().map(|p| thin.dot(&(Vector3::from(*p) - mean)));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), h| (a.min(h), b.max(h)));
    high - low
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(half: f64) -> Vec<[f64; 3]> {
        let mut points = Vec::new();
        for x in [-half, half] {
            for y in [-half, half] {
                points.extend([[x, y, -half], [x, y, half]]);
            }
        }
        points
    }

    #[test]
    fn points_inside_make_no_corners() {
        let mut points = cube(0.5);
        points.push([0.1, 0.2, 0.3]);
        let hull = Hull::new(&points).expect("a cube");
        assert_eq!((hull.corners_m().len(), hull.triangles().len()), (8, 12));
        assert!((hull.radius_m() - 0.75_f64.sqrt()).abs() < 1e-12);
        assert_eq!(hull.box_m(), [1.0; 3]);
        let ball = SharedShape::ball(0.1);
        let at = |x: f64| parry3d::math::Pose3::from_translation(Vec3::new(x, 0.0, 0.0));
        let apart =
            parry3d::query::distance(&at(0.0), hull.shape().as_ref(), &at(1.0), ball.as_ref()).expect("known").distance;
        assert!((apart - 0.4).abs() < 1e-9, "{apart}");
    }

    /// A ray's normal points outward only if the triangles run counter-clockwise.
    #[test]
    fn triangles_face_outward() {
        let hull = Hull::new(&cube(1.0)).expect("a cube");
        for triangle in hull.triangles() {
            let [a, b, c] = triangle.map(|k| Vector3::from(hull.corners_m()[k as usize]));
            assert!((b - a).cross(&(c - a)).dot(&a) > 0.0);
        }
    }

    #[test]
    fn flat_thin_and_empty_clouds_are_refused() {
        let flat: Vec<_> = cube(1.0).iter().map(|p| [p[0], p[1], 0.3 * p[0] - 2.0 * p[1]]).collect();
        for points in [vec![], vec![[1.0; 3]], vec![[0.0; 3], [1.0; 3]], flat] {
            assert!(matches!(Hull::new(&points), Err(HullError::Flat { .. })), "{points:?}");
        }
        let sphere: Vec<[f64; 3]> = (0..3000)
            .map(|k| {
                let (z, turn) = (2.0 * (f64::from(k) + 0.5) / 3000.0 - 1.0, 2.399_963 * f64::from(k));
                let r = (1.0 - z * z).sqrt();
                [r * turn.cos(), r * turn.sin(), z]
            })
            .collect();
        assert!(matches!(Hull::new(&sphere), Err(HullError::TooManyPoints { got }) if got > 2900));
    }

    #[test]
    fn a_centered_hull_is_the_same_body_moved() {
        let far: Vec<_> = cube(0.25).iter().map(|p| [p[0] + 3.0, p[1] - 1.0, p[2]]).collect();
        let CenteredHull { points_m, center_m } = Hull::centered(&far).expect("a cube");
        assert_eq!(center_m, [3.0, -1.0, 0.0]);
        assert!((Hull::new(&points_m).expect("a cube").radius_m() - 0.25 * 3.0_f64.sqrt()).abs() < 1e-12);
    }
}

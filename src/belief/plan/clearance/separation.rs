//! Separation of two shapes: distance and direction.

use parry3d::bounding_volume::Aabb;
use parry3d::math::{Pose3, Vec3};
use parry3d::query;
use parry3d::query::details::closest_points_support_map_support_map_with_params;
use parry3d::query::gjk::{GJKResult, VoronoiSimplex};
use parry3d::shape::SharedShape;

/// Kind of the shape inside its box, so that its shadows need no virtual call.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum SupportShape {
    Box,
    /// A cylinder along the second axis of its box.
    Cylinder,
    /// A capsule along the third axis of its box; `core` is the share of its half length without the cap.
    Capsule {
        core: f64,
        radius_m: f64,
    },
    Ball {
        radius_m: f64,
    },
    /// A convex hull, whose support is computed from its corners.
    Hull,
    /// All points below a plane with this normal.
    HalfSpace {
        normal: Vec3,
    },
}

/// A shape at one configuration, base frame.
#[derive(Clone, Copy)]
pub(crate) struct Placed {
    pub pose: Pose3,
    /// Bounding box along the base's axes.
    pub bounds: Aabb,
    /// Centre of the box around the shape along its own axes.
    pub center: Vec3,
    pub half_axes: [Vec3; 3],
    /// Radius of a sphere about the centre that holds the shape.
    pub radius_m: f64,
    pub outline: SupportShape,
}

/// Two shapes without placement.
pub(crate) struct Shapes<'a> {
    pub outer: &'a SharedShape,
    pub other: &'a SharedShape,
}

/// Result of the distance computation of two shapes.
pub(crate) struct Separation {
    /// Distance, m; zero: touching or inside each other.
    pub distance_m: f64,
    /// Unit vector from the other shape to the outer one; zero if no direction separates them (shapes that are not
    /// convex).
    pub direction: Vec3,
    /// Lower bound on the distance that holds along `direction`, m.
    pub gap_m: f64,
}

impl Default for Placed {
    fn default() -> Self {
        Self::NOWHERE
    }
}

impl Placed {
    pub(crate) const NOWHERE: Self = Self {
        pose: Pose3::IDENTITY,
        bounds: Aabb { mins: Vec3::ZERO, maxs: Vec3::ZERO },
        center: Vec3::ZERO,
        half_axes: [Vec3::ZERO; 3],
        radius_m: 0.0,
        outline: SupportShape::Box,
    };

    /// Returns the largest `|direction . (p - center)|` over the points p of the shape; `direction` has any length.
    pub(crate) fn extent_m(&self, direction: Vec3) -> f64 {
        let [a, b, c] = self.half_axes.map(|half| direction.dot(half));
        match self.outline {
            SupportShape::Cylinder => b.abs() + (a * a + c * c).sqrt(),
            SupportShape::Capsule { core, radius_m } => core * c.abs() + radius_m * direction.length(),
            SupportShape::Ball { radius_m } => radius_m * direction.length(),
            SupportShape::Box | SupportShape::Hull | SupportShape::HalfSpace { .. } => a.abs() + b.abs() + c.abs(),
        }
    }

    /// Returns the largest `direction . (p - center)` over the points p of the shape.
    fn ahead_m(&self, shape: &SharedShape, direction: Vec3) -> f64 {
        match (self.outline, shape.as_support_map()) {
            (SupportShape::Hull, Some(hull)) => {
                hull.support_point(&self.pose, direction).dot(direction) - self.center.dot(direction)
            }
            _ => self.extent_m(direction),
        }
    }

    /// Returns the unit vector from the other's box to this one's; from centre to centre if they overlap.
    pub(crate) fn rough_direction(&self, other: &Self) -> Vec3 {
        if let SupportShape::HalfSpace { normal } = other.outline {
            return normal;
        }
        let ahead = (self.bounds.mins - other.bounds.maxs).max(Vec3::ZERO);
        let behind = (other.bounds.mins - self.bounds.maxs).max(Vec3::ZERO);
        (ahead - behind).try_normalize().unwrap_or_else(|| (self.center - other.center).normalize_or_zero())
    }
}

/// Returns the distance of two axis-aligned boxes, a lower bound on that of the shapes inside, m.
pub(crate) fn gap_m(a: &Aabb, b: &Aabb) -> f64 {
    let apart = (a.mins - b.maxs).max(b.mins - a.maxs).max(Vec3::ZERO);
    apart.length()
}

impl Shapes<'_> {
    /// Returns the gap between the shapes' shadows on a unit direction, a lower bound on their distance, m.
    pub(crate) fn gap_along_m(&self, outer: &Placed, other: &Placed, direction: Vec3) -> f64 {
        let lowest = direction.dot(outer.center) - outer.ahead_m(self.outer, -direction);
        if let SupportShape::HalfSpace { normal } = other.outline {
            let is_normal = normal == direction;
            return if is_normal { lowest - other.center.dot(direction) } else { f64::NEG_INFINITY };
        }
        lowest - direction.dot(other.center) - other.ahead_m(self.other, direction)
    }
}

/// Returns the separation of two shapes; `guess` is an initial direction, or zero.
pub(crate) fn separate(shapes: &Shapes<'_>, placed: [&Placed; 2], guess: Vec3) -> Separation {
    let [outer_at, other_at] = placed;
    if let SupportShape::HalfSpace { normal } = other_at.outline {
        let gap_m = shapes.gap_along_m(outer_at, other_at, normal);
        return Separation { distance_m: gap_m.max(0.0), direction: normal, gap_m };
    }
    let (Some(outer), Some(other)) = (shapes.outer.as_support_map(), shapes.other.as_support_map()) else {
        // An unsupported pair of shapes counts as contact.
        let distance = query::distance(&outer_at.pose, shapes.outer.as_ref(), &other_at.pose, shapes.other.as_ref());
        let distance_m = distance.map_or(0.0, |found| found.distance);
        return Separation { distance_m, direction: Vec3::ZERO, gap_m: distance_m };
    };
    let local_guess = outer_at.pose.rotation.inverse() * -guess;
    let start = (guess != Vec3::ZERO).then_some(local_guess);
    let between = outer_at.pose.inv_mul(&other_at.pose);
    let mut simplex = VoronoiSimplex::new();
    let found =
        closest_points_support_map_support_map_with_params(&between, outer, other, f64::MAX, &mut simplex, start);
    let (apart, distance_m) = match found {
        GJKResult::ClosestPoints(on_outer, on_other, _) => {
            let apart = on_outer - on_other;
            (outer_at.pose.rotation * apart, apart.length())
        }
        _ => (Vec3::ZERO, 0.0),
    };
    let mut direction = apart.normalize_or_zero();
    if direction == Vec3::ZERO {
        direction = (outer_at.center - other_at.center).try_normalize().unwrap_or(Vec3::Z);
    }
    let gap_m = shapes.gap_along_m(outer_at, other_at, direction);
    Separation { distance_m, direction, gap_m }
}

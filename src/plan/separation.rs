//! Two shapes apart: how far, and along which direction.

use parry3d::bounding_volume::Aabb;
use parry3d::math::{Pose3, Vec3};
use parry3d::query;
use parry3d::query::details::closest_points_support_map_support_map_with_params;
use parry3d::query::gjk::{GJKResult, VoronoiSimplex};
use parry3d::shape::{HalfSpace, SharedShape};

/// A shape at one configuration, base frame.
#[derive(Clone, Copy)]
pub(super) struct Placed {
    pub pose: Pose3,
    /// A box along the base's axes, a little large.
    pub bounds: Aabb,
    /// Of the box around the shape in its own axes.
    pub center: Vec3,
    pub half_axes: [Vec3; 3],
    /// About the centre.
    pub radius_m: f64,
}

/// Two shapes without their places.
pub(super) struct Shapes<'a> {
    pub outer: &'a SharedShape,
    pub other: &'a SharedShape,
}

/// What lies between two shapes.
pub(super) struct Separation {
    /// Zero: touching or inside each other.
    pub distance_m: f64,
    /// Unit, from the other shape to the outer one; zero where no direction separates them (shapes that are not convex).
    pub direction: Vec3,
    /// A lower bound on the distance that holds along `direction`.
    pub gap_m: f64,
}

impl Placed {
    pub(super) const NOWHERE: Self = Self {
        pose: Pose3::IDENTITY,
        bounds: Aabb { mins: Vec3::ZERO, maxs: Vec3::ZERO },
        center: Vec3::ZERO,
        half_axes: [Vec3::ZERO; 3],
        radius_m: 0.0,
    };

    /// The most that `direction . (p - center)` can be for a point p of the shape.
    pub(super) fn extent_m(&self, direction: Vec3) -> f64 {
        self.half_axes.iter().map(|half| direction.dot(*half).abs()).sum()
    }

    /// From the other's box to this one's, unit; zero where they overlap.
    pub(super) fn bounds_direction(&self, other: &Self) -> Vec3 {
        let ahead = (self.bounds.mins - other.bounds.maxs).max(Vec3::ZERO);
        let behind = (other.bounds.mins - self.bounds.maxs).max(Vec3::ZERO);
        (ahead - behind).normalize_or_zero()
    }
}

/// Distance between two boxes along the axes, a lower bound on that of what they hold, m.
pub(super) fn gap_m(a: &Aabb, b: &Aabb) -> f64 {
    let apart = (a.mins - b.maxs).max(b.mins - a.maxs).max(Vec3::ZERO);
    apart.length()
}

impl Shapes<'_> {
    /// The gap between the shapes' shadows on `direction`, a lower bound on their distance; `None` where it is unbounded.
    pub(super) fn gap_along_m(&self, placed: &[Placed; 2], direction: Vec3) -> Option<f64> {
        let outer = self.outer.as_support_map()?;
        let lowest = outer.support_point(&placed[0].pose, -direction).dot(direction);
        if let Some(half_space) = self.other.as_shape::<HalfSpace>() {
            let normal = placed[1].pose.rotation * half_space.normal;
            return (normal == direction).then(|| lowest - placed[1].pose.translation.dot(direction));
        }
        let other = self.other.as_support_map()?;
        Some(lowest - other.support_point(&placed[1].pose, direction).dot(direction))
    }
}

/// The distance of two shapes; `guess` is a direction to begin with, or zero.
pub(super) fn separate(shapes: &Shapes<'_>, placed: &[Placed; 2], guess: Vec3) -> Separation {
    if let Some(half_space) = shapes.other.as_shape::<HalfSpace>() {
        let direction = placed[1].pose.rotation * half_space.normal;
        if let Some(gap_m) = shapes.gap_along_m(placed, direction) {
            return Separation { distance_m: gap_m.max(0.0), direction, gap_m };
        }
    }
    let (Some(outer), Some(other)) = (shapes.outer.as_support_map(), shapes.other.as_support_map()) else {
        // An unsupported pair of shapes counts as contact.
        let distance = query::distance(&placed[0].pose, shapes.outer.as_ref(), &placed[1].pose, shapes.other.as_ref());
        let distance_m = distance.map_or(0.0, |found| found.distance);
        return Separation { distance_m, direction: Vec3::ZERO, gap_m: distance_m };
    };
    let local_guess = placed[0].pose.rotation.inverse() * -guess;
    let start = (guess != Vec3::ZERO).then_some(local_guess);
    let between = placed[0].pose.inv_mul(&placed[1].pose);
    let mut simplex = VoronoiSimplex::new();
    let found =
        closest_points_support_map_support_map_with_params(&between, outer, other, f64::MAX, &mut simplex, start);
    let (apart, distance_m) = match found {
        GJKResult::ClosestPoints(on_outer, on_other, _) => {
            let apart = on_outer - on_other;
            (placed[0].pose.rotation * apart, apart.length())
        }
        _ => (Vec3::ZERO, 0.0),
    };
    let mut direction = apart.normalize_or_zero();
    if direction == Vec3::ZERO {
        direction = (placed[0].center - placed[1].center).try_normalize().unwrap_or(Vec3::Z);
    }
    let gap_m = shapes.gap_along_m(placed, direction).unwrap_or(0.0);
    Separation { distance_m, direction, gap_m }
}

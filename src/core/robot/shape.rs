//! Convex shapes with a pose, for display, clearance and contact.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};
use parry3d::math::{Pose3, Rot3, Vec3};
use parry3d::shape::SharedShape;

use super::hull::Hull;

/// A convex shape about its own centre, lengths in m. Cylinders and capsules lie along z, as in URDF.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A box with its edges along the axes.
    Box {
        /// Full lengths of the edges along x, y, z.
        size_m: [f64; 3],
    },
    /// A cylinder along z with flat ends.
    Cylinder {
        /// Radius about z.
        radius_m: f64,
        /// Full length along z.
        length_m: f64,
    },
    /// A capsule along z.
    Capsule {
        /// Radius of the body and of the caps.
        radius_m: f64,
        /// Distance between the centres of the caps; the full length is this plus two radii.
        length_m: f64,
    },
    /// A sphere about the centre.
    Sphere {
        /// Radius of the sphere.
        radius_m: f64,
    },
    /// Convex hull of a mesh.
    Hull(Arc<Hull>),
}

/// A shape with its pose in its owner's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedShape {
    /// Pose of the shape's centre in the owner's frame.
    pub owner_from_shape: Isometry3<f64>,
    /// The shape about its own centre.
    pub shape: Shape,
    /// Colour for display: red, green, blue.
    pub color_rgb: [u8; 3],
}

impl PlacedShape {
    /// Distance of a point in the owner's frame from the solid shape, m.
    #[must_use]
    pub fn distance_m(&self, point: &Point3<f64>) -> f64 {
        let pose = parry_pose(&(self.owner_from_shape * self.shape.axis_fix()));
        self.shape.to_parry().distance_to_point(&pose, Vec3::new(point.x, point.y, point.z), true)
    }
}

impl Shape {
    /// Returns the shape for parry and rapier; [`Shape::axis_fix`] turns its axis to that of URDF.
    #[must_use]
    pub fn to_parry(&self) -> SharedShape {
        match *self {
            Self::Box { size_m: [x, y, z] } => SharedShape::cuboid(0.5 * x, 0.5 * y, 0.5 * z),
            Self::Cylinder { radius_m, length_m } => SharedShape::cylinder(0.5 * length_m, radius_m),
            Self::Capsule { radius_m, length_m } => SharedShape::capsule_z(0.5 * length_m, radius_m),
            Self::Sphere { radius_m } => SharedShape::ball(radius_m),
            Self::Hull(ref hull) => hull.shape(),
        }
    }

    /// Returns the rotation to apply on the right of the shape's pose: parry's cylinder lies along y, URDF's along z.
    #[must_use]
    pub fn axis_fix(&self) -> Isometry3<f64> {
        match self {
            Self::Cylinder { .. } => Isometry3::rotation(nalgebra::Vector3::x() * std::f64::consts::FRAC_PI_2),
            _ => Isometry3::identity(),
        }
    }

    /// Radius of the smallest sphere about the shape's centre that contains the shape, m.
    #[must_use]
    pub fn bounding_radius_m(&self) -> f64 {
        match *self {
            Self::Box { size_m } => 0.5 * nalgebra::Vector3::from(size_m).norm(),
            Self::Cylinder { radius_m, length_m } => radius_m.hypot(0.5 * length_m),
            Self::Capsule { radius_m, length_m } => radius_m + 0.5 * length_m,
            Self::Sphere { radius_m } => radius_m,
            Self::Hull(ref hull) => hull.radius_m(),
        }
    }

    /// Sides of the shape's bounding box along its axes, m.
    #[must_use]
    pub fn box_m(&self) -> [f64; 3] {
        match *self {
            Self::Box { size_m } => size_m,
            Self::Cylinder { radius_m, length_m } => [2.0 * radius_m, 2.0 * radius_m, length_m],
            Self::Capsule { radius_m, length_m } => [2.0 * radius_m, 2.0 * radius_m, length_m + 2.0 * radius_m],
            Self::Sphere { radius_m } => [2.0 * radius_m; 3],
            Self::Hull(ref hull) => hull.box_m(),
        }
    }

    /// Every length that must be above zero, with its name.
    #[must_use]
    pub fn lengths(&self) -> Vec<(&'static str, f64)> {
        match *self {
            Self::Box { size_m: [x, y, z] } => vec![("size_m[0]", x), ("size_m[1]", y), ("size_m[2]", z)],
            Self::Cylinder { radius_m, length_m } | Self::Capsule { radius_m, length_m } => {
                vec![("radius_m", radius_m), ("length_m", length_m)]
            }
            Self::Sphere { radius_m } => vec![("radius_m", radius_m)],
            // A hull's points are checked when it is built.
            Self::Hull(_) => Vec::new(),
        }
    }
}

/// Converts a pose to the type of parry and rapier.
#[must_use]
pub fn parry_pose(isometry: &Isometry3<f64>) -> Pose3 {
    let t = isometry.translation.vector;
    let q = isometry.rotation;
    Pose3::from_parts(Vec3::new(t.x, t.y, t.z), Rot3::from_xyzw(q.i, q.j, q.k, q.w))
}

//! Conversion between nalgebra's vectors and those of rapier and parry, which share theirs.

use nalgebra::Vector3;
use rapier3d::math::Vector;

/// Converts a vector to the physics engine's type.
pub(super) fn to_rapier(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

/// Converts a vector from the physics engine's type.
pub(super) fn from_rapier(v: Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

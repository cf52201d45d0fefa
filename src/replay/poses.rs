//! Places and poses in the viewer's types.

use crate::rerun::Transform3D;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

/// Returns a vector in single precision, as Rerun has it.
pub(super) fn vector(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

pub(super) fn quaternion(q: &UnitQuaternion<f64>) -> crate::rerun::Quaternion {
    crate::rerun::Quaternion::from_xyzw([q.i as f32, q.j as f32, q.k as f32, q.w as f32])
}

/// The pose of an entity in its parent.
pub(super) fn transform(pose: &Isometry3<f64>) -> Transform3D {
    Transform3D::from_translation_rotation(vector(&pose.translation.vector), quaternion(&pose.rotation))
}

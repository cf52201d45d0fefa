//! Poses, points, and the exponential map of SE(3).

use std::marker::PhantomData;
use std::ops::Mul;

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Quaternion, Translation3, UnitQuaternion, Vector3, Vector6};

use super::frames::Frame;

/// `a_from_b`: maps coordinates in frame `B` (metres) to frame `A`.
///
/// ```compile_fail
/// use armcal_core::spatial::{Base, Camera, Pose, Tag, Tool};
/// let base_from_camera: Pose<Base, Camera> = Pose::identity();
/// let tool_from_tag: Pose<Tool, Tag> = Pose::identity();
/// let wrong = base_from_camera * tool_from_tag; // Camera and Tool do not cancel
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<A: Frame, B: Frame> {
    isometry: Isometry3<f64>,
    frames: PhantomData<(A, B)>,
}

/// A position in frame `A`, metres.
///
/// ```compile_fail
/// use armcal_core::spatial::{Base, Camera, Point, Pose, Tag};
/// let base_from_camera: Pose<Base, Camera> = Pose::identity();
/// let in_tag: Point<Tag> = Point::new(0.0, 0.0, 0.0);
/// let wrong = base_from_camera * in_tag; // a point in the tag's frame is not one in the camera's
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point<A: Frame> {
    coords: Point3<f64>,
    frame: PhantomData<A>,
}

impl<A: Frame, B: Frame> Pose<A, B> {
    /// Returns the pose of two equal frames.
    #[must_use]
    pub fn identity() -> Self {
        Self::from_isometry(Isometry3::identity())
    }

    /// Returns the pose with named frames of a raw isometry. The caller vouches for the frames: used at the edges
    /// (files, physics, recursion).
    #[must_use]
    pub fn from_isometry(isometry: Isometry3<f64>) -> Self {
        Self { isometry, frames: PhantomData }
    }

    /// Builds a pose of a position (m) and a quaternion `[w, x, y, z]`, which it normalises; `None` if it has no
    /// direction.
    #[must_use]
    pub fn from_position_quaternion_wxyz(position_m: [f64; 3], wxyz: [f64; 4]) -> Option<Self> {
        let quaternion = Quaternion::new(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
        let norm = quaternion.norm();
        if !norm.is_finite() || norm < 1e-6 || position_m.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let rotation = UnitQuaternion::from_quaternion(quaternion);
        Some(Self::from_isometry(Isometry3::from_parts(Translation3::from(Vector3::from(position_m)), rotation)))
    }

    /// Builds a pose of a position (m) and fixed-axis roll, pitch, yaw (rad), the convention of URDF.
    #[must_use]
    pub fn from_position_rpy(position_m: [f64; 3], rpy_rad: [f64; 3]) -> Self {
        let rotation = UnitQuaternion::from_euler_angles(rpy_rad[0], rpy_rad[1], rpy_rad[2]);
        Self::from_isometry(Isometry3::from_parts(Translation3::from(Vector3::from(position_m)), rotation))
    }

    /// Returns the inverse, `b_from_a`.
    #[must_use]
    pub fn inverse(&self) -> Pose<B, A> {
        Pose::from_isometry(self.isometry.inverse())
    }

    /// Returns the raw isometry, for the physics engine, the file formats and inner loops.
    #[must_use]
    pub fn isometry(&self) -> &Isometry3<f64> {
        &self.isometry
    }

    /// Returns the origin of `B` in `A`.
    #[must_use]
    pub fn origin(&self) -> Point<A> {
        Point::from_vector(self.isometry.translation.vector)
    }

    /// Rotation of `a_from_b`.
    #[must_use]
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        self.isometry.rotation
    }

    /// Returns the unit quaternion of `a_from_b` as w, x, y, z.
    #[must_use]
    pub fn quaternion_wxyz(&self) -> [f64; 4] {
        let q = self.isometry.rotation;
        [q.w, q.i, q.j, q.k]
    }

    /// Returns `self * exp(xi)`, with `xi` = (translation m, rotation rad) in frame `B`.
    #[must_use]
    pub fn perturbed(&self, xi: &Vector6<f64>) -> Self {
        Self::from_isometry(self.isometry * exp(xi))
    }
}

impl<A: Frame> Point<A> {
    /// Builds a point of its coordinates in frame `A`, m.
    #[must_use]
    pub fn new(x_m: f64, y_m: f64, z_m: f64) -> Self {
        Self::from_vector(Vector3::new(x_m, y_m, z_m))
    }

    /// Builds a point of a vector of coordinates, m; the caller vouches for the frame.
    #[must_use]
    pub fn from_vector(vector_m: Vector3<f64>) -> Self {
        Self { coords: Point3::from(vector_m), frame: PhantomData }
    }

    /// Builds a point of x, y, z, m; the caller vouches for the frame.
    #[must_use]
    pub fn from_array(xyz_m: [f64; 3]) -> Self {
        Self::from_vector(Vector3::from(xyz_m))
    }

    /// Returns the coordinates as a raw vector, m.
    #[must_use]
    pub fn vector(&self) -> Vector3<f64> {
        self.coords.coords
    }

    /// Returns the coordinates x, y, z, m.
    #[must_use]
    pub fn to_array(self) -> [f64; 3] {
        self.coords.coords.into()
    }

    /// Distance to another point of the same frame, m.
    #[must_use]
    pub fn distance_m(&self, other: &Self) -> f64 {
        (self.coords - other.coords).norm()
    }
}

impl<A: Frame, B: Frame, C: Frame> Mul<Pose<B, C>> for Pose<A, B> {
    type Output = Pose<A, C>;
    fn mul(self, rhs: Pose<B, C>) -> Pose<A, C> {
        Pose::from_isometry(self.isometry * rhs.isometry)
    }
}

impl<A: Frame, B: Frame> Mul<Point<B>> for Pose<A, B> {
    type Output = Point<A>;
    fn mul(self, rhs: Point<B>) -> Point<A> {
        Point { coords: self.isometry * rhs.coords, frame: PhantomData }
    }
}

/// Returns the adjoint of a pose, which maps a twist (translation, rotation) of frame B to frame A.
/// `exp(Ad xi) = X exp(xi) X^-1` (Barfoot, eq. 7.46 with the halves exchanged).
#[must_use]
pub fn adjoint(a_from_b: &Isometry3<f64>) -> Matrix6<f64> {
    let rotation = *a_from_b.rotation.to_rotation_matrix().matrix();
    let mut out = Matrix6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(&(skew(&a_from_b.translation.vector) * rotation));
    out
}

/// Returns the cross-product matrix: `skew(a) * b = a x b`.
#[must_use]
#[inline]
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// The exponential map of SE(3); `xi` = (translation m, rotation rad). Barfoot, State Estimation for Robotics, eq.
/// 7.86.
#[must_use]
pub fn exp(xi: &Vector6<f64>) -> Isometry3<f64> {
    let rho = Vector3::new(xi[0], xi[1], xi[2]);
    let phi = Vector3::new(xi[3], xi[4], xi[5]);
    let translation = left_jacobian(&phi) * rho;
    Isometry3::from_parts(Translation3::from(translation), UnitQuaternion::from_scaled_axis(phi))
}

/// Returns the inverse of [`exp`], for rotations below pi.
#[must_use]
pub fn log(isometry: &Isometry3<f64>) -> Vector6<f64> {
    let phi = isometry.rotation.scaled_axis();
    // Barfoot eq. 7.37b, the closed-form inverse of the left Jacobian.
    let angle = phi.norm();
    let rho = if angle < 1e-6 {
        isometry.translation.vector - 0.5 * phi.cross(&isometry.translation.vector)
    } else {
        let axis = phi / angle;
        let half = 0.5 * angle;
        let cot = half / half.tan();
        let inverse = Matrix3::identity() * cot + (1.0 - cot) * axis * axis.transpose() - half * skew(&axis);
        inverse * isometry.translation.vector
    };
    Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
}

/// Left Jacobian of SO(3): `exp(phi + d) = exp(J d) exp(phi)` for small d (Sola et al. 2018, eq. 145).
#[must_use]
pub fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    if angle < 1e-6 {
        return Matrix3::identity() + 0.5 * skew(phi);
    }
    let axis = phi / angle;
    let sinc = angle.sin() / angle;
    Matrix3::identity() * sinc + (1.0 - sinc) * axis * axis.transpose() + ((1.0 - angle.cos()) / angle) * skew(&axis)
}

/// The angle between two orientations, rad, 0..pi.
#[must_use]
pub fn rotation_angle_between<A: Frame, B: Frame>(a: &Pose<A, B>, b: &Pose<A, B>) -> f64 {
    a.rotation().angle_to(&b.rotation())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spatial::{Base, Tool};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn exp_and_log_are_inverse(v in prop::array::uniform6(-1.5f64..1.5)) {
            let xi = Vector6::from(v);
            prop_assert!((log(&exp(&xi)) - xi).norm() < 1e-9);
        }

        #[test]
        fn a_pose_times_its_inverse_is_identity(v in prop::array::uniform6(-1.5f64..1.5)) {
            let pose: Pose<Base, Tool> = Pose::from_isometry(exp(&Vector6::from(v)));
            let back = pose * pose.inverse();
            prop_assert!(log(back.isometry()).norm() < 1e-12);
        }
    }
}

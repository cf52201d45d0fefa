//! Spatial vectors and inertias in one frame: Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 2.
//!
//! All of them are expressed about the origin of the base frame in its axes, so that links add up without transforms.

use nalgebra::{Isometry3, Matrix3, Vector3};

use armcal_core::spatial::skew;

/// Velocity or acceleration of a body: its angular part and that of the body's point at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Angular part, rad/s or rad/s2.
    pub angular: Vector3<f64>,
    /// Linear part, m/s or m/s2.
    pub linear: Vector3<f64>,
}

/// Force or momentum: the moment about the origin, and the force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Force {
    /// Moment about the origin, N m or N m s.
    pub moment: Vector3<f64>,
    /// Force or linear momentum, N or N s.
    pub force: Vector3<f64>,
}

impl Motion {
    /// Builds a motion from its two parts.
    #[must_use]
    #[inline]
    pub fn new(angular: Vector3<f64>, linear: Vector3<f64>) -> Self {
        Self { angular, linear }
    }

    /// Returns no motion.
    #[must_use]
    #[inline]
    pub fn zero() -> Self {
        Self::new(Vector3::zeros(), Vector3::zeros())
    }

    /// Returns the rotation about a unit axis through `origin`.
    #[must_use]
    #[inline]
    pub fn rotation(axis: &Vector3<f64>, origin: &Vector3<f64>) -> Self {
        Self::new(*axis, origin.cross(axis))
    }

    /// Returns the velocity of the body's point at `point`.
    #[must_use]
    #[inline]
    pub fn at(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.linear + self.angular.cross(point)
    }

    /// Returns the rate of change of `other`, which is fixed in a body that moves with `self`.
    #[must_use]
    #[inline]
    pub fn cross(&self, other: &Self) -> Self {
        Self::new(
            self.angular.cross(&other.angular),
            self.angular.cross(&other.linear) + self.linear.cross(&other.angular),
        )
    }

    /// Returns the rate of change of a force that is fixed in a body that moves with `self`.
    #[must_use]
    #[inline]
    pub fn cross_force(&self, f: &Force) -> Force {
        Force::new(self.angular.cross(&f.moment) + self.linear.cross(&f.force), self.angular.cross(&f.force))
    }

    /// Returns the power of a force, or a generalised force.
    #[must_use]
    #[inline]
    pub fn dot(&self, f: &Force) -> f64 {
        self.angular.dot(&f.moment) + self.linear.dot(&f.force)
    }

    /// Returns the six components, angular ones first.
    #[must_use]
    #[inline]
    pub fn to_array(&self) -> [f64; 6] {
        let (a, l) = (self.angular, self.linear);
        [a.x, a.y, a.z, l.x, l.y, l.z]
    }

    /// Builds a motion from six components, the inverse of [`Self::to_array`].
    #[must_use]
    #[inline]
    pub fn from_slice(values: &[f64]) -> Self {
        Self::new(Vector3::from_column_slice(&values[..3]), Vector3::from_column_slice(&values[3..6]))
    }
}

impl std::ops::Add for Motion {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::new(self.angular + other.angular, self.linear + other.linear)
    }
}

impl std::ops::Sub for Motion {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::new(self.angular - other.angular, self.linear - other.linear)
    }
}

impl std::ops::Mul<f64> for Motion {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self::new(self.angular * factor, self.linear * factor)
    }
}

impl Force {
    /// Builds a force from its two parts.
    #[must_use]
    #[inline]
    pub fn new(moment: Vector3<f64>, force: Vector3<f64>) -> Self {
        Self { moment, force }
    }

    /// Returns no force.
    #[must_use]
    #[inline]
    pub fn zero() -> Self {
        Self::new(Vector3::zeros(), Vector3::zeros())
    }

    /// Returns the six components, those of the moment first.
    #[must_use]
    #[inline]
    pub fn to_array(&self) -> [f64; 6] {
        let (m, f) = (self.moment, self.force);
        [m.x, m.y, m.z, f.x, f.y, f.z]
    }

    /// Returns the force that acts at `point`.
    #[must_use]
    #[inline]
    pub fn at(point: &Vector3<f64>, force: &Vector3<f64>) -> Self {
        Self::new(point.cross(force), *force)
    }
}

impl std::ops::Add for Force {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::new(self.moment + other.moment, self.force + other.force)
    }
}

impl std::ops::Sub for Force {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::new(self.moment - other.moment, self.force - other.force)
    }
}

impl std::ops::AddAssign for Force {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// Map from a motion to momentum, about the origin: `moment = rotational w + coupling v`, `force = coupling' w + linear
/// v`. Added mass makes `linear` a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// Rotational part, kg m2, symmetric.
    pub rotational: Matrix3<f64>,
    /// Coupling of rotation and translation, kg m.
    pub coupling: Matrix3<f64>,
    /// Linear part, kg, symmetric.
    pub linear: Matrix3<f64>,
}

impl Inertia {
    /// Returns no inertia.
    #[must_use]
    #[inline]
    pub fn zero() -> Self {
        Self { rotational: Matrix3::zeros(), coupling: Matrix3::zeros(), linear: Matrix3::zeros() }
    }

    /// Returns the inertia of a rigid body from its inertia about the centre of mass, in the frame's axes.
    #[must_use]
    #[inline]
    pub fn rigid(mass_kg: f64, com_m: &Vector3<f64>, about_com_kg_m2: &Matrix3<f64>) -> Self {
        let centered =
            Self { rotational: *about_com_kg_m2, coupling: Matrix3::zeros(), linear: Matrix3::identity() * mass_kg };
        centered.shifted(com_m)
    }

    /// Returns the body's inertia in a frame with parallel axes, in which its own frame's origin is at `offset`.
    #[must_use]
    #[inline]
    pub fn shifted(&self, offset: &Vector3<f64>) -> Self {
        let p = skew(offset);
        let p_linear = p * self.linear;
        let coupled = self.coupling * p;
        Self {
            rotational: self.rotational - coupled - coupled.transpose() - p_linear * p,
            coupling: self.coupling + p_linear,
            linear: self.linear,
        }
    }

    /// Returns the body's inertia in the parent's frame.
    #[must_use]
    #[inline]
    pub fn placed(&self, parent_from_body: &Isometry3<f64>) -> Self {
        let r = parent_from_body.rotation.to_rotation_matrix();
        let turn = |m: &Matrix3<f64>| r * m * r.transpose();
        let turned =
            Self { rotational: turn(&self.rotational), coupling: turn(&self.coupling), linear: turn(&self.linear) };
        turned.shifted(&parent_from_body.translation.vector)
    }

    /// Returns the momentum of a motion.
    #[must_use]
    #[inline]
    pub fn momentum(&self, v: &Motion) -> Force {
        Force::new(
            self.rotational * v.angular + self.coupling * v.linear,
            self.coupling.tr_mul(&v.angular) + self.linear * v.linear,
        )
    }
}

impl std::ops::Add for Inertia {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self {
            rotational: self.rotational + other.rotational,
            coupling: self.coupling + other.coupling,
            linear: self.linear + other.linear,
        }
    }
}

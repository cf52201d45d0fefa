//! Rigid bodies of an arm.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::shape::PlacedShape;

/// Mass and shapes of everything that moves with one joint, fixed children included, in that joint's link frame.
#[derive(Clone, Debug)]
pub struct LinkBody {
    /// The link that the joint moves, or the base link.
    pub name: String,
    /// 0 where the URDF gives no mass.
    pub mass_kg: f64,
    /// Centre of mass.
    pub com_m: Vector3<f64>,
    /// About the centre of mass, axes of the link.
    pub inertia_kg_m2: Matrix3<f64>,
    /// To display; without the jaws of a gripper.
    pub visuals: Vec<PlacedShape>,
    /// For clearance and contact.
    pub collisions: Vec<PlacedShape>,
}

impl LinkBody {
    pub(super) fn empty(name: String) -> Self {
        Self {
            name,
            mass_kg: 0.0,
            com_m: Vector3::zeros(),
            inertia_kg_m2: Matrix3::zeros(),
            visuals: Vec::new(),
            collisions: Vec::new(),
        }
    }

    /// Adds a rigid part; `inertia` about its centre of mass in the axes of `body_from_com` (parallel axis theorem).
    pub(super) fn add_mass(&mut self, mass_kg: f64, body_from_com: &Isometry3<f64>, inertia: &Matrix3<f64>) {
        let rotation = body_from_com.rotation.to_rotation_matrix();
        let part = rotation * inertia * rotation.transpose();
        let com = body_from_com.translation.vector;
        let total = self.mass_kg + mass_kg;
        let new_com = (self.com_m * self.mass_kg + com * mass_kg) / total;
        let shift = |d: Vector3<f64>, m: f64| (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * m;
        self.inertia_kg_m2 += shift(self.com_m - new_com, self.mass_kg);
        self.inertia_kg_m2 += part + shift(com - new_com, mass_kg);
        self.com_m = new_com;
        self.mass_kg = total;
    }
}

//! Rigid bodies of an arm.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::shape::PlacedShape;
use crate::kinematics::LinkLoad;

/// Standard gravity, m/s2.
pub const GRAVITY_M_S2: f64 = 9.80665;

/// Mass and shapes of everything that moves with one joint, fixed children included, in that joint's link frame.
#[derive(Clone, Debug)]
pub struct LinkBody {
    /// Name of the link that the joint moves, or of the base link.
    pub name: String,
    /// Mass; 0 if the URDF gives none.
    pub mass_kg: f64,
    /// Centre of mass in the link's frame.
    pub com_m: Vector3<f64>,
    /// Inertia about the centre of mass, axes of the link.
    pub inertia_kg_m2: Matrix3<f64>,
    /// Name of a link of the body whose inertia is not positive definite, so that it cannot be simulated.
    pub bad_inertia: Option<String>,
    /// Shapes for display, without the jaws of a gripper.
    pub visuals: Vec<PlacedShape>,
    /// Shapes for clearance and contact.
    pub collisions: Vec<PlacedShape>,
}

impl LinkBody {
    pub(super) fn empty(name: String) -> Self {
        Self {
            name,
            mass_kg: 0.0,
            com_m: Vector3::zeros(),
            inertia_kg_m2: Matrix3::zeros(),
            bad_inertia: None,
            visuals: Vec::new(),
            collisions: Vec::new(),
        }
    }

    /// Adds a rigid part; `inertia` is about its centre of mass in the axes of `body_from_com` (parallel axis theorem).
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

    /// Returns the centre of the collision shapes' volume in the link's frame, where buoyancy acts. Every shape is
    /// symmetric about its own centre. `None` without a shape.
    #[must_use]
    pub fn volume_centroid_m(&self) -> Option<Vector3<f64>> {
        let mut moment = Vector3::zeros();
        let mut volume = 0.0;
        for placed in &self.collisions {
            let v = placed.shape.to_parry().mass_properties(1.0).mass();
            moment += v * placed.owner_from_shape.translation.vector;
            volume += v;
        }
        (volume > 0.0).then(|| moment / volume)
    }

    /// Returns the weight less buoyancy, if the water carries `buoyancy_fraction` of the weight.
    pub(super) fn load(&self, buoyancy_fraction: f64) -> LinkLoad {
        let weight_n = GRAVITY_M_S2 * self.mass_kg;
        let buoyancy_n = buoyancy_fraction * weight_n;
        let centroid_m = self.volume_centroid_m().unwrap_or(self.com_m);
        LinkLoad { weight_n: weight_n - buoyancy_n, moment_nm: self.com_m * weight_n - centroid_m * buoyancy_n }
    }
}

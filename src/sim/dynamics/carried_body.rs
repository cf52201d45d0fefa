//! Body that another one carries.

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};

use crate::dynamics::body::{Body, Surface, WaterProperties, added_inertia};
use armcal_core::robot::{PlacedShape, Shape};

impl Body {
    /// Builds a solid ball in water, about a centre in its carrier's frame.
    pub(crate) fn ball(mass_kg: f64, density_kg_m3: f64, center_m: &Vector3<f64>, water: &WaterProperties) -> Self {
        let volume_m3 = mass_kg / density_kg_m3;
        let radius_m = (0.75 * volume_m3 / std::f64::consts::PI).cbrt();
        let about_com = Matrix3::identity() * (0.4 * mass_kg * radius_m * radius_m);
        let place = Isometry3::from_parts(Translation3::from(*center_m), UnitQuaternion::identity());
        let shape = PlacedShape { owner_from_shape: place, shape: Shape::Sphere { radius_m }, color_rgb: [0; 3] };
        Self {
            displaced_kg: water.density_kg_m3 * volume_m3,
            added: added_inertia(&shape, water),
            surfaces: vec![Surface::of(&shape, water)],
            ..Self::dry(mass_kg, *center_m, &about_com)
        }
    }

    /// Adds a body that moves with this one, in the same frame.
    pub(crate) fn carry(&mut self, other: &Self) {
        let mean = |m: f64, at: &Vector3<f64>, n: f64, by: &Vector3<f64>| {
            if m + n > 0.0 { (at * m + by * n) / (m + n) } else { *at }
        };
        self.com_m = mean(self.mass_kg, &self.com_m, other.mass_kg, &other.com_m);
        let (own, others) = (&self.center_of_buoyancy_m, &other.center_of_buoyancy_m);
        self.center_of_buoyancy_m = mean(self.displaced_kg, own, other.displaced_kg, others);
        self.mass_kg += other.mass_kg;
        self.displaced_kg += other.displaced_kg;
        self.rigid = self.rigid + other.rigid;
        self.added = self.added + other.added;
        self.surfaces.extend(other.surfaces.iter().copied());
    }
}

//! One body in water: inertia with added mass, buoyancy, Morison's drag.

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::dynamics::spatial::{Force, Inertia, Motion};
use armcal_core::robot::{LinkBody, PlacedShape};
use armcal_core::spatial::skew;

/// A body in its own link's frame.
#[derive(Clone, Debug)]
pub struct Body {
    /// Dry mass.
    pub mass_kg: f64,
    /// Centre of mass.
    pub com_m: Vector3<f64>,
    /// Mass of the displaced water, kg.
    pub displaced_kg: f64,
    /// Point at which the weight of the displaced water acts.
    pub center_of_buoyancy_m: Vector3<f64>,
    /// Dry inertia, about the link's origin.
    pub rigid: Inertia,
    /// Added mass of the water, about the link's origin.
    pub added: Inertia,
    /// Drag surfaces, one per collision shape of a link; none for other bodies.
    pub surfaces: Vec<Surface>,
    /// Drag of a vehicle's hull.
    pub hull: Option<HullDrag>,
}

/// Drag of a hull along and about its own axes, `-(linear + quadratic |v|) v`; x, y, z, then about x, y, z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HullDrag {
    /// Pose of the hull's axes in the base frame.
    pub base_from_hull: Isometry3<f64>,
    /// Linear coefficients, N s/m and N m s/rad.
    pub linear: [f64; 6],
    /// Quadratic coefficients, N s2/m2 and N m s2/rad2.
    pub quadratic: [f64; 6],
}

/// Drag surfaces of a body: at three points along its longest axis, per axis of its shape, in the link's frame.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Points at each of which a third of the drag acts.
    pub points_m: [Vector3<f64>; 3],
    /// Axes of the shape as columns.
    pub axes: Matrix3<f64>,
    /// `1/2 rho Cd A` of a third of the shape seen along each axis, N s2/m2.
    pub factors: Vector3<f64>,
}

/// Properties of the water about an arm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WaterProperties {
    pub density_kg_m3: f64,
    pub drag_coefficient: f64,
    /// Scale of the theoretical added mass; 0 for none.
    pub added_mass_coefficient: f64,
    /// Weight of the displaced water over that of the body.
    pub buoyancy_fraction: f64,
}

impl WaterProperties {
    pub(crate) fn of(spec: &crate::spec::WaterSpec) -> Self {
        Self {
            density_kg_m3: spec.density_kg_m3,
            drag_coefficient: spec.drag_coefficient,
            added_mass_coefficient: spec.added_mass_coefficient,
            buoyancy_fraction: spec.buoyancy(),
        }
    }
}

impl Body {
    /// Builds a link of the nominal model in water.
    pub(crate) fn link(link: &LinkBody, water: &WaterProperties) -> Self {
        let is_wet = water.density_kg_m3 > 0.0;
        let added =
            link.collisions.iter().map(|placed| added_inertia(placed, water)).fold(Inertia::zero(), |a, b| a + b);
        Self {
            mass_kg: link.mass_kg,
            com_m: link.com_m,
            displaced_kg: if is_wet { water.buoyancy_fraction * link.mass_kg } else { 0.0 },
            center_of_buoyancy_m: link.volume_centroid_m().unwrap_or(link.com_m),
            rigid: Inertia::rigid(link.mass_kg, &link.com_m, &link.inertia_kg_m2),
            added,
            surfaces: link.collisions.iter().filter(|_| is_wet).map(|placed| Surface::of(placed, water)).collect(),
            hull: None,
        }
    }

    /// Builds a link of the nominal model in the standard world's sea water, which carries `buoyancy_fraction` of its
    /// weight.
    #[must_use]
    pub fn in_sea_water(link: &LinkBody, buoyancy_fraction: f64) -> Self {
        let spec = crate::spec::WaterSpec { buoyancy_fraction: Some(buoyancy_fraction), ..Default::default() };
        Self::link(link, &WaterProperties::of(&spec))
    }

    /// Builds a body without water.
    #[must_use]
    pub fn dry(mass_kg: f64, com_m: Vector3<f64>, about_com_kg_m2: &Matrix3<f64>) -> Self {
        Self {
            mass_kg,
            com_m,
            displaced_kg: 0.0,
            center_of_buoyancy_m: com_m,
            rigid: Inertia::rigid(mass_kg, &com_m, about_com_kg_m2),
            added: Inertia::zero(),
            surfaces: Vec::new(),
            hull: None,
        }
    }

    /// Returns true if the water exerts no force on the body.
    pub(super) fn is_dry(&self) -> bool {
        self.surfaces.is_empty() && self.hull.is_none() && self.displaced_kg == 0.0 && self.added == Inertia::zero()
    }

    /// Returns the dry inertia in the parent's frame: the inertia about the centre of mass is turned, the rest follows
    /// from that centre.
    pub(super) fn placed_dry(&self, parent_from_body: &Isometry3<f64>) -> Inertia {
        let at_origin = |c: &Vector3<f64>| (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * self.mass_kg;
        let about_com = self.rigid.rotational - at_origin(&self.com_m);
        let r = parent_from_body.rotation.to_rotation_matrix();
        let com = r * self.com_m + parent_from_body.translation.vector;
        Inertia {
            rotational: r * about_com * r.transpose() + at_origin(&com),
            coupling: skew(&(com * self.mass_kg)),
            linear: Matrix3::identity() * self.mass_kg,
        }
    }

    /// Returns a body without mass, for a base with prescribed motion.
    #[must_use]
    pub fn none() -> Self {
        Self::dry(0.0, Vector3::zeros(), &Matrix3::zeros())
    }

    /// Returns gravity, and the weight of the displaced water against it at its centre. Accelerating water pushes a
    /// body as it would push the water in its place (Froude and Krylov).
    pub(crate) fn weight(
        &self,
        place: &Isometry3<f64>,
        gravity: &Vector3<f64>,
        water_acceleration: &Vector3<f64>,
    ) -> Force {
        let com = place.rotation * self.com_m + place.translation.vector;
        let weight = Force::at(&com, &(self.mass_kg * gravity));
        if self.displaced_kg == 0.0 {
            return weight;
        }
        let center = place.rotation * self.center_of_buoyancy_m + place.translation.vector;
        weight + Force::at(&center, &(self.displaced_kg * (water_acceleration - gravity)))
    }

    /// Returns Morison's drag, `-1/2 rho Cd A |v| v` per axis of each shape at points along it. `motion` is that of the
    /// body against the water.
    pub(super) fn drag(&self, place: &Isometry3<f64>, motion: &Motion) -> Force {
        let mut total = Force::zero();
        if let Some(hull) = &self.hull {
            return hull.drag(motion);
        }
        if self.surfaces.is_empty() {
            return total;
        }
        // In the link's own frame, where the points and axes are.
        let to_link = place.rotation.inverse();
        let rate = to_link * motion.angular;
        let velocity = to_link * motion.at(&place.translation.vector);
        for surface in &self.surfaces {
            for point in &surface.points_m {
                let local = surface.axes.tr_mul(&(velocity + rate.cross(point)));
                let force = surface.axes * local.zip_map(&surface.factors, |v, factor| -factor * v.abs() * v);
                total += Force::at(point, &force);
            }
        }
        let force = place.rotation * total.force;
        Force::new(place.rotation * total.moment + place.translation.vector.cross(&force), force)
    }
}

impl HullDrag {
    /// Returns the drag about the base's origin; `motion` is the base's against the water.
    fn drag(&self, motion: &Motion) -> Force {
        let place = &self.base_from_hull;
        let to_hull = place.rotation.inverse();
        let (v, w) = (to_hull * motion.at(&place.translation.vector), to_hull * motion.angular);
        let along = |i: usize, v: f64| -(self.linear[i] + self.quadratic[i] * v.abs()) * v;
        let force = place.rotation * Vector3::from_fn(|i, _| along(i, v[i]));
        let moment = place.rotation * Vector3::from_fn(|i, _| along(3 + i, w[i]));
        Force::new(moment + place.translation.vector.cross(&force), force)
    }
}

impl Surface {
    /// Builds the surfaces of a shape: each point has a third of the areas of the box about it.
    pub(super) fn of(placed: &PlacedShape, water: &WaterProperties) -> Self {
        let size = Vector3::from(placed.shape.box_m());
        let areas = Vector3::new(size.y * size.z, size.x * size.z, size.x * size.y);
        let long = size.imax();
        let place = placed.owner_from_shape;
        let points_m = [-1.0, 0.0, 1.0].map(|side| {
            let mut along = Vector3::zeros();
            along[long] = side * size[long] / 3.0;
            place.translation.vector + place.rotation * along
        });
        Self {
            points_m,
            axes: *place.rotation.to_rotation_matrix().matrix(),
            factors: areas * (0.5 * water.density_kg_m3 * water.drag_coefficient / 3.0),
        }
    }
}

/// Returns the added mass of a shape in its owner's frame. A sphere's is half the displaced mass. Another shape's,
/// across each axis, is that of a strip: `rho pi/4 a2 b` for a face of sides a <= b. Pabst's factor corrects its finite
/// length (Pabst 1930; DNV-RP-C205 table A-2). In rotation, the strips of the longest axis move across the water.
pub(super) fn added_inertia(placed: &PlacedShape, water: &WaterProperties) -> Inertia {
    let size = Vector3::from(placed.shape.box_m());
    let scale = water.density_kg_m3 * water.added_mass_coefficient;
    let is_ball = matches!(placed.shape, armcal_core::robot::Shape::Sphere { .. });
    let mass = if is_ball {
        // 1/2 rho 4/3 pi r3 of each direction.
        Vector3::repeat(scale * std::f64::consts::PI / 12.0 * size.x.powi(3))
    } else {
        Vector3::from_fn(|axis, _| scale * face_added_volume_m3(size[(axis + 1) % 3], size[(axis + 2) % 3]))
    };
    let long = size.imax();
    let lever2 = if is_ball { 0.0 } else { size[long] * size[long] / 12.0 };
    // Turning about one of the two short axes moves the strips along the other.
    let rotational = Vector3::from_fn(|axis, _| if axis == long { 0.0 } else { mass[3 - axis - long] * lever2 });
    let own = Inertia {
        rotational: Matrix3::from_diagonal(&rotational),
        coupling: Matrix3::zeros(),
        linear: Matrix3::from_diagonal(&mass),
    };
    own.placed(&placed.owner_from_shape)
}

/// Returns the volume of water that moves with a face of sides `a`, `b`.
fn face_added_volume_m3(a: f64, b: f64) -> f64 {
    let (short, long) = (a.min(b), a.max(b));
    let slender = long / short;
    let square = 1.0 + slender * slender;
    let pabst = slender / square.sqrt() * (1.0 - 0.425 * slender / square);
    std::f64::consts::FRAC_PI_4 * short * short * long * pabst
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::robot::Shape;

    pub(super) const SEA: WaterProperties = WaterProperties {
        density_kg_m3: 1025.0,
        drag_coefficient: 1.2,
        added_mass_coefficient: 1.0,
        buoyancy_fraction: 0.2,
    };

    fn at_origin(shape: Shape) -> PlacedShape {
        PlacedShape { owner_from_shape: Isometry3::identity(), shape, color_rgb: [0; 3] }
    }

    /// A 0.84 m x 0.14 m cylinder at 0.5 m/s feels about 17 N (Morison, Cd 1.2).
    #[test]
    fn drag_of_a_cylinder_across_the_water_is_morisons() {
        let placed = at_origin(Shape::Cylinder { radius_m: 0.07, length_m: 0.84 });
        let total = 3.0 * Surface::of(&placed, &SEA).factors.x * 0.5 * 0.5;
        assert!((total - 18.0).abs() < 1.0, "{total} N");
    }

    /// DNV-RP-C205, table A-2: a long cylinder displaces its own water; a square plate 0.579 of a strip; a sphere half.
    #[test]
    fn added_mass_is_that_of_the_tables() {
        let long = added_inertia(&at_origin(Shape::Cylinder { radius_m: 0.05, length_m: 2.0 }), &SEA);
        let displaced = 1025.0 * std::f64::consts::PI * 0.0025 * 2.0;
        assert!((long.linear[(0, 0)] / displaced - 1.0).abs() < 0.03, "{}", long.linear[(0, 0)] / displaced);
        assert!(long.linear[(2, 2)] < 0.05 * long.linear[(0, 0)], "along its axis it slips through");
        let square = face_added_volume_m3(1.0, 1.0) / std::f64::consts::FRAC_PI_4;
        assert!((square - 0.579).abs() < 0.03, "{square}");
        let oblong = face_added_volume_m3(1.0, 2.0) / (2.0 * std::f64::consts::FRAC_PI_4);
        assert!((oblong - 0.757).abs() < 0.03, "{oblong}");
        let ball = added_inertia(&at_origin(Shape::Sphere { radius_m: 0.3 }), &SEA);
        let half = 0.5 * 1025.0 * 4.0 / 3.0 * std::f64::consts::PI * 0.027;
        assert!((ball.linear[(1, 1)] / half - 1.0).abs() < 1e-12);
    }
}

//! Forces on a link in the moving base frame: gravity, buoyancy, inertia of the frame, and drag.
//!
//! The arm is simulated in base axes with a fixed root. What the base's motion does to it comes back as d'Alembert
//! forces on every link, because a multibody whose root moves kinematically feels none. Added mass is left out: the oil
//! column is stiff and the arm slow, so that it would change the state less than drag does.

use nalgebra::{Isometry3, Matrix3, Vector3};
use parry3d::math::Pose3;

use super::spec::WaterSpec;
use super::vehicle::BaseState;
use crate::robot::{LinkBody, PlacedShape, parry_pose};

/// What the loads on one link depend on.
#[derive(Clone, Debug)]
pub(super) struct LinkLoads {
    mass_kg: f64,
    com_m: Vector3<f64>,
    inertia_kg_m2: Matrix3<f64>,
    center_of_buoyancy_m: Vector3<f64>,
    buoyancy_fraction: f64,
    drag: Vec<DragShape>,
}

/// A shape that the water drags at three points along its longest axis, in the link's frame.
#[derive(Clone, Copy, Debug)]
struct DragShape {
    points_m: [Vector3<f64>; 3],
    /// Axes of the shape as columns.
    axes: Matrix3<f64>,
    /// `1/2 rho Cd A` of a third of the shape seen along each axis, N s2/m2.
    factors: Vector3<f64>,
}

/// Motion of one link against the base, in base axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinkMotion {
    pub base_from_link: Isometry3<f64>,
    /// Of the centre of mass, m/s.
    pub com_velocity: Vector3<f64>,
    /// rad/s.
    pub angular_velocity: Vector3<f64>,
}

/// Force at the centre of mass (N) and torque about it (N m), base axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wrench {
    pub force: Vector3<f64>,
    pub torque: Vector3<f64>,
}

impl LinkLoads {
    pub(super) fn new(body: &LinkBody, water: &WaterSpec) -> Self {
        Self {
            mass_kg: body.mass_kg,
            com_m: body.com_m,
            inertia_kg_m2: body.inertia_kg_m2,
            center_of_buoyancy_m: volume_centroid(&body.collisions).unwrap_or(body.com_m),
            buoyancy_fraction: if water.density_kg_m3 > 0.0 { water.buoyancy() } else { 0.0 },
            drag: body.collisions.iter().map(|placed| drag_shape(placed, water)).collect(),
        }
    }

    /// The centre of mass in base axes, m.
    pub(super) fn com(&self, base_from_link: &Isometry3<f64>) -> Vector3<f64> {
        base_from_link.rotation * self.com_m + base_from_link.translation.vector
    }

    /// All loads of the moving base and the water.
    pub(super) fn wrench(&self, base: &BaseState, link: &LinkMotion) -> Wrench {
        let mut wrench = self.inertial(base, link);
        self.add_buoyancy(base, link, &mut wrench);
        self.add_drag(base, link, &mut wrench);
        wrench
    }

    /// What gravity and buoyancy do to the link at rest.
    pub(super) fn static_wrench(&self, base: &BaseState, base_from_link: &Isometry3<f64>) -> Wrench {
        let zero = Vector3::zeros();
        let link = LinkMotion { base_from_link: *base_from_link, com_velocity: zero, angular_velocity: zero };
        let mut wrench = Wrench { force: self.mass_kg * base.gravity, torque: zero };
        self.add_buoyancy(base, &link, &mut wrench);
        wrench
    }

    /// Gravity and d'Alembert forces in base axes. With c the centre of mass, v its velocity and wl the link's rate
    /// against the base: `F = m [g - a - alpha x c - w x (w x c) - 2 w x v]`,
    /// `T = -[I alpha + I (w x wl) + (w + wl) x I (w + wl) - wl x I wl]`; the engine adds `wl x I wl` itself.
    fn inertial(&self, base: &BaseState, link: &LinkMotion) -> Wrench {
        let rotation = link.base_from_link.rotation.to_rotation_matrix();
        let inertia = rotation * self.inertia_kg_m2 * rotation.transpose();
        let com = self.com(&link.base_from_link);
        let (w, alpha, wl) = (base.angular_velocity, base.angular_acceleration, link.angular_velocity);
        let acceleration = base.gravity
            - base.acceleration
            - alpha.cross(&com)
            - w.cross(&w.cross(&com))
            - 2.0 * w.cross(&link.com_velocity);
        let total = w + wl;
        let torque = inertia * (alpha + w.cross(&wl)) + total.cross(&(inertia * total)) - wl.cross(&(inertia * wl));
        Wrench { force: self.mass_kg * acceleration, torque: -torque }
    }

    /// Weight of the displaced water at its centre, against gravity; still water does not share the base's
    /// acceleration.
    fn add_buoyancy(&self, base: &BaseState, link: &LinkMotion, wrench: &mut Wrench) {
        let force = -self.buoyancy_fraction * self.mass_kg * base.gravity;
        let lever = link.base_from_link.rotation * (self.center_of_buoyancy_m - self.com_m);
        wrench.force += force;
        wrench.torque += lever.cross(&force);
    }

    /// Morison's drag against still water, per axis of the shape: `-1/2 rho Cd A |v| v` at points along the link.
    fn add_drag(&self, base: &BaseState, link: &LinkMotion, wrench: &mut Wrench) {
        let com = self.com(&link.base_from_link);
        let rotation = link.base_from_link.rotation.to_rotation_matrix();
        let com_velocity = base.velocity + base.angular_velocity.cross(&com) + link.com_velocity;
        let turn = base.angular_velocity + link.angular_velocity;
        for shape in &self.drag {
            let axes = rotation * shape.axes;
            for point_m in &shape.points_m {
                let lever = rotation * (point_m - self.com_m);
                let local = axes.tr_mul(&(com_velocity + turn.cross(&lever)));
                let force = axes * local.zip_map(&shape.factors, |v, factor| -factor * v.abs() * v);
                wrench.force += force;
                wrench.torque += lever.cross(&force);
            }
        }
    }
}

/// Centre of the shapes' volume in the owner's frame; every shape is symmetric about its own centre.
fn volume_centroid(shapes: &[PlacedShape]) -> Option<Vector3<f64>> {
    let mut moment = Vector3::zeros();
    let mut volume = 0.0;
    for placed in shapes {
        let v = placed.shape.to_parry().mass_properties(1.0).mass();
        moment += v * placed.owner_from_shape.translation.vector;
        volume += v;
    }
    (volume > 0.0).then(|| moment / volume)
}

/// Each point takes a third of the areas of the box about the shape.
fn drag_shape(placed: &PlacedShape, water: &WaterSpec) -> DragShape {
    let size = Vector3::from(placed.shape.box_m());
    let areas = Vector3::new(size.y * size.z, size.x * size.z, size.x * size.y);
    let long = size.imax();
    let owner_from_shape = placed.owner_from_shape;
    let points_m = [-1.0, 0.0, 1.0].map(|side| {
        let mut along = Vector3::zeros();
        along[long] = side * size[long] / 3.0;
        owner_from_shape.translation.vector + owner_from_shape.rotation * along
    });
    DragShape {
        points_m,
        axes: *owner_from_shape.rotation.to_rotation_matrix().matrix(),
        factors: areas * (0.5 * water.density_kg_m3 * water.drag_coefficient / 3.0),
    }
}

/// A shape's pose in its owner's frame as parry has it, its axis turned.
pub(super) fn shape_pose(placed: &PlacedShape) -> Pose3 {
    parry_pose(&(placed.owner_from_shape * placed.shape.axis_fix()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Shape;

    /// A 0.84 m x 0.14 m cylinder at 0.5 m/s feels about 17 N (Morison, Cd 1.2).
    #[test]
    fn drag_of_a_cylinder_across_the_water_is_morisons() {
        let shape = Shape::Cylinder { radius_m: 0.07, length_m: 0.84 };
        let placed = PlacedShape { owner_from_shape: Isometry3::identity(), shape, color_rgb: [0; 3] };
        let total = 3.0 * drag_shape(&placed, &WaterSpec::default()).factors.x * 0.5 * 0.5;
        assert!((total - 18.0).abs() < 1.0, "{total} N");
    }
}

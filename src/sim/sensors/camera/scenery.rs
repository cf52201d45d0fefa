//! Solids of a rendered image: the nominal arm, the vehicle, obstacles, the seafloor.

use nalgebra::{Isometry3, Point3};

use crate::body_poses::BodyPoses;
use crate::convert::to_rapier;
use crate::imaging::SolidShape;
use crate::solids::{Carrier, HOUSING_M, seafloor};
use armcal_core::robot::{PlacedShape, Robot, Vehicle, parry_pose};
use armcal_core::routine::Scene;

/// Solid shapes, and the body that carries each.
#[derive(Clone, Debug, Default)]
pub(super) struct Scenery {
    pub shapes: Vec<SolidShape>,
    carried_shapes: Vec<CarriedShape>,
}

#[derive(Clone, Copy, Debug)]
struct CarriedShape {
    carrier: Carrier,
    carrier_from_shape: Isometry3<f64>,
    /// Index of the jaw that carries the shape, if any.
    jaw: Option<usize>,
}

/// Poses of all moving bodies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScenePoses<'a> {
    pub links: &'a BodyPoses,
    pub base_from_world: Isometry3<f64>,
    /// Displacements of the jaws from the nominal model, on their link.
    pub jaws: [Isometry3<f64>; 2],
}

impl Scenery {
    pub(super) fn new(robot: &Robot, vehicle: &Vehicle, scene: &Scene) -> Self {
        let mut scenery = Self::default();
        let base_from_vehicle = vehicle.vehicle_from_base.inverse();
        for (body, link) in robot.bodies.iter().enumerate() {
            // A link without visual shapes shows its collision shapes.
            let shapes = if link.visuals.is_empty() { &link.collisions } else { &link.visuals };
            for placed in shapes.iter().filter(|placed| !is_housing(robot, body, placed)) {
                scenery.push(Carrier::Body(body), &Isometry3::identity(), placed, None);
            }
        }
        for (n, jaw) in robot.gripper.iter().flat_map(|gripper| gripper.jaws.iter().enumerate()) {
            let body = robot.gripper.as_ref().map_or(0, |gripper| gripper.body);
            for placed in &jaw.visuals {
                scenery.push(Carrier::Body(body), &Isometry3::identity(), placed, Some(n));
            }
        }
        for part in &vehicle.parts {
            scenery.push(Carrier::Body(0), base_from_vehicle.isometry(), &part.placed, None);
        }
        for obstacle in &scene.obstacles {
            scenery.push(Carrier::World, &Isometry3::identity(), &obstacle.placed, None);
        }
        if let Some(z_m) = scene.seafloor_z_m {
            scenery.push(Carrier::World, &Isometry3::identity(), &seafloor(z_m), None);
            scenery.shapes.iter_mut().rev().take(1).for_each(|floor| floor.is_ground = true);
        }
        scenery
    }

    fn push(
        &mut self,
        carrier: Carrier,
        carrier_from_owner: &Isometry3<f64>,
        placed: &PlacedShape,
        jaw: Option<usize>,
    ) {
        let carrier_from_shape = carrier_from_owner * placed.owner_from_shape;
        self.carried_shapes.push(CarriedShape { carrier, carrier_from_shape, jaw });
        let PlacedShape { shape, color_rgb, .. } = placed;
        self.shapes.push(SolidShape { shape: shape.clone(), color_rgb: *color_rgb, is_ground: false });
    }

    /// Writes `base_from_shape` of each shape at three instants into `out`; `carried` returns the motions of a body
    /// from the last instant to each of them.
    pub(super) fn place(
        &self,
        poses: &ScenePoses,
        carried: &dyn Fn(usize) -> [Isometry3<f64>; 3],
        out: &mut Vec<[Isometry3<f64>; 3]>,
    ) {
        out.clear();
        let mut of_body = (usize::MAX, [Isometry3::identity(); 3]);
        for shape in &self.carried_shapes {
            out.push(match shape.carrier {
                Carrier::World => [poses.base_from_world * shape.carrier_from_shape; 3],
                Carrier::Body(0) => [shape.carrier_from_shape; 3],
                Carrier::Body(body) => {
                    if of_body.0 != body {
                        of_body = (body, carried(body));
                    }
                    let shift = shape.jaw.map_or_else(Isometry3::identity, |jaw| poses.jaws[jaw]);
                    let now = poses.links.link(body) * shift * shape.carrier_from_shape;
                    of_body.1.map(|moved| moved * now)
                }
            });
        }
    }
}

/// Returns true if a shape holds the camera: it is on the camera's link and near its pupil.
fn is_housing(robot: &Robot, body: usize, placed: &PlacedShape) -> bool {
    let mount = &robot.camera.mount;
    let pose = parry_pose(&(placed.owner_from_shape * placed.shape.axis_fix()));
    let pupil = Point3::from(mount.link_from_frame.translation.vector);
    let local = pose.inverse_transform_point(to_rapier(&pupil.coords));
    body == mount.n_joints && placed.shape.to_parry().distance_to_local_point(local, true) < HOUSING_M
}

//! What the rendered camera sees besides tags: the arm as drawn, the vehicle, obstacles, the seafloor.

use nalgebra::{Isometry3, Point3};

use crate::convert::to_rapier;
use crate::imaging::SolidShape;
use crate::places::BodyPoses;
use crate::solids::{Carrier, HOUSING_M, seafloor};
use armcal_core::robot::{PlacedShape, Robot, Vehicle, parry_pose};
use armcal_core::routine::Scene;

/// Solid shapes, and what each is fixed to.
#[derive(Clone, Debug, Default)]
pub(super) struct Scenery {
    pub shapes: Vec<SolidShape>,
    fixed: Vec<Fixed>,
}

#[derive(Clone, Copy, Debug)]
struct Fixed {
    carrier: Carrier,
    carrier_from_shape: Isometry3<f64>,
    /// 0 or 1 for what slides with a jaw.
    jaw: Option<usize>,
}

/// Where everything is that moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Places<'a> {
    pub links: &'a BodyPoses,
    pub base_from_world: Isometry3<f64>,
    /// Shifts of the jaws from where they are drawn, on their link.
    pub jaws: [Isometry3<f64>; 2],
}

impl Scenery {
    pub(super) fn new(robot: &Robot, vehicle: &Vehicle, scene: &Scene) -> Self {
        let mut scenery = Self::default();
        let base_from_vehicle = vehicle.vehicle_from_base.inverse();
        for (body, link) in robot.bodies.iter().enumerate() {
            // Where nothing is drawn, what the arm must not touch stands in.
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
        self.fixed.push(Fixed { carrier, carrier_from_shape, jaw });
        let PlacedShape { shape, color_rgb, .. } = placed;
        self.shapes.push(SolidShape { shape: shape.clone(), color_rgb: *color_rgb, is_ground: false });
    }

    /// `base_from_shape` of each shape at three instants, into `out`; `carried` moves what is on a body at the last of them to
    /// where it was.
    pub(super) fn place(
        &self,
        places: &Places,
        carried: &dyn Fn(usize) -> [Isometry3<f64>; 3],
        out: &mut Vec<[Isometry3<f64>; 3]>,
    ) {
        out.clear();
        let mut of_body = (usize::MAX, [Isometry3::identity(); 3]);
        for fixed in &self.fixed {
            out.push(match fixed.carrier {
                Carrier::World => [places.base_from_world * fixed.carrier_from_shape; 3],
                Carrier::Body(0) => [fixed.carrier_from_shape; 3],
                Carrier::Body(body) => {
                    if of_body.0 != body {
                        of_body = (body, carried(body));
                    }
                    let shift = fixed.jaw.map_or_else(Isometry3::identity, |jaw| places.jaws[jaw]);
                    let now = places.links.link(body) * shift * fixed.carrier_from_shape;
                    of_body.1.map(|moved| moved * now)
                }
            });
        }
    }
}

/// Whether a shape drawn on a link holds the camera: on its link, and near its eye.
fn is_housing(robot: &Robot, body: usize, placed: &PlacedShape) -> bool {
    let mount = &robot.camera.mount;
    let pose = parry_pose(&(placed.owner_from_shape * placed.shape.axis_fix()));
    let eye = Point3::from(mount.link_from_frame.translation.vector);
    let local = pose.inverse_transform_point(to_rapier(&eye.coords));
    body == mount.n_joints && placed.shape.to_parry().distance_to_local_point(local, true) < HOUSING_M
}

//! The solid things that planning knows: links' shapes, which move, and what stands around the arm.

use nalgebra::{Isometry3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vec3;
use parry3d::shape::{HalfSpace, SharedShape};

use super::certify::Pair;
use super::separation::Placed;
use crate::kinematics::LinkPoses;
use crate::robot::{PlacedShape, Robot, parry_pose};
use crate::streams::MAX_JOINTS;

/// Bodies nearer along the chain than this share a joint or a short link and always nearly touch.
const MIN_BODY_GAP: usize = 2;
/// Larger than any site, m.
const EVERYWHERE_M: f64 = 1e6;
/// The vehicle sways about its station: three times 3 cm, and 0.5 deg three times over at 2 m.
pub(super) const VEHICLE_MOTION_M: f64 = 0.15;

/// A link's shape.
pub(super) struct Moving {
    pub body: usize,
    pub name: String,
    pub shape: SharedShape,
    pub body_from_shape: Isometry3<f64>,
    pub radius_m: f64,
    /// Of the box around the shape in its own axes.
    box_m: ShapeBox,
    /// For each joint before it, an upper bound on the distance of its points from that joint's axis over all angles.
    pub levers_m: [f64; MAX_JOINTS],
}

/// The box around a shape in its own axes.
#[derive(Clone, Copy)]
struct ShapeBox {
    center_m: Vector3<f64>,
    half_extents_m: Vector3<f64>,
    /// Of a sphere about the centre that holds the shape.
    radius_m: f64,
}

/// A shape that stands where it is.
pub(super) struct Standing {
    pub name: String,
    pub shape: SharedShape,
    pub placed: Placed,
    pub center_m: Vector3<f64>,
    /// Infinite for the seafloor.
    pub radius_m: f64,
    /// What the vehicle's motion may take from the distance; zero for its own parts.
    pub motion_m: f64,
}

impl Moving {
    pub fn new(robot: &Robot, body: usize, name: &str, placed: &PlacedShape) -> Self {
        let body_from_shape = placed.owner_from_shape * placed.shape.axis_fix();
        let box_m = ShapeBox::new(placed);
        let own_m = (body_from_shape * nalgebra::Point3::from(box_m.center_m)).coords.norm() + box_m.radius_m;
        let mut levers_m = [0.0; MAX_JOINTS];
        for (joint, lever_m) in levers_m.iter_mut().enumerate().take(body) {
            let links = &robot.chain.joints()[joint + 1..body];
            *lever_m = own_m + links.iter().map(|next| next.parent_from_joint.translation.vector.norm()).sum::<f64>();
        }
        Self {
            body,
            name: name.to_owned(),
            shape: placed.shape.to_parry(),
            body_from_shape,
            radius_m: placed.shape.bounding_radius_m(),
            box_m,
            levers_m,
        }
    }

    pub fn placed(&self, poses: &LinkPoses) -> Placed {
        self.box_m.placed(&(poses.link(self.body) * self.body_from_shape))
    }
}

impl ShapeBox {
    pub fn new(placed: &PlacedShape) -> Self {
        let aabb = placed.shape.to_parry().compute_local_aabb();
        let (center, half) = (aabb.center(), aabb.half_extents());
        let center_m = Vector3::new(center.x, center.y, center.z);
        let half_extents_m = Vector3::new(half.x, half.y, half.z);
        let radius_m = half_extents_m.norm().min(placed.shape.bounding_radius_m() + center_m.norm());
        Self { center_m, half_extents_m, radius_m }
    }

    /// Puts the box, and a larger one along the base's axes around it, where the shape is.
    pub fn placed(&self, base_from_shape: &Isometry3<f64>) -> Placed {
        let turn = base_from_shape.rotation.to_rotation_matrix();
        let half_axes = [0, 1, 2].map(|k| vec3(&(turn.matrix().column(k) * self.half_extents_m[k])));
        let half = half_axes[0].abs() + half_axes[1].abs() + half_axes[2].abs();
        let center = vec3(&(base_from_shape * nalgebra::Point3::from(self.center_m)).coords);
        Placed {
            pose: parry_pose(base_from_shape),
            bounds: Aabb::new(center - half, center + half),
            center,
            half_axes,
            radius_m: self.radius_m,
        }
    }
}

/// Every two shapes that may touch. What is fixed to the base stands where it is bolted on.
pub(super) fn pairs(moving: &[Moving], standing: &[Standing]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (i, shape) in moving.iter().enumerate().filter(|(_, shape)| shape.body > 0) {
        pairs.extend((0..standing.len()).map(|k| Pair::Standing { moving: i, standing: k }));
        let inner = moving.iter().enumerate().filter(|(_, other)| other.body + MIN_BODY_GAP <= shape.body);
        pairs.extend(inner.map(|(j, _)| Pair::Links { outer: i, inner: j }));
    }
    pairs
}

impl Standing {
    pub fn new(name: &str, placed: &PlacedShape, base_from_owner: &Isometry3<f64>, motion_m: f64) -> Self {
        let isometry = base_from_owner * placed.owner_from_shape * placed.shape.axis_fix();
        Self {
            name: name.to_owned(),
            shape: placed.shape.to_parry(),
            placed: Placed {
                bounds: placed.shape.to_parry().compute_aabb(&parry_pose(&isometry)),
                ..ShapeBox::new(placed).placed(&isometry)
            },
            center_m: isometry.translation.vector,
            radius_m: placed.shape.bounding_radius_m(),
            motion_m,
        }
    }

    pub fn seafloor(z_m: f64, base_from_world: &Isometry3<f64>) -> Self {
        let isometry = base_from_world * Isometry3::translation(0.0, 0.0, z_m);
        Self {
            name: "seafloor".to_owned(),
            shape: SharedShape::new(HalfSpace::new(Vec3::new(0.0, 0.0, 1.0))),
            placed: Placed {
                // A tilted base tilts the half-space too, so no box leaves it out.
                bounds: Aabb::new(Vec3::splat(-EVERYWHERE_M), Vec3::splat(EVERYWHERE_M)),
                pose: parry_pose(&isometry),
                radius_m: f64::INFINITY,
                ..Placed::NOWHERE
            },
            center_m: isometry.translation.vector,
            radius_m: f64::INFINITY,
            motion_m: VEHICLE_MOTION_M,
        }
    }
}

pub(super) fn vec3(v: &Vector3<f64>) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

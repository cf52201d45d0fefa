//! Collision shapes of planning: the links' moving shapes and the static shapes around the arm.

use crate::plan::constants::clearance_shapes::{EVERYWHERE_M, MIN_BODY_GAP};
use nalgebra::{Isometry3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::math::{Mat3, Pose3, Vec3};
use parry3d::shape::{HalfSpace, SharedShape};

use crate::plan::clearance::pair::Pair;
use crate::plan::clearance::separation::{Placed, SupportShape};
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::{PlacedShape, Robot, Shape, parry_pose};
use armcal_core::streams::MAX_JOINTS;

/// A link's shape.
pub(crate) struct LinkShape {
    pub body: usize,
    pub name: String,
    pub shape: SharedShape,
    pub body_from_shape: Isometry3<f64>,
    pub radius_m: f64,
    body_from_shape_pose: Pose3,
    box_m: ShapeBox,
    /// Upper bound on the distance of its points from the axis of each joint before it, over all angles, m.
    pub levers_m: [f64; MAX_JOINTS],
}

/// The box around a shape in its own axes.
#[derive(Clone, Copy)]
struct ShapeBox {
    center_m: Vec3,
    half_extents_m: Vec3,
    /// Radius of a sphere about the centre that holds the shape, m.
    radius_m: f64,
    outline: SupportShape,
}

/// A static shape.
pub(crate) struct StaticShape {
    pub name: String,
    pub shape: SharedShape,
    pub placed: Placed,
    pub center_m: Vector3<f64>,
    /// Bounding radius, m; infinite for the seafloor.
    pub radius_m: f64,
    /// True if it is fixed in the world: the vehicle's motion moves the arm against it.
    pub is_of_world: bool,
}

impl LinkShape {
    pub fn new(robot: &Robot, body: usize, name: &str, placed: &PlacedShape) -> Self {
        let body_from_shape = placed.owner_from_shape * placed.shape.axis_fix();
        let box_m = ShapeBox::new(placed);
        let body_from_shape_pose = parry_pose(&body_from_shape);
        let own_m = (body_from_shape_pose * box_m.center_m).length() + box_m.radius_m;
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
            body_from_shape_pose,
            box_m,
            levers_m,
        }
    }

    pub fn placed(&self, poses: &LinkPoses) -> Placed {
        self.placed_on(&parry_pose(poses.link(self.body)))
    }

    /// Places the shape with its own frame at `base_from_shape`.
    pub fn placed_at(&self, base_from_shape: &Pose3) -> Placed {
        self.box_m.placed(base_from_shape)
    }

    /// Places the shape with its body at `base_from_body`, as parry's pose.
    pub fn placed_on(&self, base_from_body: &Pose3) -> Placed {
        self.placed_at(&(*base_from_body * self.body_from_shape_pose))
    }
}

impl ShapeBox {
    pub fn new(placed: &PlacedShape) -> Self {
        let aabb = placed.shape.to_parry().compute_local_aabb();
        let (center_m, half_extents_m) = (aabb.center(), aabb.half_extents());
        let radius_m = half_extents_m.length().min(placed.shape.bounding_radius_m() + center_m.length());
        let outline = match placed.shape {
            Shape::Box { .. } => SupportShape::Box,
            Shape::Cylinder { .. } => SupportShape::Cylinder,
            Shape::Capsule { radius_m, length_m } => {
                SupportShape::Capsule { core: length_m / (length_m + 2.0 * radius_m), radius_m }
            }
            Shape::Sphere { radius_m } => SupportShape::Ball { radius_m },
            Shape::Hull(_) => SupportShape::Hull,
        };
        Self { center_m, half_extents_m, radius_m, outline }
    }

    /// Places the box, and computes the shape's bounding box along the base's axes.
    pub fn placed(&self, base_from_shape: &Pose3) -> Placed {
        let turn = Mat3::from_quat(base_from_shape.rotation);
        let half = self.half_extents_m;
        let half_axes = [turn.x_axis * half.x, turn.y_axis * half.y, turn.z_axis * half.z];
        let [a, b, c] = half_axes.map(Vec3::abs);
        let around = match self.outline {
            SupportShape::Cylinder => {
                let round = a * a + c * c;
                b + Vec3::new(round.x.sqrt(), round.y.sqrt(), round.z.sqrt())
            }
            SupportShape::Capsule { core, radius_m } => core * c + Vec3::splat(radius_m),
            SupportShape::Ball { radius_m } => Vec3::splat(radius_m),
            SupportShape::Box | SupportShape::Hull | SupportShape::HalfSpace { .. } => a + b + c,
        };
        let center = *base_from_shape * self.center_m;
        Placed {
            pose: *base_from_shape,
            bounds: Aabb { mins: center - around, maxs: center + around },
            center,
            half_axes,
            radius_m: self.radius_m,
            outline: self.outline,
        }
    }
}

/// Returns every two shapes that are kept apart. Shapes fixed to the base keep their mounting position.
pub(crate) fn pairs(robot: &Robot, moving: &[LinkShape], standing: &[StaticShape]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (i, shape) in moving.iter().enumerate().filter(|(_, shape)| shape.body > 0) {
        let may_touch = |other: &str| robot.allowed_pairs.has(&shape.name, other);
        let around = standing.iter().enumerate().filter(|(_, other)| other.is_of_world || !may_touch(&other.name));
        pairs.extend(around.map(|(k, _)| Pair::Standing { moving: i, standing: k }));
        let is_apart = |other: &LinkShape| other.body + MIN_BODY_GAP <= shape.body && !may_touch(&other.name);
        let inner = moving.iter().enumerate().filter(|(_, other)| is_apart(other));
        pairs.extend(inner.map(|(j, _)| Pair::Links { outer: i, inner: j }));
    }
    pairs
}

impl StaticShape {
    pub fn new(name: &str, placed: &PlacedShape, base_from_owner: &Isometry3<f64>) -> Self {
        let isometry = base_from_owner * placed.owner_from_shape * placed.shape.axis_fix();
        Self {
            name: name.to_owned(),
            shape: placed.shape.to_parry(),
            placed: ShapeBox::new(placed).placed(&parry_pose(&isometry)),
            center_m: isometry.translation.vector,
            radius_m: placed.shape.bounding_radius_m(),
            is_of_world: false,
        }
    }

    /// Marks the shape as fixed in the world instead of to the vehicle.
    pub fn of_world(self) -> Self {
        Self { is_of_world: true, ..self }
    }

    pub fn seafloor(z_m: f64, base_from_world: &Isometry3<f64>) -> Self {
        let isometry = base_from_world * Isometry3::translation(0.0, 0.0, z_m);
        Self {
            name: "seafloor".to_owned(),
            shape: SharedShape::new(HalfSpace::new(Vec3::new(0.0, 0.0, 1.0))),
            placed: Placed {
                // A tilted base tilts the half-space too, so this box excludes none of it.
                bounds: Aabb::new(Vec3::splat(-EVERYWHERE_M), Vec3::splat(EVERYWHERE_M)),
                pose: parry_pose(&isometry),
                center: vec3(&isometry.translation.vector),
                radius_m: f64::INFINITY,
                outline: SupportShape::HalfSpace { normal: vec3(&(isometry.rotation * Vector3::z())) },
                ..Placed::NOWHERE
            },
            center_m: isometry.translation.vector,
            radius_m: f64::INFINITY,
            is_of_world: true,
        }
    }
}

pub(crate) fn vec3(v: &Vector3<f64>) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

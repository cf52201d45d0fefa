//! Soft ground under a vehicle: springs, dampers and friction at the corners of its parts.
//!
//! A corner at depth `s` below the height where the ground begins is pushed up by `max(0, k s + d ds/dt)`. It is held
//! sideways by a bristle of the same stiffness, up to `mu` times that force. Below this limit the bristle is only a
//! spring, so that nothing creeps. A parked vehicle has already sunk in: the ground begins where each corner carries
//! its share.

use nalgebra::{Isometry3, Matrix3, Vector2, Vector3};

use crate::dynamics::Force;
use crate::spec::GroundSpec;
use crate::vehicle::base_state::BaseState;
use armcal_core::robot::{PlacedShape, Vehicle};

/// Corners of a vehicle's parts, and the ground below them.
#[derive(Clone, Debug)]
pub(super) struct Ground {
    spec: GroundSpec,
    corners: Vec<Corner>,
    /// Largest distance of a corner from the base's origin, m.
    reach_m: f64,
    /// Highest point at which the ground begins, world frame.
    highest_z_m: f64,
    /// Load that the ground carried in the last step, N.
    pub(super) load_n: f64,
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    /// Position of the corner, base frame.
    at_m: Vector3<f64>,
    /// Height at which the ground begins, world frame.
    begins_z_m: f64,
    /// Position at which the bristle is not bent, world frame; `None` above the ground.
    anchor_m: Option<Vector2<f64>>,
}

/// Height above the lowest corner up to which corners are in the ground when a vehicle parks, m.
const SKID_M: f64 = 0.01;

impl Ground {
    /// Returns a plane onto which the vehicle may descend.
    pub(super) fn plane(spec: &GroundSpec, vehicle: &Vehicle, z_m: f64) -> Self {
        let corner = |at_m| Corner { at_m, begins_z_m: z_m, anchor_m: None };
        let base_from_vehicle = vehicle.vehicle_from_base.inverse();
        let corners =
            corners(vehicle).map(|at| corner(base_from_vehicle.isometry().transform_point(&at.into()).coords));
        Self::new(spec, corners.collect())
    }

    fn new(spec: &GroundSpec, corners: Vec<Corner>) -> Self {
        let reach_m = corners.iter().map(|corner| corner.at_m.norm()).fold(0.0, f64::max);
        let highest_z_m = corners.iter().map(|corner| corner.begins_z_m).fold(f64::NEG_INFINITY, f64::max);
        Self { spec: *spec, corners, reach_m, highest_z_m, load_n: 0.0 }
    }

    /// Returns the ground into which a vehicle on its station has sunk, under a weight that acts above `center_m`
    /// (vehicle frame). `None` if that point is not between its lowest corners. The corners' shares vary linearly with
    /// their positions.
    pub(super) fn parked(spec: &GroundSpec, vehicle: &Vehicle, center_m: &Vector3<f64>) -> Option<Self> {
        let lowest_m = corners(vehicle).map(|at| at.z).fold(f64::INFINITY, f64::min);
        let skids: Vec<Vector3<f64>> = corners(vehicle).filter(|at| at.z <= lowest_m + SKID_M).collect();
        let place = |at: &Vector3<f64>| Vector3::new(1.0, at.x - center_m.x, at.y - center_m.y);
        let moments: Matrix3<f64> = skids.iter().map(|at| place(at) * place(at).transpose()).sum();
        let share = moments.try_inverse()? * Vector3::new(spec.vehicle_weight_n, 0.0, 0.0);
        let base_from_vehicle = vehicle.vehicle_from_base.inverse();
        let corners: Vec<Corner> = skids
            .iter()
            .map(|at| Corner {
                at_m: base_from_vehicle.isometry().transform_point(&(*at).into()).coords,
                begins_z_m: at.z + share.dot(&place(at)) / spec.stiffness_n_m,
                anchor_m: Some(at.xy()),
            })
            .collect();
        let all_carry = skids.iter().all(|at| share.dot(&place(at)) > 0.0);
        all_carry.then(|| Self::new(spec, corners))
    }

    /// Returns the force on the vehicle about the base's origin, base axes.
    pub(super) fn force(&mut self, base: &BaseState) -> Force {
        let GroundSpec { stiffness_n_m: k, damping_s, friction, .. } = self.spec;
        let damping = k * damping_s;
        let (pose, motion) = (base.world_from_base.isometry(), base.motion());
        let mut total = Force::zero();
        self.load_n = 0.0;
        if pose.translation.z - self.reach_m > self.highest_z_m {
            return total;
        }
        for corner in &mut self.corners {
            let at = pose.transform_point(&corner.at_m.into());
            let depth_m = corner.begins_z_m - at.z;
            if depth_m <= 0.0 {
                corner.anchor_m = None;
                continue;
            }
            let rate = pose.rotation * motion.at(&corner.at_m);
            let up_n = (k * depth_m - damping * rate.z).max(0.0);
            let most_n = friction * up_n;
            let anchor = corner.anchor_m.get_or_insert(at.coords.xy());
            let bend = at.coords.xy() - *anchor;
            if k * bend.norm() > most_n {
                *anchor += bend * (1.0 - most_n / (k * bend.norm()));
            }
            let held = -k * (at.coords.xy() - *anchor) - damping * rate.xy();
            let side = held.cap_magnitude(most_n);
            self.load_n += up_n;
            total += Force::at(&corner.at_m, &(pose.rotation.inverse() * Vector3::new(side.x, side.y, up_n)));
        }
        total
    }
}

/// Returns the corners of the boxes about all parts, vehicle frame.
fn corners(vehicle: &Vehicle) -> impl Iterator<Item = Vector3<f64>> {
    vehicle.parts.iter().flat_map(|part| box_corners(&part.placed))
}

fn box_corners(placed: &PlacedShape) -> [Vector3<f64>; 8] {
    let half = Vector3::from(placed.shape.box_m()) * 0.5;
    let place: &Isometry3<f64> = &placed.owner_from_shape;
    std::array::from_fn(|k| {
        let sign = |axis: usize| if k >> axis & 1 == 0 { -1.0 } else { 1.0 };
        let corner = Vector3::from_fn(|axis, _| sign(axis) * half[axis]);
        place.transform_point(&corner.into()).coords
    })
}

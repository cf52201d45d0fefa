//! Bound on the relative motion of pairs of shapes, from the paths of joints, ground and mount.

use nalgebra::Isometry3;

use crate::solids::{Carrier, Solids};
use armcal_core::kinematics::Chain;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Configuration of the arm, pose of the ground and pose of the mount at one step.
#[derive(Clone, Copy)]
pub(super) struct ArmPlace {
    pub angles: JointAngles,
    pub base_from_ground: Isometry3<f64>,
    /// Pose of the first joint on the base, which moves if the mount yields.
    pub first_place: Isometry3<f64>,
}

/// Paths since the start.
pub(super) struct PairMotion {
    /// State after the last step.
    at: ArmPlace,
    path_rad: [f64; MAX_JOINTS],
    /// Bounds on the paths of ground and mount within the arm's reach, m.
    ground_path_m: f64,
    mount_path_m: f64,
    reach_m: f64,
}

/// Pairs of shapes that are moved against each other by the same joints.
pub(super) struct PairGroup {
    pub pairs: Vec<(usize, usize)>,
    /// Largest relative motion of the pairs per motion of each joint, m/rad; zero for other joints.
    pub levers_m: [f64; MAX_JOINTS],
    /// Largest distance of the vehicle's points from the base's origin, m; zero for pairs of the arm.
    vehicle_reach_m: f64,
    is_on_ground: bool,
    /// True for pairs of the arm with the base or the ground.
    is_on_mount: bool,
}

/// Paths of each joint, of the ground and of the mount in one step.
pub(super) struct StepPath {
    pub joints_rad: [f64; MAX_JOINTS],
    pub ground_m: f64,
    pub mount_m: f64,
}

impl PairMotion {
    /// Starts at `start`. All watched points are within `reach_m` of the base's origin, which differs from the first
    /// joint's axis.
    pub(super) fn new(groups: &[PairGroup], start: &ArmPlace) -> Self {
        let first_m = start.first_place.translation.vector.norm();
        let reach_m = |group: &PairGroup| (first_m + group.levers_m[0]).max(group.vehicle_reach_m);
        Self {
            at: *start,
            path_rad: [0.0; MAX_JOINTS],
            ground_path_m: 0.0,
            mount_path_m: 0.0,
            reach_m: groups.iter().map(reach_m).fold(first_m, f64::max),
        }
    }

    /// Takes the state after a step.
    pub(super) fn follow(&mut self, place: &ArmPlace) -> StepPath {
        let mut path = StepPath { joints_rad: [0.0; MAX_JOINTS], ground_m: 0.0, mount_m: 0.0 };
        for (joint, (now, before)) in place.angles.iter().zip(self.at.angles.iter()).enumerate() {
            path.joints_rad[joint] = (now - before).abs();
            self.path_rad[joint] += path.joints_rad[joint];
        }
        let moved_m = |before: &Isometry3<f64>, now: &Isometry3<f64>| {
            let moved = before.inverse() * now;
            moved.translation.vector.norm() + moved.rotation.angle() * self.reach_m
        };
        if place.base_from_ground != self.at.base_from_ground {
            path.ground_m = moved_m(&self.at.base_from_ground, &place.base_from_ground);
        }
        if place.first_place != self.at.first_place {
            path.mount_m = moved_m(&self.at.first_place, &place.first_place);
        }
        self.ground_path_m += path.ground_m;
        self.mount_path_m += path.mount_m;
        self.at = *place;
        path
    }

    /// Returns the largest possible relative motion of a group's pairs since the start, m.
    pub(super) fn path_m(&self, group: &PairGroup) -> f64 {
        let ground_m = if group.is_on_ground { self.ground_path_m } else { 0.0 };
        let mount_m = if group.is_on_mount { self.mount_path_m } else { 0.0 };
        let levers = group.levers_m.iter().zip(&self.path_rad);
        levers.map(|(lever_m, path)| lever_m * path).sum::<f64>() + ground_m + mount_m
    }
}

impl PairGroup {
    /// Returns the watched pairs of shapes on `inner` and on the body `outer`; `None` if there are none.
    pub(super) fn new(chain: &Chain, solids: &Solids, inner: Carrier, outer: usize) -> Option<Self> {
        let first = if let Carrier::Body(body) = inner { body } else { 0 };
        let pairs = solids.watched_pairs(inner, outer);
        (!pairs.is_empty()).then(|| Self {
            pairs,
            levers_m: solids.levers_m(chain, first, outer),
            is_on_ground: inner == Carrier::World,
            vehicle_reach_m: if outer == 0 { solids.extent_m(Carrier::Body(0)) } else { 0.0 },
            is_on_mount: first == 0 && outer > 0,
        })
    }
}

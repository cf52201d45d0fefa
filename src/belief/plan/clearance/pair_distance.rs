//! Queries of the certificate on the model: shapes, their placement and the distance that a pair needs.

use parry3d::math::{Pose3, Vec3};

use crate::plan::clearance::model::{ClearanceModel, ClosestPair, SELF_MARGIN_REDUCTION_M, TOUCHING_M};
use crate::plan::clearance::pair::{BodyPair, Pair};
use crate::plan::clearance::self_collision::UNSEEN_M;
use crate::plan::clearance::separation::{Placed, Shapes, separate};
use crate::plan::motion::timing::Timing;
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::Robot;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

impl ClearanceModel<'_> {
    pub(crate) fn link_poses(&self, angles: &JointAngles) -> LinkPoses {
        self.robot.chain.link_poses(angles)
    }

    pub(crate) fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// True if a joint's error counts: false only for a joint that turns a round tool about its axis.
    pub(crate) fn has_error(&self, joint: usize) -> bool {
        self.has_error[joint]
    }

    pub(crate) fn has_stops(&self, joint: usize) -> bool {
        self.robot.chain.joints()[joint].limits.is_some()
    }

    pub(crate) fn stowed(&self) -> &JointAngles {
        &self.robot.stowed
    }

    pub(crate) fn robot(&self) -> &Robot {
        self.robot
    }

    pub(crate) fn timing(&self) -> &Timing {
        &self.timing
    }

    /// Returns the largest displacement of the arm's farthest point per radian of each joint, m/rad.
    pub(crate) fn levers_m(&self) -> [f64; MAX_JOINTS] {
        let longest = |joint: usize| self.moving.iter().map(|shape| shape.levers_m[joint]).fold(0.0, f64::max);
        std::array::from_fn(longest)
    }

    pub(crate) fn pair(&self, number: usize) -> Pair {
        self.pairs[number]
    }

    pub(crate) fn n_moving(&self) -> usize {
        self.moving.len()
    }

    /// Returns the body that carries a moving shape.
    pub(crate) fn body(&self, shape: usize) -> usize {
        self.moving[shape].body
    }

    pub(crate) fn placed_on(&self, shape: usize, base_from_body: &Pose3) -> Placed {
        self.moving[shape].placed_on(base_from_body)
    }

    pub(crate) fn between(&self, pair: Pair) -> BodyPair {
        match pair {
            Pair::Standing { moving, .. } => BodyPair { first_joint: 0, outer_body: self.moving[moving].body },
            Pair::Links { outer, inner } => {
                BodyPair { first_joint: self.moving[inner].body, outer_body: self.moving[outer].body }
            }
        }
    }

    /// True if the vehicle's motion changes the pair's distance.
    pub(crate) fn sways(&self, pair: Pair) -> bool {
        matches!(pair, Pair::Standing { standing, .. } if self.standing[standing].is_of_world)
    }

    /// Returns the largest displacement of a shape against the world by the vehicle's motion, m. It is three sigma of
    /// its position, plus three of its attitude times the distance from its centre of mass.
    pub(crate) fn station_bound_m(&self, placed: &Placed) -> f64 {
        let arm_m = (placed.center - self.sway.center_of_mass).length() + placed.radius_m;
        self.sway.position_m + self.sway_growth(arm_m)
    }

    /// Returns the growth of that displacement for a shape `farther_m` farther out, m.
    pub(crate) fn sway_growth(&self, farther_m: f64) -> f64 {
        self.sway.attitude_rad * farther_m
    }

    /// Returns an upper bound on the distance of a moving shape from the axis of a joint before it, m.
    pub(crate) fn lever_m(&self, shape: usize, joint: usize) -> f64 {
        self.moving[shape].levers_m[joint]
    }

    pub(crate) fn shapes(&self, pair: Pair) -> Shapes<'_> {
        match pair {
            Pair::Standing { moving, standing } => {
                Shapes { outer: &self.moving[moving].shape, other: &self.standing[standing].shape }
            }
            Pair::Links { outer, inner } => {
                Shapes { outer: &self.moving[outer].shape, other: &self.moving[inner].shape }
            }
        }
    }

    /// Returns the pair's second shape at its placement; `placed` gives that of a link.
    pub(crate) fn other_at<'b>(&'b self, pair: Pair, placed: impl Fn(usize) -> &'b Placed) -> &'b Placed {
        match pair {
            Pair::Standing { standing, .. } => &self.standing[standing].placed,
            Pair::Links { inner, .. } => placed(inner),
        }
    }

    /// Returns the distance of one pair at `angles`, as the margin counts it, if it is below `margin_m`.
    pub(crate) fn distance_below(&self, pair: usize, angles: &JointAngles, margin_m: f64, guess: Vec3) -> Option<f64> {
        let (pair, poses) = (self.pairs[pair], self.link_poses(angles));
        let outer = self.moving[pair.outer()].placed(&poses);
        let other = match pair {
            Pair::Standing { standing, .. } => self.standing[standing].placed,
            Pair::Links { inner, .. } => self.moving[inner].placed(&poses),
        };
        let sway_m = if self.sways(pair) { self.station_bound_m(&outer) } else { 0.0 };
        let found = separate(&self.shapes(pair), [&outer, &other], guess);
        let is_below = found.distance_m < self.needed_m(pair, margin_m) + sway_m;
        is_below.then(|| self.in_margin_m(pair, found.distance_m, sway_m))
    }

    /// Returns the true distance at which a pair keeps `margin_m`, without the vehicle's motion.
    pub(crate) fn needed_m(&self, pair: Pair, margin_m: f64) -> f64 {
        let needed_m = match pair {
            Pair::Standing { .. } => margin_m,
            Pair::Links { .. } => margin_m - SELF_MARGIN_REDUCTION_M,
        };
        needed_m.max(TOUCHING_M) + self.taken_m(pair)
    }

    /// True if a pair (by its index) is known never to come within `distance_m`.
    pub(crate) fn never_within(&self, pair: usize, distance_m: f64) -> bool {
        self.is_unlisted[pair]
            && self.robot.self_pairs.as_ref().is_some_and(|stored| distance_m <= stored.near_m - UNSEEN_M)
    }

    /// Returns the loss of distance of a pair by open jaws and sag, m. Links bend against each other only between their
    /// bodies.
    fn taken_m(&self, pair: Pair) -> f64 {
        let bodies = match pair {
            Pair::Standing { moving, .. } => 0..=self.moving[moving].body,
            Pair::Links { outer, inner } => self.moving[inner].body + 1..=self.moving[outer].body,
        };
        self.sag_m[bodies].iter().sum::<f64>() + self.growth_m(pair)
    }

    fn growth_m(&self, pair: Pair) -> f64 {
        let is_gripper = |moving: usize| self.moving[moving].body == self.robot.tool.mount.n_joints;
        let grows = match pair {
            Pair::Standing { moving, .. } => is_gripper(moving),
            Pair::Links { outer, inner } => is_gripper(outer) || is_gripper(inner),
        };
        if grows { self.gripper_growth_m } else { 0.0 }
    }

    /// Returns a true distance as the margin counts it, m; shapes that touch stay at zero. `sway_m`: largest loss of
    /// distance by the vehicle's motion, m.
    pub(crate) fn in_margin_m(&self, pair: Pair, distance_m: f64, sway_m: f64) -> f64 {
        let distance_m = (distance_m - self.taken_m(pair)).max(0.0);
        match pair {
            // An obstacle within the bound on the vehicle's motion counts as touching.
            Pair::Standing { .. } if self.sways(pair) => (distance_m - sway_m).max(0.0),
            Pair::Standing { .. } => distance_m,
            Pair::Links { .. } if distance_m > 0.0 => distance_m + SELF_MARGIN_REDUCTION_M,
            Pair::Links { .. } => 0.0,
        }
    }

    pub(crate) fn names(&self, pair: Pair) -> (String, String) {
        match pair {
            Pair::Standing { moving, standing } => {
                (self.moving[moving].name.clone(), self.standing[standing].name.clone())
            }
            Pair::Links { outer, inner } => (self.moving[inner].name.clone(), self.moving[outer].name.clone()),
        }
    }

    /// Returns the pair with its names, at a distance as the margin counts it.
    pub(crate) fn named(&self, pair: Pair, distance_m: f64) -> ClosestPair {
        let (first, second) = self.names(pair);
        let reduction_m = if matches!(pair, Pair::Links { .. }) { SELF_MARGIN_REDUCTION_M } else { 0.0 };
        ClosestPair { distance_m, reduction_m, first, second }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use rand::RngExt;

    use super::*;
    use armcal_core::kinematics::{LinkCorrections, Sag};
    use armcal_core::robot::{load, load_vehicle};
    use armcal_core::routine::Scene;
    use armcal_core::stats::stream_rng;

    /// No pair of the bent arm is nearer than the straight arm's distance less the loss by sag. The loss of two links
    /// of the forearm is a small part of the loss between the tool and the vehicle.
    #[test]
    fn what_sag_takes_bounds_every_pair_of_the_bent_arm() {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
        let robot = load(&root.join("titan4")).expect("the robot reads");
        let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("the vehicle reads");
        let scene = Scene { seafloor_z_m: Some(-2.2), obstacles: Vec::new() };
        let mut sag = Sag { tool_load_n: 200.0, mount_rad_per_nm: [8e-6; 3], ..Sag::default() };
        sag.joint_rad_per_nm[..6].fill(1.6e-5);
        let chain = robot.chain.corrected(&LinkCorrections { sag, ..LinkCorrections::default() });
        let bent_robot = Robot { chain, ..robot.clone() };
        let straight = ClearanceModel::new(&robot, &vehicle, &scene).with_sag(&bent_robot.chain);
        let bent = ClearanceModel::new(&bent_robot, &vehicle, &scene);
        let (mut rng, mut closed_m, mut compared) = (stream_rng(1, "bent arms"), 0.0_f64, 0);
        for _ in 0..60 {
            let angles = JointAngles::from_fn(6, |j| {
                let sensor = &robot.sensors[j];
                sensor.center_rad + rng.random_range(-1.0..1.0) * sensor.half_range_rad
            });
            for pair in 0..straight.pairs.len() {
                let of = |model: &ClearanceModel<'_>| model.distance_below(pair, &angles, 1.0, Vec3::ZERO);
                let (Some(proven), Some(true_m)) = (of(&straight), of(&bent)) else { continue };
                closed_m = closed_m.max(proven + straight.taken_m(straight.pair(pair)) - true_m);
                compared += 1;
                assert!(true_m >= proven - 1e-6, "{:?} at {angles:?}: {true_m}, at least {proven}", bent.pair(pair));
            }
        }
        assert!(compared > 1000 && closed_m > 2e-3, "{compared} pairs, nearer by up to {closed_m} m");
        let taken_m = |inner: usize, outer: usize| straight.sag_m[inner + 1..=outer].iter().sum::<f64>();
        assert!(5.0 * taken_m(3, 5) < straight.sag_m.iter().sum(), "{:?}", straight.sag_m);
    }
}

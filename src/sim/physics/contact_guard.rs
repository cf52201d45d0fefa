//! Lower bounds of clearances: while they are positive, the engine does not search for contacts.
//!
//! The distances of all watched pairs are measured at intervals. In between, the paths of the joints and the ground
//! bound the approach of a pair, so that steps without possible contact need no measurement. The motion is the same
//! except for rounding: the engine sums a link's inertia in another order when its shapes are switched off.

use crate::body_poses::BodyPoses;
use crate::pair_motion::{ArmPlace, PairGroup, PairMotion};
use crate::solids::{Carrier, Solids};
use armcal_core::kinematics::Chain;

/// Distance below which contacts are possible, m: the engine makes them of pairs nearer than 20 mm, its prediction
/// distance.
const CONTACT_M: f64 = 0.022;
/// Distance below which a pair is left to the engine, m: it would have to be measured in every other step.
const NEAR_M: f64 = 0.03;
/// Largest distance that is measured, m.
const FAR_M: f64 = 0.5;
/// Number of steps between measurements of a pair that is left to the engine.
const NEAR_STEPS: u64 = 10;

/// Guard that finds the steps in which contacts are possible.
pub(super) struct ContactGuard {
    solids: Solids,
    groups: Vec<Group>,
    motion: PairMotion,
    step: u64,
}

struct Group {
    pairs: PairGroup,
    /// Least distance at the last measurement; `path_m` is the path until then.
    distance_m: f64,
    path_m: f64,
    measured_at: u64,
}

impl ContactGuard {
    pub(super) fn new(chain: &Chain, solids: &Solids, start: &ArmPlace) -> Self {
        let inner = |outer: usize| (0..outer).map(Carrier::Body).chain([Carrier::World]);
        let groups: Vec<PairGroup> = (0..=chain.n_joints())
            .flat_map(|outer| inner(outer).filter_map(move |inner| PairGroup::new(chain, solids, inner, outer)))
            .collect();
        let motion = PairMotion::new(&groups, start);
        let unmeasured = |pairs| Group { pairs, distance_m: 0.0, path_m: 0.0, measured_at: 0 };
        Self { solids: solids.clone(), groups: groups.into_iter().map(unmeasured).collect(), motion, step: 0 }
    }

    /// Takes the state at the start of a step; returns true if any pair may be near enough for a contact in it.
    pub(super) fn contact_is_possible(&mut self, place: &ArmPlace, links: impl FnOnce() -> BodyPoses) -> bool {
        self.motion.follow(place);
        self.step += 1;
        let Self { groups, motion, step, solids } = self;
        let mut links = Some(links);
        let mut is_possible = false;
        for group in groups {
            if group.is_outdated(motion, *step) {
                if let Some(links) = links.take() {
                    solids.place(&links(), &place.base_from_ground);
                }
                group.distance_m = solids.least_distance_m(&group.pairs.pairs, FAR_M);
                group.path_m = motion.path_m(&group.pairs);
                group.measured_at = *step;
            }
            is_possible |= group.distance_m < NEAR_M;
        }
        is_possible
    }
}

impl Group {
    fn is_outdated(&self, motion: &PairMotion, step: u64) -> bool {
        if self.distance_m < NEAR_M {
            return self.measured_at == 0 || step - self.measured_at >= NEAR_STEPS;
        }
        self.distance_m - (motion.path_m(&self.pairs) - self.path_m) < CONTACT_M
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use nalgebra::Isometry3;
    use rand::RngExt;

    use super::*;
    use armcal_core::robot::{load, load_vehicle};
    use armcal_core::routine::Scene;
    use armcal_core::stats::stream_rng;
    use armcal_core::streams::JointAngles;

    /// Prediction distance of the engine, m.
    const PREDICTED_M: f64 = 0.02;

    /// Arms move at random, into obstacles too, over a seafloor that heaves. If contact is excluded, every watched pair
    /// is farther apart than the engine's prediction distance.
    #[test]
    fn what_it_excludes_is_far_apart() {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
        let robot = load(&root.join("titan4")).expect("the robot reads");
        let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("the vehicle reads");
        let scene = Scene { seafloor_z_m: Some(-1.0), obstacles: Vec::new() };
        let mut solids = Solids::new(&robot, &vehicle, &scene);
        let n_parts = solids.pairs().n_parts();
        let (mut excluded, mut left) = (0, 0);
        for seed in 1..=12 {
            let mut rng = stream_rng(seed, "wandering arm");
            let mut angles = robot.stowed;
            let mut mount = robot.chain.joints()[0].parent_from_joint;
            let ground = Isometry3::identity();
            let start = ArmPlace { angles, base_from_ground: ground, first_place: mount };
            let mut guard = ContactGuard::new(&robot.chain, &solids, &start);
            let mut heave_m: f64 = 0.0;
            for leg in 0..6 {
                let rates = JointAngles::from_fn(6, |_| rng.random_range(-2e-3..2e-3));
                for step in 0..400 {
                    angles = JointAngles::from_fn(6, |j| angles[j] + rates[j]);
                    heave_m += rng.random_range(-1e-3..1e-3);
                    let tilt = nalgebra::Vector3::new(0.02 * heave_m, 0.3 * heave_m, 0.0);
                    let ground = Isometry3::new(nalgebra::Vector3::new(0.0, 0.0, heave_m), tilt);
                    // A mount that yields.
                    mount.translation.z += rng.random_range(-3e-4..3e-4);
                    let mut chain = robot.chain.clone();
                    chain.set_first_place(&mount);
                    let links = || BodyPoses::drawn(6, &chain.link_poses(&angles));
                    let place = ArmPlace { angles, base_from_ground: ground, first_place: mount };
                    if guard.contact_is_possible(&place, links) {
                        left += 1;
                        continue;
                    }
                    excluded += 1;
                    if step % 7 == leg {
                        solids.place(&links(), &ground);
                        let all: Vec<(usize, usize)> = (0..solids.shapes().len())
                            .flat_map(|i| (0..i).map(move |j| (i, j)))
                            .filter(|&(i, j)| {
                                let (a, b) = (solids.shapes()[i].part, solids.shapes()[j].part);
                                a < n_parts && solids.pairs().is_watched(a, b)
                            })
                            .collect();
                        let least_m = solids.least_distance_m(&all, FAR_M);
                        assert!(least_m > PREDICTED_M, "seed {seed}, leg {leg}, step {step}: {least_m}");
                    }
                }
            }
        }
        eprintln!("{excluded} steps without contact, {left} left to the engine");
        assert!(excluded > 5000 && left > 1000, "{excluded}, {left}");
    }
}

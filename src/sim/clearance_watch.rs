//! Search for the least clearance of the arm over all steps, not only at the samples of the truth's record.
//!
//! Distances are measured at intervals. In between, the paths of joints and ground bound the approach of a group of
//! pairs. Only a step in which some pair may have a new least distance is measured.

use crate::body_poses::BodyPoses;
use crate::pair_motion::{ArmPlace, PairGroup, PairMotion};
use crate::solids::{Carrier, Nearest, Solids};
use armcal_core::kinematics::Chain;
use armcal_core::streams::MAX_JOINTS;

/// Largest error of the found least distance, m.
const RESOLUTION_M: f64 = 0.0002;
/// Range beyond the least distance so far within which distances are measured, m.
const FAR_M: f64 = 0.3;
/// Path after which pairs in contact are measured again, m.
const AFTER_CONTACT_M: f64 = 0.02;

/// Watch of the clearance, step by step.
pub(super) struct ClearanceWatch {
    groups: Vec<Group>,
    motion: PairMotion,
    /// Largest distance of any point of the arm from each joint's axis, m.
    most_levers_m: [f64; MAX_JOINTS],
    /// Path that any pair may move before one must be measured, m.
    slack_m: f64,
    /// Least distance of pairs that do not touch, m.
    least_m: f64,
    /// Nearest pair since the last sample with its step, if its distance is the least of all.
    low: Option<(Nearest, u64)>,
}

/// Pairs of a link's shapes with shapes that do not belong to the arm.
struct Group {
    pairs: PairGroup,
    /// Distance at the last measurement; `path_m` is the path until then.
    distance_m: f64,
    path_m: f64,
}

impl ClearanceWatch {
    pub(super) fn new(chain: &Chain, solids: &Solids, start: &ArmPlace) -> Self {
        let around = [Carrier::Body(0), Carrier::World];
        let groups: Vec<PairGroup> = (1..=chain.n_joints())
            .flat_map(|outer| around.into_iter().filter_map(move |inner| PairGroup::new(chain, solids, inner, outer)))
            .filter_map(|mut group| {
                group.pairs.retain(|&(i, _)| !solids.is_of_arm(i));
                (!group.pairs.is_empty()).then_some(group)
            })
            .collect();
        let most = |joint: usize| groups.iter().map(|group| group.levers_m[joint]).fold(0.0, f64::max);
        Self {
            most_levers_m: std::array::from_fn(most),
            motion: PairMotion::new(&groups, start),
            slack_m: 0.0,
            least_m: f64::INFINITY,
            low: None,
            groups: groups.into_iter().map(|pairs| Group { pairs, distance_m: 0.0, path_m: 0.0 }).collect(),
        }
    }

    /// Takes the state at the end of `step`.
    pub(super) fn follow(
        &mut self,
        solids: &mut Solids,
        place: &ArmPlace,
        step: u64,
        links: impl FnOnce() -> BodyPoses,
    ) {
        let path = self.motion.follow(place);
        for (lever_m, path_rad) in self.most_levers_m.iter().zip(path.joints_rad) {
            self.slack_m -= lever_m * path_rad;
        }
        self.slack_m -= path.ground_m + path.mount_m;
        if self.slack_m <= 0.0 {
            self.look(solids, step, |solids| solids.place(&links(), &place.base_from_ground));
        }
    }

    /// Measures pairs that may have a new least distance; `put` moves the solids to their present poses.
    fn look(&mut self, solids: &mut Solids, step: u64, put: impl FnOnce(&mut Solids)) {
        let mut put = Some(put);
        self.slack_m = f64::INFINITY;
        let Self { groups, motion, least_m, low, slack_m, .. } = self;
        for group in groups {
            let path_m = motion.path_m(&group.pairs);
            if group.distance_m - (path_m - group.path_m) <= *least_m - RESOLUTION_M {
                if let Some(put) = put.take() {
                    put(solids);
                }
                let far_m = if least_m.is_finite() { *least_m + FAR_M } else { 2.0 * FAR_M };
                let nearest = solids.nearest_of(&group.pairs.pairs, far_m);
                group.path_m = path_m;
                group.distance_m = nearest.map_or(far_m, |nearest| nearest.distance_m);
                if let Some(nearest) = nearest.filter(|nearest| nearest.distance_m < *least_m) {
                    if nearest.distance_m > 0.0 {
                        (*least_m, *low) = (nearest.distance_m, Some((nearest, step)));
                    } else {
                        group.distance_m = *least_m + AFTER_CONTACT_M;
                    }
                }
            }
            let bound_m = group.distance_m - (path_m - group.path_m);
            *slack_m = slack_m.min(bound_m - *least_m + RESOLUTION_M);
        }
    }

    /// Returns the nearest pair since the last sample with its step, if its distance is the least so far. `sampled_m`
    /// is the present distance.
    pub(super) fn take_low(&mut self, sampled_m: f64) -> Option<(Nearest, u64)> {
        let low = self.low.take().filter(|(low, _)| low.distance_m < sampled_m);
        if sampled_m > 0.0 {
            self.slack_m -= (self.least_m - sampled_m).max(0.0);
            self.least_m = self.least_m.min(sampled_m);
        }
        low
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

    /// Arms move at random over a seafloor that heaves. The watch finds each new least distance over all steps, and
    /// samples alone miss it.
    #[test]
    fn no_step_is_nearer_than_the_least_that_is_found() {
        const SAMPLE_STEPS: u64 = 100;
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
        let robot = load(&root.join("titan4")).expect("the robot reads");
        let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("the vehicle reads");
        let scene = Scene { seafloor_z_m: Some(-1.0), obstacles: Vec::new() };
        let mut solids = Solids::new(&robot, &vehicle, &scene);
        let (mut measured, mut missed_m) = (0, 0.0_f64);
        for seed in 1..=12 {
            let (mut rng, mut mount_rng) = (stream_rng(seed, "wandering arm"), stream_rng(seed, "mount"));
            let mut angles = robot.stowed;
            let mut ground = Isometry3::identity();
            let mut mount = robot.chain.joints()[0].parent_from_joint;
            let start = ArmPlace { angles, base_from_ground: ground, first_place: mount };
            let mut watch = ClearanceWatch::new(&robot.chain, &solids, &start);
            let mut rates = JointAngles::zeros(6);
            let (mut least_m, mut found_m, mut sampled_m) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
            for step in 1..=2400 {
                if step % 400 == 1 {
                    rates = JointAngles::from_fn(6, |_| rng.random_range(-2e-3..2e-3));
                }
                angles = JointAngles::from_fn(6, |j| angles[j] + rates[j]);
                ground.translation.z += rng.random_range(-1e-3..1e-3);
                // A mount that yields.
                mount.translation.y += mount_rng.random_range(-3e-4..3e-4);
                let mut chain = robot.chain.clone();
                chain.set_first_place(&mount);
                let links = || BodyPoses::drawn(6, &chain.link_poses(&angles));
                let place = ArmPlace { angles, base_from_ground: ground, first_place: mount };
                watch.follow(&mut solids, &place, step, || {
                    measured += 1;
                    links()
                });
                solids.place(&links(), &ground);
                let now_m = solids.nearest().expect("something is watched").distance_m;
                if now_m == 0.0 {
                    break;
                }
                least_m = least_m.min(now_m);
                if step % SAMPLE_STEPS == 0 {
                    sampled_m = sampled_m.min(now_m);
                    let low_m = watch.take_low(now_m).map_or(now_m, |(low, _)| low.distance_m);
                    found_m = found_m.min(low_m);
                    assert!(
                        (-1e-9..=RESOLUTION_M).contains(&(found_m - least_m)),
                        "{seed}, {step}: {found_m} {least_m}"
                    );
                    missed_m = missed_m.max(sampled_m - least_m);
                }
            }
        }
        eprintln!("{measured} steps measured; samples alone are up to {:.1} mm too good", 1e3 * missed_m);
        assert!(measured < 24_000 && missed_m > 2e-3, "{measured} {missed_m}");
    }
}

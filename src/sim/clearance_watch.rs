//! The least clearance of the arm over all steps, not only at the samples of the truth's record.
//!
//! Distances are measured now and then; in between, the paths of joints and ground bound what a group of pairs can have
//! lost. Only a step in which some pair may be nearer than any was before is measured.

use nalgebra::Isometry3;

use crate::body_poses::BodyPoses;
use crate::solids::{Carrier, Nearest, Solids};
use armcal_core::kinematics::Chain;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// What a least distance may be below the one that is found, m.
const RESOLUTION_M: f64 = 0.0002;
/// Beyond the least distance so far, how far distances are measured, m.
const FAR_M: f64 = 0.3;
/// What touches is a contact; it is looked at again after so much of a path, m.
const AFTER_CONTACT_M: f64 = 0.02;

/// Follows the arm step by step.
pub(super) struct ClearanceWatch {
    groups: Vec<Group>,
    angles: JointAngles,
    base_from_ground: Isometry3<f64>,
    path_rad: [f64; MAX_JOINTS],
    /// Bound of the ground's path within the arm's reach, m.
    ground_path_m: f64,
    /// Of any point of the arm from any joint's axis, and from the base.
    most_levers_m: [f64; MAX_JOINTS],
    reach_m: f64,
    /// Path of any pair that is left until one must be looked at, m.
    slack_m: f64,
    /// Of pairs that do not touch.
    least_m: f64,
    /// The least since the last sample, if it is the least of all, and its step.
    low: Option<(Nearest, u64)>,
}

/// Pairs of a link's shapes with what is not the arm.
struct Group {
    pairs: Vec<(usize, usize)>,
    levers_m: [f64; MAX_JOINTS],
    is_on_ground: bool,
    /// At the last measurement, and the path until then.
    distance_m: f64,
    path_m: f64,
}

/// Where the arm is at the end of a step.
pub(super) struct ArmPlace<'a> {
    pub step: u64,
    pub angles: &'a JointAngles,
    pub base_from_ground: &'a Isometry3<f64>,
}

impl ClearanceWatch {
    pub(super) fn new(chain: &Chain, solids: &Solids, start: &ArmPlace<'_>) -> Self {
        let mut groups = Vec::new();
        for outer in 1..=chain.n_joints() {
            for inner in [Carrier::Body(0), Carrier::World] {
                let mut pairs = solids.watched_pairs(inner, outer);
                pairs.retain(|&(i, _)| !solids.is_of_arm(i));
                let is_on_ground = inner == Carrier::World;
                let levers_m = solids.levers_m(chain, 0, outer);
                if !pairs.is_empty() {
                    groups.push(Group { pairs, levers_m, is_on_ground, distance_m: 0.0, path_m: 0.0 });
                }
            }
        }
        let most = |joint: usize| groups.iter().map(|group| group.levers_m[joint]).fold(0.0, f64::max);
        let most_levers_m: [f64; MAX_JOINTS] = std::array::from_fn(most);
        let first_m = chain.joints().first().map_or(0.0, |joint| joint.parent_from_joint.translation.vector.norm());
        Self {
            angles: *start.angles,
            base_from_ground: *start.base_from_ground,
            path_rad: [0.0; MAX_JOINTS],
            ground_path_m: 0.0,
            reach_m: first_m + most_levers_m[0],
            most_levers_m,
            slack_m: 0.0,
            least_m: f64::INFINITY,
            low: None,
            groups,
        }
    }

    /// Takes the state at the end of a step.
    pub(super) fn follow(&mut self, solids: &mut Solids, place: &ArmPlace<'_>, links: impl FnOnce() -> BodyPoses) {
        for (joint, (now, before)) in place.angles.iter().zip(self.angles.iter()).enumerate() {
            let way_rad = (now - before).abs();
            self.path_rad[joint] += way_rad;
            self.slack_m -= self.most_levers_m[joint] * way_rad;
        }
        if place.base_from_ground != &self.base_from_ground {
            let moved = self.base_from_ground.inverse() * place.base_from_ground;
            let ground_m = moved.translation.vector.norm() + moved.rotation.angle() * self.reach_m;
            self.ground_path_m += ground_m;
            self.slack_m -= ground_m;
        }
        (self.angles, self.base_from_ground) = (*place.angles, *place.base_from_ground);
        if self.slack_m <= 0.0 {
            self.look(solids, place, links);
        }
    }

    fn look(&mut self, solids: &mut Solids, place: &ArmPlace<'_>, links: impl FnOnce() -> BodyPoses) {
        let mut links = Some(links);
        self.slack_m = f64::INFINITY;
        let Self { groups, path_rad, ground_path_m, least_m, low, slack_m, .. } = self;
        for group in groups {
            let path_m = group.path_m(path_rad, *ground_path_m);
            if group.distance_m - (path_m - group.path_m) <= *least_m - RESOLUTION_M {
                if let Some(links) = links.take() {
                    solids.place(&links(), place.base_from_ground);
                }
                let far_m = if least_m.is_finite() { *least_m + FAR_M } else { 2.0 * FAR_M };
                let nearest = solids.nearest_of(&group.pairs, far_m);
                group.path_m = path_m;
                group.distance_m = nearest.map_or(far_m, |nearest| nearest.distance_m);
                if let Some(nearest) = nearest.filter(|nearest| nearest.distance_m < *least_m) {
                    if nearest.distance_m > 0.0 {
                        (*least_m, *low) = (nearest.distance_m, Some((nearest, place.step)));
                    } else {
                        group.distance_m = *least_m + AFTER_CONTACT_M;
                    }
                }
            }
            let bound_m = group.distance_m - (path_m - group.path_m);
            *slack_m = slack_m.min(bound_m - *least_m + RESOLUTION_M);
        }
    }

    /// The least since the last sample with its step, if none was less before; `sampled_m` is measured now.
    pub(super) fn take_low(&mut self, sampled_m: f64) -> Option<(Nearest, u64)> {
        let low = self.low.take().filter(|(low, _)| low.distance_m < sampled_m);
        if sampled_m > 0.0 {
            self.slack_m -= (self.least_m - sampled_m).max(0.0);
            self.least_m = self.least_m.min(sampled_m);
        }
        low
    }
}

impl Group {
    fn path_m(&self, path_rad: &[f64; MAX_JOINTS], ground_path_m: f64) -> f64 {
        let ground_m = if self.is_on_ground { ground_path_m } else { 0.0 };
        self.levers_m.iter().zip(path_rad).map(|(lever_m, path)| lever_m * path).sum::<f64>() + ground_m
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use rand::RngExt;

    use super::*;
    use armcal_core::robot::{load, load_vehicle};
    use armcal_core::routine::Scene;
    use armcal_core::stats::stream_rng;

    fn at<'a>(step: u64, angles: &'a JointAngles, base_from_ground: &'a Isometry3<f64>) -> ArmPlace<'a> {
        ArmPlace { step, angles, base_from_ground }
    }

    /// Arms that wander about over a seafloor that heaves: the least of all steps is found whenever there is a new one,
    /// and samples alone miss it.
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
            let mut rng = stream_rng(seed, "wandering arm");
            let mut angles = robot.stowed;
            let mut ground = Isometry3::identity();
            let mut watch = ClearanceWatch::new(&robot.chain, &solids, &at(0, &angles, &ground));
            let mut rates = JointAngles::zeros(6);
            let (mut least_m, mut found_m, mut sampled_m) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
            for step in 1..=2400 {
                if step % 400 == 1 {
                    rates = JointAngles::from_fn(6, |_| rng.random_range(-2e-3..2e-3));
                }
                angles = JointAngles::from_fn(6, |j| angles[j] + rates[j]);
                ground.translation.z += rng.random_range(-1e-3..1e-3);
                let links = || BodyPoses::drawn(6, &robot.chain.link_poses(&angles));
                watch.follow(&mut solids, &at(step, &angles, &ground), || {
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

//! Lower bounds of clearances: while they are positive, the engine does not search for contacts.
//!
//! The distances of all watched pairs are measured now and then. Between two measurements the joints' and the ground's
//! paths bound what a pair can have lost, so that a step in which nothing can touch is known without looking. The
//! motion is the same to rounding: the engine adds up a link's inertia in another way when its shapes are switched off.

use nalgebra::Isometry3;

use crate::body_poses::BodyPoses;
use crate::solids::{Carrier, Solids};
use armcal_core::kinematics::Chain;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// The engine makes contacts of pairs nearer than 20 mm, its prediction distance, m.
const CONTACT_M: f64 = 0.022;
/// A pair nearer than this is left to the engine: it would have to be measured in every other step, m.
const NEAR_M: f64 = 0.03;
/// Largest distance that is measured, m.
const FAR_M: f64 = 0.5;
/// Steps between measurements of a pair that is left to the engine.
const NEAR_STEPS: u64 = 10;

/// Watches when contacts become possible.
pub(super) struct ContactGuard {
    solids: Solids,
    groups: Vec<Group>,
    angles: JointAngles,
    base_from_ground: Isometry3<f64>,
    /// Path of each joint since the start, rad.
    path_rad: [f64; MAX_JOINTS],
    /// Bound of the ground's path within the arm's reach, m.
    ground_path_m: f64,
    reach_m: f64,
    step: u64,
}

/// Pairs of shapes that the same joints move against each other.
struct Group {
    pairs: Vec<(usize, usize)>,
    /// By what each joint can move the pairs against each other, m/rad; zero for other joints.
    levers_m: [f64; MAX_JOINTS],
    is_on_ground: bool,
    /// The least distance at the last measurement, and the path until then.
    distance_m: f64,
    path_m: f64,
    measured_at: u64,
}

impl ContactGuard {
    pub(super) fn new(chain: &Chain, solids: &Solids, angles: &JointAngles) -> Self {
        let n_bodies = chain.n_joints() + 1;
        let mut groups = Vec::new();
        for outer in 1..n_bodies {
            for inner in 0..outer {
                let levers_m = solids.levers_m(chain, inner, outer);
                groups.extend(Group::new(solids, Carrier::Body(inner), outer, levers_m));
            }
            groups.extend(Group::new(solids, Carrier::World, outer, solids.levers_m(chain, 0, outer)));
        }
        // From the base's origin rather than the first joint's axis.
        let first_m = chain.joints().first().map_or(0.0, |joint| joint.parent_from_joint.translation.vector.norm());
        let reach_m = first_m + groups.iter().map(|group| group.levers_m[0]).fold(0.0, f64::max);
        Self {
            solids: solids.clone(),
            groups,
            angles: *angles,
            base_from_ground: Isometry3::identity(),
            path_rad: [0.0; MAX_JOINTS],
            ground_path_m: 0.0,
            reach_m,
            step: 0,
        }
    }

    /// Takes the state at the start of a step; gives whether any pair may be near enough for a contact in it.
    pub(super) fn contact_is_possible(
        &mut self,
        angles: &JointAngles,
        links: impl FnOnce() -> BodyPoses,
        base_from_ground: &Isometry3<f64>,
    ) -> bool {
        for (joint, (now, before)) in angles.iter().zip(self.angles.iter()).enumerate() {
            self.path_rad[joint] += (now - before).abs();
        }
        let moved = self.base_from_ground.inverse() * base_from_ground;
        self.ground_path_m += moved.translation.vector.norm() + moved.rotation.angle() * self.reach_m;
        (self.angles, self.base_from_ground) = (*angles, *base_from_ground);
        self.step += 1;
        let Self { groups, path_rad, ground_path_m, step, solids, .. } = self;
        let mut links = Some(links);
        let mut is_possible = false;
        for group in groups {
            if group.is_outdated(path_rad, *ground_path_m, *step) {
                if let Some(links) = links.take() {
                    solids.place(&links(), base_from_ground);
                }
                group.distance_m = solids.least_distance_m(&group.pairs, FAR_M);
                group.path_m = group.path_m(path_rad, *ground_path_m);
                group.measured_at = *step;
            }
            is_possible |= group.distance_m < NEAR_M;
        }
        is_possible
    }
}

impl Group {
    fn new(solids: &Solids, inner: Carrier, outer: usize, levers_m: [f64; MAX_JOINTS]) -> Option<Self> {
        let pairs = solids.watched_pairs(inner, outer);
        let is_on_ground = inner == Carrier::World;
        (!pairs.is_empty()).then_some(Self {
            pairs,
            levers_m,
            is_on_ground,
            distance_m: 0.0,
            path_m: 0.0,
            measured_at: 0,
        })
    }

    fn path_m(&self, path_rad: &[f64; MAX_JOINTS], ground_path_m: f64) -> f64 {
        let ground_m = if self.is_on_ground { ground_path_m } else { 0.0 };
        self.levers_m.iter().zip(path_rad).map(|(lever_m, path)| lever_m * path).sum::<f64>() + ground_m
    }

    fn is_outdated(&self, path_rad: &[f64; MAX_JOINTS], ground_path_m: f64, step: u64) -> bool {
        if self.distance_m < NEAR_M {
            return self.measured_at == 0 || step - self.measured_at >= NEAR_STEPS;
        }
        self.distance_m - (self.path_m(path_rad, ground_path_m) - self.path_m) < CONTACT_M
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

    /// The engine's prediction distance.
    const PREDICTED_M: f64 = 0.02;

    /// Arms that wander about, into things too, over a seafloor that heaves: whenever contact is excluded, every
    /// watched pair is farther apart than the engine would make a contact for.
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
            let mut guard = ContactGuard::new(&robot.chain, &solids, &angles);
            let mut heave_m: f64 = 0.0;
            for leg in 0..6 {
                let rates = JointAngles::from_fn(6, |_| rng.random_range(-2e-3..2e-3));
                for step in 0..400 {
                    angles = JointAngles::from_fn(6, |j| angles[j] + rates[j]);
                    heave_m += rng.random_range(-1e-3..1e-3);
                    let tilt = nalgebra::Vector3::new(0.02 * heave_m, 0.3 * heave_m, 0.0);
                    let ground = Isometry3::new(nalgebra::Vector3::new(0.0, 0.0, heave_m), tilt);
                    let links = || BodyPoses::drawn(6, &robot.chain.link_poses(&angles));
                    if guard.contact_is_possible(&angles, links, &ground) {
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

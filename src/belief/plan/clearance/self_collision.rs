//! Sampling of the links of an arm that can ever come near each other.

pub(crate) use crate::plan::constants::clearance_self_collision::UNSEEN_M;
use crate::plan::constants::clearance_self_collision::{NEAR_M, NEARLY_ALWAYS};
use std::collections::{BTreeMap, BTreeSet};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::clearance::ClearanceModel;
use armcal_core::kinematics::JointLimits;
use armcal_core::robot::{Robot, SelfPair, SelfPairs};
use armcal_core::stats::stream_rng;
use armcal_core::streams::JointAngles;

/// Returns the least distance of each two links of the arm over `n` random configurations. They lie within the joint
/// limits, extended by the sensor errors that the datasheet allows.
#[must_use]
pub fn sample_self_pairs(robot: &Robot, n: u64, seed: u64) -> SelfPairs {
    let clearance = ClearanceModel::of_arm_alone(robot);
    let mut rng = stream_rng(seed, "self-collision pairs");
    let limits = wide_limits(robot);
    let mut pairs: Vec<SelfPair> = Vec::new();
    for _ in 0..n {
        let angles = random_angles(&limits, &mut rng);
        clearance.each_near_pair(&angles, NEAR_M, |bodies, distance_m| {
            match pairs.iter_mut().find(|pair| pair.bodies == bodies) {
                Some(pair) => pair.nearest_m = pair.nearest_m.min(distance_m),
                None => pairs.push(SelfPair { bodies, nearest_m: distance_m }),
            }
        });
    }
    pairs.sort_by_key(|pair| pair.bodies);
    SelfPairs { seed, n, near_m: NEAR_M, pairs }
}

/// Returns the links that overlap or are nearer than `margin_m` at nearly all of `n` random configurations: no plan
/// could keep them apart.
#[must_use]
pub fn always_near(robot: &Robot, margin_m: f64, n: u32, seed: u64) -> Vec<[String; 2]> {
    let clearance = ClearanceModel::of_arm_alone(robot);
    let mut rng = stream_rng(seed, "links that are always near");
    let limits = wide_limits(robot);
    let mut n_near: BTreeMap<[usize; 2], u32> = BTreeMap::new();
    for _ in 0..n {
        let mut near = BTreeSet::new();
        clearance.each_near_pair(&random_angles(&limits, &mut rng), margin_m, |bodies, _| {
            near.insert(bodies);
        });
        near.into_iter().for_each(|bodies| *n_near.entry(bodies).or_default() += 1);
    }
    n_near.retain(|_, times| f64::from(*times) >= NEARLY_ALWAYS * f64::from(n));
    n_near.into_keys().map(|bodies| bodies.map(|body| robot.bodies[body].name.clone())).collect()
}

/// Returns angles at which no two links are nearer than `margin_m`: the first clear one of `n` guesses that spread from
/// mid-range. `None` if no guess is clear.
#[must_use]
pub fn clear_angles(robot: &Robot, margin_m: f64, n: u32, seed: u64) -> Option<JointAngles> {
    let clearance = ClearanceModel::of_arm_alone(robot);
    let mut rng = stream_rng(seed, "clear angles");
    let limits = drawn_limits(robot);
    let guess = |k: u32| {
        let share = f64::from(k) / f64::from(n);
        let random = random_angles(&limits, &mut rng);
        JointAngles::from_fn(limits.len(), |j| {
            let middle_rad = 0.5 * (limits[j].lower_rad + limits[j].upper_rad);
            middle_rad + share * (random[j] - middle_rad)
        })
    };
    (0..n).map(guess).find(|angles| !clearance.is_nearer_than(angles, margin_m))
}

/// Returns the joints' own limits, or a whole turn.
fn drawn_limits(robot: &Robot) -> Vec<JointLimits> {
    let turn = JointLimits { lower_rad: -std::f64::consts::PI, upper_rad: std::f64::consts::PI };
    robot.chain.joints().iter().map(|joint| joint.limits.unwrap_or(turn)).collect()
}

fn wide_limits(robot: &Robot) -> Vec<JointLimits> {
    let bounds = JointErrorBounds::datasheet(robot);
    let wide = |(joint, limits): (usize, JointLimits)| {
        let JointLimits { lower_rad, upper_rad } = limits;
        if robot.chain.joints()[joint].limits.is_none() {
            return limits;
        }
        JointLimits {
            lower_rad: lower_rad - bounds.error_rad(joint, lower_rad),
            upper_rad: upper_rad + bounds.error_rad(joint, upper_rad),
        }
    };
    drawn_limits(robot).into_iter().enumerate().map(wide).collect()
}

fn random_angles(limits: &[JointLimits], rng: &mut ChaCha8Rng) -> JointAngles {
    JointAngles::from_fn(limits.len(), |j| rng.random_range(limits[j].lower_rad..=limits[j].upper_rad))
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::robot::Shape;

    fn robot(name: &str) -> Robot {
        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots").join(name);
        armcal_core::robot::load(&folder).expect("the robot reads")
    }

    /// The stored lists match the nominal models: other samples bring no other links near.
    #[test]
    fn no_links_outside_the_stored_list_come_near_in_other_samples() {
        for name in ["titan4", "titan4-gripper-tag", "kraft-predator"] {
            let robot = robot(name);
            let stored = robot.self_pairs.clone().expect("the folder has a list");
            let other = sample_self_pairs(&robot, 20_000, 99);
            for pair in &other.pairs {
                let known = stored.pairs.iter().find(|known| known.bodies == pair.bodies);
                let least_m = known.map_or(stored.near_m, |known| known.nearest_m);
                assert!(pair.nearest_m >= least_m - UNSEEN_M, "{name}: {pair:?}, but {known:?} is stored");
            }
            let n_bodies = robot.bodies.len();
            let possible = (n_bodies - 1) * (n_bodies - 2) / 2;
            eprintln!("{name}: {} of {possible} pairs", stored.pairs.len());
            assert!(!stored.pairs.is_empty());
        }
    }

    #[test]
    fn links_that_are_always_near_are_told_from_those_that_can_meet() {
        let mut robot = robot("titan4");
        assert!(always_near(&robot, 0.03, 200, 1).is_empty());
        let clear = clear_angles(&robot, 0.03, 100, 1).expect("it can stand clear of itself");
        assert!(!ClearanceModel::of_arm_alone(&robot).is_nearer_than(&clear, 0.03));
        // A base that reaches out to the forearm wherever that is.
        robot.bodies[0].collisions[0].shape = Shape::Sphere { radius_m: 3.0 };
        let found = always_near(&robot, 0.03, 200, 1);
        assert!(found.contains(&["base_link".to_owned(), "forearm_link".to_owned()]), "{found:?}");
        assert!(clear_angles(&robot, 0.03, 100, 1).is_none());
    }

    /// A list without one of the pairs changes the tests of planning, and a correct list changes no answer.
    #[test]
    fn planning_tests_the_pairs_of_the_list() {
        let all = Robot { self_pairs: None, ..robot("titan4") };
        let listed = robot("titan4");
        let mut none = listed.clone();
        if let Some(stored) = &mut none.self_pairs {
            stored.pairs.clear();
        }
        let limits = wide_limits(&all);
        let models = [&all, &listed, &none].map(ClearanceModel::of_arm_alone);
        let mut rng = stream_rng(5, "pairs of the list");
        let mut missed = 0;
        for _ in 0..3000 {
            let at = random_angles(&limits, &mut rng);
            let near = models.each_ref().map(|model| model.is_nearer_than(&at, 0.05));
            assert_eq!(near[0], near[1], "{at:?}");
            missed += i32::from(near[0] && !near[2]);
        }
        assert!(missed > 20, "without its pairs the arm may pass through itself: {missed}");
    }
}

//! Comparison with brute force: certified configurations keep clear at every sampled point of the error box.

use std::path::Path;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plan::{ClearanceModel, Edge, JointErrorBounds};
use armcal_core::robot::{PlacedShape, Robot, Shape, Vehicle, load, load_vehicle};
use armcal_core::routine::Scene;
use armcal_core::stats::stream_rng;
use armcal_core::streams::JointAngles;

const MARGIN_M: f64 = 0.05;
/// Supports are exact to rounding.
const ROUNDING_M: f64 = 1e-9;

struct Site {
    robot: Robot,
    vehicle: Vehicle,
    scene: Scene,
}

fn site() -> Site {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
    let robot = load(&root.join("titan4")).expect("the robot reads");
    let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("the vehicle reads");
    let owner_from_shape = nalgebra::Isometry3::translation(3.2, -1.4, 0.6);
    let placed = PlacedShape { owner_from_shape, shape: Shape::Sphere { radius_m: 0.2 }, color_rgb: [0; 3] };
    let obstacle = armcal_core::robot::Part { name: "buoy".to_owned(), placed };
    Site { robot, vehicle, scene: Scene { seafloor_z_m: Some(-2.2), obstacles: vec![obstacle] } }
}

fn random_angles(robot: &Robot, bounds: &JointErrorBounds, rng: &mut ChaCha8Rng) -> JointAngles {
    let limits = bounds.safe_limits(robot);
    JointAngles::from_fn(robot.n_joints(), |j| rng.random_range(limits[j].lower_rad..=limits[j].upper_rad))
}

/// Returns the datasheet's bounds, and those after three calibrations: of no joint, of all but one, of all.
fn several_bounds(robot: &Robot) -> Vec<JointErrorBounds> {
    let prior = JointErrorBounds::datasheet(robot);
    let all = JointErrorBounds::alike(robot, 0.014, 0.004);
    let mut all_but_one = all.clone();
    all_but_one.joints[1] = prior.joints[1];
    vec![prior, all_but_one, all]
}

/// Returns any arm within the bounds; only the joints selected by `errs` have errors.
pub(super) fn some_arm(
    at: &JointAngles,
    bounds: &JointErrorBounds,
    errs: impl Fn(usize) -> bool,
    rng: &mut ChaCha8Rng,
) -> JointAngles {
    let on_edge = rng.random_range(0.0..1.0) < 0.5;
    JointAngles::from_fn(at.len(), |joint| {
        if !errs(joint) {
            return at[joint];
        }
        let share = if on_edge && rng.random_range(0.0..1.0) < 0.7 {
            f64::from(rng.random_range(0..2)) * 2.0 - 1.0
        } else {
            rng.random_range(-1.0..=1.0)
        };
        at[joint] + share * bounds.error_rad(joint, at[joint])
    })
}

/// Returns the least clearance over 2^5 corners, the middle and 60 more arms.
fn brute_m(clearance: &ClearanceModel<'_>, at: &JointAngles, bounds: &JointErrorBounds, rng: &mut ChaCha8Rng) -> f64 {
    let corner = |corner: usize| {
        JointAngles::from_fn(at.len(), |joint| {
            let error_rad = if clearance.has_error(joint) { bounds.error_rad(joint, at[joint]) } else { 0.0 };
            if corner >> joint & 1 == 1 { at[joint] + error_rad } else { at[joint] - error_rad }
        })
    };
    let corners = (0..1usize << 5).map(corner);
    let others = (0..60).map(|_| some_arm(at, bounds, |joint| clearance.has_error(joint), rng));
    corners.chain(others).chain([*at]).map(|arm| clearance.nearest(&arm).distance_m).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_certified_pose_is_clear_for_every_arm_and_few_clear_ones_are_refused() {
    let Site { robot, vehicle, scene } = site();
    let clearance = ClearanceModel::new(&robot, &vehicle, &scene);
    let mut rng = stream_rng(1, "certified poses");
    for bounds in several_bounds(&robot) {
        let (mut clear, mut certified) = (0, 0);
        for _ in 0..500 {
            let at = random_angles(&robot, &bounds, &mut rng);
            let least_m = brute_m(&clearance, &at, &bounds, &mut rng);
            let found = clearance.find_violation(&at, &bounds, MARGIN_M);
            clear += i32::from(least_m >= MARGIN_M);
            certified += i32::from(found.is_none());
            if found.is_none() {
                assert!(least_m >= MARGIN_M - ROUNDING_M, "{at:?}: {least_m}");
            }
        }
        eprintln!("{clear} clear by brute force, {certified} certified");
        assert!(certified > 40, "{certified}");
        // Brute force samples only corners and part of the inside; some of these few arms are truly too near.
        assert!(f64::from(clear - certified) < 0.06 * f64::from(clear), "{certified} of {clear}");
    }
}

#[test]
fn a_certified_edge_is_clear_for_every_arm_on_it() {
    let Site { robot, vehicle, scene } = site();
    let clearance = ClearanceModel::new(&robot, &vehicle, &scene);
    let mut rng = stream_rng(1, "certified edges");
    for bounds in several_bounds(&robot) {
        let (mut clear, mut certified) = (0, 0);
        for _ in 0..150 {
            let from = random_angles(&robot, &bounds, &mut rng);
            let other = random_angles(&robot, &bounds, &mut rng);
            let length = rng.random_range(0.02..0.7);
            let to = JointAngles::from_fn(from.len(), |j| from[j] + length * (other[j] - from[j]));
            let found = clearance.find_violation_along(&Edge::at_full_speed(from, to), &bounds, MARGIN_M);
            let mut least_m = f64::INFINITY;
            for step in 0..=12 {
                let share = f64::from(step) / 12.0;
                let at = JointAngles::from_fn(from.len(), |j| from[j] + share * (to[j] - from[j]));
                least_m = least_m.min(brute_m(&clearance, &at, &bounds, &mut rng));
                if least_m < MARGIN_M {
                    break;
                }
            }
            clear += i32::from(least_m >= MARGIN_M);
            certified += i32::from(found.is_none());
            if found.is_none() {
                assert!(least_m >= MARGIN_M - ROUNDING_M, "{from:?} to {to:?}: {least_m}");
            }
        }
        eprintln!("{clear} clear by brute force, {certified} certified");
        assert!(certified > 10, "{certified}");
        assert!(f64::from(clear - certified) < 0.1 * f64::from(clear), "{certified} of {clear}");
    }
}

#[test]
fn what_is_refused_has_a_name_and_a_distance_below_the_margin() {
    let Site { robot, vehicle, scene } = site();
    let clearance = ClearanceModel::new(&robot, &vehicle, &scene);
    let bounds = JointErrorBounds::datasheet(&robot);
    let mut rng = stream_rng(1, "refused poses");
    for margin_m in [0.0, MARGIN_M, 0.3] {
        for _ in 0..300 {
            let at = random_angles(&robot, &bounds, &mut rng);
            let nearest = clearance.nearest_under(&at, &bounds, margin_m);
            match clearance.find_violation(&at, &bounds, margin_m) {
                Some(found) => {
                    assert!(found.distance_m < margin_m.max(1e-5), "{found:?}");
                    assert!(!found.first.is_empty() && !found.second.is_empty());
                    assert_eq!(found, nearest);
                }
                None => assert!(nearest.distance_m >= margin_m && clearance.nearest(&at).distance_m >= margin_m),
            }
        }
    }
}

/// Open jaws reduce the gripper's distances by their width, and no others.
#[test]
fn a_grown_gripper_is_nearer_and_nothing_else_is() {
    const GROWTH_M: f64 = 0.039;
    let site = site();
    let model = || ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
    let (at_rest, open) = (model(), model().with_grown_gripper(GROWTH_M));
    let bounds = JointErrorBounds::datasheet(&site.robot);
    let mut rng = stream_rng(5, "grown gripper");
    let (mut of_gripper, mut of_others) = (0, 0);
    for _ in 0..8000 {
        let angles = random_angles(&site.robot, &bounds, &mut rng);
        let (before, after) = (at_rest.nearest(&angles), open.nearest(&angles));
        let is_gripper = |nearest: &crate::plan::ClosestPair| {
            [&nearest.first, &nearest.second].contains(&&"manipulator_link".to_owned())
        };
        if is_gripper(&before) {
            // Not so near that the jaws would touch, nor so far that the distances are cut off.
            if (0.08..0.39).contains(&before.distance_m) {
                let nearer_m = before.distance_m - after.distance_m;
                assert!((nearer_m - GROWTH_M).abs() < 1e-6, "{before:?} {after:?}");
                let margin_m = before.distance_m - 0.5 * GROWTH_M;
                assert!(!at_rest.is_nearer_than(&angles, margin_m) && open.is_nearer_than(&angles, margin_m));
                of_gripper += 1;
            }
        } else if !is_gripper(&after) {
            assert_eq!(before, after);
            of_others += 1;
        }
    }
    assert!(of_gripper > 20 && of_others > 20, "{of_gripper} {of_others}");
}

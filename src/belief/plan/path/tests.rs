//! Paths in the three vehicles' sites, and the errors of infeasible ones.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plan::bounds::JointErrorBounds;
use crate::plan::clearance::{ClearanceModel, SELF_MARGIN_REDUCTION_M};
use crate::plan::motion::edge::{SLOWEST, SLOWNESS};
use crate::plan::motion::{Edge, Path, TrackingErrorBound};
use crate::plan::path::edge_check::*;
use crate::plan::path::error::PathError;
use crate::plan::path::rrt_connect::RrtConnect;
use armcal_core::joints::JointAngles;
use armcal_core::kinematics::JointLimits;
use armcal_core::robot::{PlacedShape, Robot, Shape, Vehicle, load, load_vehicle};
use armcal_core::routine::Scene;
use armcal_core::stats::stream_rng;

const MARGIN_M: f64 = 0.05;

struct Site {
    robot: Robot,
    vehicle: Vehicle,
    scene: Scene,
}

fn site(vehicle: &str) -> Site {
    let root = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
    let vehicle = load_vehicle(&root.join(format!("vehicles/{vehicle}.toml"))).expect("the vehicle reads");
    let robot = load(&root.join("titan4")).expect("the robot reads").mounted_on(&vehicle).expect("it fits");
    let mut scene = Scene { seafloor_z_m: Some(-2.2), obstacles: vec![] };
    if vehicle.name == "under-ice" {
        scene.seafloor_z_m = None;
        let part = |name: &str, shape: Shape, at: [f64; 3]| {
            let owner_from_shape = nalgebra::Isometry3::translation(at[0], at[1], at[2]);
            let placed = PlacedShape { owner_from_shape, shape, color_rgb: [0; 3] };
            armcal_core::robot::Part { name: name.to_owned(), placed }
        };
        let ice = part("ice", Shape::Box { size_m: [10.0, 10.0, 1.0] }, [1.0, 0.0, 2.75]);
        let mut keel = part("keel", Shape::Capsule { radius_m: 0.25, length_m: 1.2 }, [2.0, 1.0, 2.2]);
        keel.placed.owner_from_shape.rotation =
            nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        scene.obstacles = vec![ice, keel];
    }
    Site { robot, vehicle, scene }
}

/// Returns a pose at which the believed arm touches something.
fn random_too_near(clearance: &ClearanceModel<'_>, planner: &PathPlanner<'_>, rng: &mut ChaCha8Rng) -> JointAngles {
    loop {
        let at = random(planner, rng);
        if clearance.nearest(&at).distance_m == 0.0 {
            return at;
        }
    }
}

/// Returns the waypoints' time with each edge at the highest speed that it allows.
fn duration_s(planner: &PathPlanner<'_>, waypoints: &[JointAngles]) -> f64 {
    let mut path = Path::at(waypoints[0]);
    for edge in waypoints.windows(2) {
        path.push(edge[1], planner.time_scale(&edge[0], &edge[1], SLOWEST, &mut 0).expect("certified"));
    }
    planner.clearance.timing().path_duration_s(&path)
}

/// In all three sites, under wide and narrow bounds, paths are found, keep clear at every sampled arm, and are
/// reproducible.
#[test]
fn paths_are_found_and_keep_clear_and_are_the_same_again() {
    for name in ["open-frame", "tight-basket", "under-ice"] {
        let site = site(name);
        let clearance = ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
        for (belief, bounds) in [
            ("narrow", JointErrorBounds::alike(&site.robot, 0.014, 0.004)),
            ("wide", JointErrorBounds::datasheet(&site.robot)),
        ] {
            let limits = bounds.safe_limits(&site.robot);
            let planner = planner(&clearance, &bounds, &limits);
            let mut rng = stream_rng(7, name);
            let (mut found, mut bent) = (0, 0);
            for query in 0..16 {
                let (from, to) = (random_free(&planner, &mut rng), random_free(&planner, &mut rng));
                let draws = || stream_rng(query, "path");
                let path = planner.plan(&from, &to, &mut draws());
                assert_eq!(path, planner.plan(&from, &to, &mut draws()), "the same draws give the same");
                let Ok(path) = path else { continue };
                found += 1;
                bent += i32::from(path.waypoints.len() > 2);
                assert_eq!((path.waypoints[0], path.waypoints[path.waypoints.len() - 1]), (from, to));
                for edge in path.edges() {
                    let tracking_error = TrackingErrorBound::new(&site.robot, clearance.timing(), &edge);
                    for step in 0..=10 {
                        let share = f64::from(step) / 10.0;
                        let on_line = between(&edge.from, &edge.to, share);
                        for _ in 0..20 {
                            // The arm leaves the line first, then the angles that the sensors read.
                            let sign = |rng: &mut ChaCha8Rng| f64::from(rng.random_range(-1..=1));
                            let arm = JointAngles::from_fn(on_line.len(), |j| {
                                if j >= 5 {
                                    return on_line[j];
                                }
                                let off_rad = sign(&mut rng) * tracking_error.most_rad(j, [share; 2]);
                                let at_rad = on_line[j] + share * tracking_error.middle_rad(j) + off_rad;
                                at_rad + sign(&mut rng) * bounds.error_rad(j, at_rad)
                            });
                            assert!(!clearance.is_nearer_than(&arm, MARGIN_M - 1e-9), "{name} {belief}: {on_line:?}");
                        }
                    }
                }
            }
            eprintln!("{name} {belief}: {found} of 16, {bent} with a bend");
            assert!(found >= 13, "{name} {belief}: {found}");
        }
    }
}

#[test]
fn shortcuts_make_paths_quicker_and_never_slower() {
    let site = site("tight-basket");
    let clearance = ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
    let bounds = JointErrorBounds::alike(&site.robot, 0.014, 0.004);
    let limits = bounds.safe_limits(&site.robot);
    let planner = planner(&clearance, &bounds, &limits);
    let mut rng = stream_rng(3, "shortcuts");
    let (mut before_s, mut after_s, mut n) = (0.0, 0.0, 0);
    while n < 15 {
        let (from, to) = (random_free(&planner, &mut rng), random_free(&planner, &mut rng));
        if planner.is_edge_free(&from, &to) {
            continue;
        }
        let mut connect = RrtConnect::new(&planner, &from, &to);
        let Some(waypoints) = connect.search(&mut rng) else { continue };
        let short = connect.shortened(&waypoints, &mut rng);
        assert!(short.edges().all(|edge| planner.keeps_clear(&edge, &mut 0)));
        let long_s = duration_s(&planner, &waypoints);
        let short_s = clearance.timing().path_duration_s(&short);
        assert!(short_s <= long_s + 1e-9, "{long_s} {short_s}");
        (before_s, after_s, n) = (before_s + long_s, after_s + short_s, n + 1);
    }
    eprintln!("{before_s:.0} s before, {after_s:.0} s after");
    assert!(after_s < 0.75 * before_s, "{before_s} {after_s}");
}

/// An edge is driven at the highest certified speed: at the next higher speed some arm that overshoots comes too near.
#[test]
fn edges_near_things_are_driven_slowly_and_the_others_are_not() {
    let site = site("tight-basket");
    let clearance = ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
    let bounds = JointErrorBounds::alike(&site.robot, 0.014, 0.004);
    let limits = bounds.safe_limits(&site.robot);
    let planner = planner(&clearance, &bounds, &limits);
    let mut rng = stream_rng(11, "slow edges");
    let mut counts = [0; SLOWNESS.len()];
    for _ in 0..300 {
        let (from, to) = (random_free(&planner, &mut rng), random_free(&planner, &mut rng));
        let Some(slowness) = planner.time_scale(&from, &to, SLOWEST, &mut 0) else {
            assert!(!planner.is_edge_free(&from, &to));
            continue;
        };
        let level = SLOWNESS.iter().position(|&level| level == slowness).expect("one of the levels");
        counts[level] += 1;
        let edge = Edge { from, to, time_scale: slowness };
        assert!(planner.keeps_clear(&edge, &mut 0) && planner.is_within_limits(&edge));
        let tracking_error = TrackingErrorBound::new(&site.robot, clearance.timing(), &edge);
        for joint in 0..5 {
            let at_end_rad = to[joint] + (to[joint] - from[joint]).signum() * tracking_error.end_rad(joint);
            let arriving_rad = TrackingErrorBound::arriving(&site.robot).end_rad(joint);
            assert!(at_end_rad <= limits[joint].upper_rad + arriving_rad + 1e-9, "{joint}: {at_end_rad}");
            assert!(at_end_rad >= limits[joint].lower_rad - arriving_rad - 1e-9, "{joint}: {at_end_rad}");
        }
        if level > 0 {
            let quicker = Edge { from, to, time_scale: SLOWNESS[level - 1] };
            assert!(!planner.keeps_clear(&quicker, &mut 0) || !planner.is_within_limits(&quicker));
        }
    }
    eprintln!("{counts:?} at each speed");
    assert!(counts[0] > 60 && counts[1..].iter().sum::<i32>() > 5, "{counts:?}");
}

#[test]
fn ends_that_cannot_be_are_named_with_the_nearest_that_can() {
    let site = site("open-frame");
    let clearance = ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
    let bounds = JointErrorBounds::datasheet(&site.robot);
    let limits = bounds.safe_limits(&site.robot);
    let planner = planner(&clearance, &bounds, &limits);
    let mut rng = stream_rng(1, "named errors");
    let mut of_vehicle = 0;
    for _ in 0..40 {
        let (free, inside) = (random_free(&planner, &mut rng), random_too_near(&clearance, &planner, &mut rng));
        let parts = |nearest: &str| site.vehicle.parts.iter().any(|part| nearest.contains(&format!("`{}`", part.name)));
        match planner.plan(&inside, &free, &mut rng) {
            Err(PathError::StartTooNear { nearest, distance_m, needed_m }) => {
                assert!(
                    distance_m < needed_m
                        && [MARGIN_M, MARGIN_M - SELF_MARGIN_REDUCTION_M].contains(&needed_m)
                        && nearest.matches('`').count() == 4,
                    "{nearest}"
                );
            }
            other => panic!("{other:?}"),
        }
        match planner.plan(&free, &inside, &mut rng) {
            Err(PathError::GoalTooNear { nearest, distance_m, needed_m, nearest_free }) => {
                of_vehicle += i32::from(parts(&nearest));
                assert!(distance_m < needed_m, "{nearest}");
                // The named pose is free, and a 256th of the edge farther it is not.
                assert!(planner.is_free_to_arrive(&nearest_free));
                let way_rad = free.max_abs_difference(&inside);
                let share = free.max_abs_difference(&nearest_free) / way_rad;
                assert!(!planner.is_free_to_arrive(&between(&free, &inside, share + 1.01 / 256.0)), "{share}");
            }
            other => panic!("{other:?}"),
        }
    }
    assert!(of_vehicle > 10, "goals inside the vehicle are said to be that: {of_vehicle}");
}

#[test]
fn a_goal_beyond_the_safe_limits_is_named_unless_it_leads_back() {
    let site = site("open-frame");
    let clearance = ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
    let bounds = JointErrorBounds::datasheet(&site.robot);
    let limits = bounds.safe_limits(&site.robot);
    let planner = planner(&clearance, &bounds, &limits);
    let mut rng = stream_rng(1, "limits");
    let home = site.robot.stowed;
    for (joint, safe) in limits.iter().enumerate().take(5) {
        for beyond_rad in [safe.lower_rad - 0.01, safe.upper_rad + 0.01] {
            let at = JointAngles::from_fn(home.len(), |j| if j == joint { beyond_rad } else { home[j] });
            match planner.plan(&home, &at, &mut rng) {
                Err(PathError::GoalBeyondLimits { joint: named, angle_rad, lower_rad, upper_rad }) => {
                    assert_eq!((named, angle_rad), (joint, beyond_rad));
                    assert_eq!((lower_rad, upper_rad), (safe.lower_rad, safe.upper_rad));
                }
                other => panic!("{other:?}"),
            }
            let back = planner.plan(&at, &home, &mut rng);
            assert!(!matches!(back, Err(PathError::GoalBeyondLimits { .. })), "{back:?}");
        }
    }
}

#[test]
fn a_blocked_way_says_what_blocks_it_and_how_far_it_is_free() {
    let site = site("tight-basket");
    let clearance = ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
    let bounds = JointErrorBounds::alike(&site.robot, 0.014, 0.004);
    let limits = bounds.safe_limits(&site.robot);
    let planner = planner(&clearance, &bounds, &limits);
    let mut rng = stream_rng(1, "blocked");
    let mut blocked = 0;
    while blocked < 20 {
        let (from, to) = (random_free(&planner, &mut rng), random_free(&planner, &mut rng));
        if planner.time_scale(&from, &to, SLOWEST, &mut 0).is_some() {
            continue;
        }
        // The search is as one that has found no path.
        let error = planner.blocked(&from, &to, &RrtConnect::new(&planner, &from, &to));
        let PathError::Blocked { tried: 0, nearest, distance_m, free_share, is_stuck: true } = &error else {
            panic!("{error:?}")
        };
        blocked += 1;
        assert!(*distance_m < MARGIN_M && nearest.matches('`').count() == 4, "{error}");
        assert!(planner.is_edge_free(&from, &between(&from, &to, *free_share)));
        assert!(!planner.is_edge_free(&from, &between(&from, &to, free_share + 1.0 / 256.0)));
    }
}

/// If some arm barely keeps the margin, no edge in any direction can be certified. A search reports that, and half the
/// margin lets the arm leave.
#[test]
fn a_start_at_the_verge_of_its_margin_cannot_be_left() {
    let site = site("tight-basket");
    let clearance = ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
    let bounds = JointErrorBounds::alike(&site.robot, 0.014, 0.004);
    let limits = bounds.safe_limits(&site.robot);
    let planner = planner(&clearance, &bounds, &limits);
    let mut rng = stream_rng(2, "verge");
    let mut stuck = 0;
    for _ in 0..12 {
        let from = random_free(&planner, &mut rng);
        let [mut kept_m, mut not_kept_m] = [MARGIN_M, MARGIN_M + 0.06];
        if clearance.find_violation(&from, &bounds, not_kept_m).is_none() {
            continue;
        }
        for _ in 0..20 {
            let m = 0.5 * (kept_m + not_kept_m);
            let is_kept = clearance.find_violation(&from, &bounds, m).is_none();
            if is_kept { kept_m = m } else { not_kept_m = m }
        }
        let verge = PathPlanner { margin_m: kept_m, ..planner };
        let to = random_free(&verge, &mut rng);
        if !matches!(verge.plan(&from, &to, &mut rng), Err(PathError::Blocked { is_stuck: true, .. })) {
            continue;
        }
        stuck += 1;
        let half = PathPlanner { margin_m: 0.5 * kept_m, ..planner };
        half.plan(&from, &to, &mut rng).expect("half the margin leaves room");
    }
    assert!(stuck > 1, "{stuck} of 12 are stuck");
}

fn planner<'a>(
    clearance: &'a ClearanceModel<'a>,
    bounds: &'a JointErrorBounds,
    limits: &'a [JointLimits],
) -> PathPlanner<'a> {
    PathPlanner { clearance, bounds, limits, margin_m: MARGIN_M }
}

fn random(planner: &PathPlanner<'_>, rng: &mut ChaCha8Rng) -> JointAngles {
    JointAngles::from_fn(planner.limits.len(), |j| {
        rng.random_range(planner.limits[j].lower_rad..=planner.limits[j].upper_rad)
    })
}

fn random_free(planner: &PathPlanner<'_>, rng: &mut ChaCha8Rng) -> JointAngles {
    loop {
        let at = random(planner, rng);
        if planner.is_free_to_arrive(&at) {
            return at;
        }
    }
}

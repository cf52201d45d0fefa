//! Paths in the three vehicles' sites, and the names of what cannot be done.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::robot::{PlacedShape, Robot, Shape, Vehicle, load, load_vehicle};
use crate::routine::Scene;
use crate::stats::stream_rng;

const MARGIN_M: f64 = 0.05;

struct Site {
    robot: Robot,
    vehicle: Vehicle,
    scene: Scene,
}

fn site(vehicle: &str) -> Site {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("robots");
    let vehicle = load_vehicle(&root.join(format!("vehicles/{vehicle}.toml"))).expect("the vehicle reads");
    let robot = load(&root.join("titan4")).expect("the robot reads").mounted_on(&vehicle).expect("it fits");
    let mut scene = Scene { seafloor_z_m: Some(-2.2), obstacles: vec![] };
    if vehicle.name == "under-ice" {
        scene.seafloor_z_m = None;
        let part = |name: &str, shape: Shape, at: [f64; 3]| {
            let owner_from_shape = nalgebra::Isometry3::translation(at[0], at[1], at[2]);
            let placed = PlacedShape { owner_from_shape, shape, color_rgb: [0; 3] };
            crate::robot::Part { name: name.to_owned(), placed }
        };
        let ice = part("ice", Shape::Box { size_m: [10.0, 10.0, 1.0] }, [1.0, 0.0, 2.75]);
        let mut keel = part("keel", Shape::Capsule { radius_m: 0.25, length_m: 1.2 }, [2.0, 1.0, 2.2]);
        keel.placed.owner_from_shape.rotation =
            nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Vector3::y_axis(), std::f64::consts::FRAC_PI_2);
        scene.obstacles = vec![ice, keel];
    }
    Site { robot, vehicle, scene }
}

/// A pose at which the believed arm touches something.
fn random_too_near(clearance: &ClearanceModel<'_>, planner: &PathPlanner<'_>, rng: &mut ChaCha8Rng) -> JointAngles {
    loop {
        let at = random(planner, rng);
        if clearance.nearest(&at).distance_m == 0.0 {
            return at;
        }
    }
}

fn duration_s(planner: &PathPlanner<'_>, waypoints: &[JointAngles]) -> f64 {
    planner.clearance.timing().path_duration_s(&Path { waypoints: waypoints.to_vec() })
}

/// In all three sites, under wide and narrow bounds: paths are found, keep clear wherever one looks, and are the same again.
#[test]
fn paths_are_found_and_keep_clear_and_are_the_same_again() {
    for name in ["open-frame", "tight-basket", "under-ice"] {
        let site = site(name);
        let clearance = ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
        for (belief, bounds) in [
            ("narrow", JointErrorBounds::alike(&site.robot, 0.014, 0.004)),
            ("wide", JointErrorBounds::prior(&site.robot)),
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
                for edge in path.waypoints.windows(2) {
                    for step in 0..=10 {
                        let at = between(&edge[0], &edge[1], f64::from(step) / 10.0);
                        for _ in 0..20 {
                            let arm = JointAngles::from_fn(at.len(), |j| {
                                let share = f64::from(rng.random_range(-1..=1));
                                if j < 5 { at[j] + share * bounds.error_rad(j, at[j]) } else { at[j] }
                            });
                            assert!(!clearance.is_nearer_than(&arm, MARGIN_M - 1e-9), "{name} {belief}: {at:?}");
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
        let mut connect = Connect::new(&planner, &from, &to);
        let Some(waypoints) = connect.search(&mut rng) else { continue };
        let short = connect.shortened(waypoints.clone(), &mut rng);
        assert!(short.windows(2).all(|edge| planner.is_edge_free(&edge[0], &edge[1])));
        let (long_s, short_s) = (duration_s(&planner, &waypoints), duration_s(&planner, &short));
        assert!(short_s <= long_s + 1e-9, "{long_s} {short_s}");
        (before_s, after_s, n) = (before_s + long_s, after_s + short_s, n + 1);
    }
    eprintln!("{before_s:.0} s before, {after_s:.0} s after");
    assert!(after_s < 0.75 * before_s, "{before_s} {after_s}");
}

#[test]
fn ends_that_cannot_be_are_named_with_the_nearest_that_can() {
    let site = site("open-frame");
    let clearance = ClearanceModel::new(&site.robot, &site.vehicle, &site.scene);
    let bounds = JointErrorBounds::prior(&site.robot);
    let limits = bounds.safe_limits(&site.robot);
    let planner = planner(&clearance, &bounds, &limits);
    let mut rng = stream_rng(1, "named errors");
    let mut of_vehicle = 0;
    for _ in 0..40 {
        let (free, inside) = (random_free(&planner, &mut rng), random_too_near(&clearance, &planner, &mut rng));
        let parts = |nearest: &str| site.vehicle.parts.iter().any(|part| nearest.contains(&format!("`{}`", part.name)));
        match planner.plan(&inside, &free, &mut rng) {
            Err(PathError::StartTooNear { nearest, distance_m, needed_m }) => {
                assert!(distance_m < needed_m && needed_m == MARGIN_M && nearest.contains(" and "), "{nearest}");
            }
            other => panic!("{other:?}"),
        }
        match planner.plan(&free, &inside, &mut rng) {
            Err(PathError::GoalTooNear { nearest, distance_m, needed_m, nearest_free }) => {
                of_vehicle += i32::from(parts(&nearest));
                assert!(distance_m < needed_m, "{nearest}");
                // It is free, and a 256th of the way on it is not.
                assert!(planner.is_free(&nearest_free));
                let way_rad = free.max_abs_difference(&inside);
                let share = free.max_abs_difference(&nearest_free) / way_rad;
                assert!(!planner.is_free(&between(&free, &inside, share + 1.01 / 256.0)), "{share}");
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
    let bounds = JointErrorBounds::prior(&site.robot);
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
    let planner = PathPlanner { max_samples: 1, ..planner(&clearance, &bounds, &limits) };
    let mut rng = stream_rng(1, "blocked");
    let mut blocked = 0;
    while blocked < 20 {
        let (from, to) = (random_free(&planner, &mut rng), random_free(&planner, &mut rng));
        let Err(error) = planner.plan(&from, &to, &mut rng) else { continue };
        let PathError::Blocked { tried, nearest, distance_m, free_share } = &error else { panic!("{error:?}") };
        blocked += 1;
        assert_eq!(*tried, 1);
        assert!(*distance_m < MARGIN_M && nearest.contains(" and "), "{error}");
        assert!(planner.is_edge_free(&from, &between(&from, &to, *free_share)));
        assert!(!planner.is_edge_free(&from, &between(&from, &to, free_share + 1.0 / 256.0)));
    }
}

fn planner<'a>(
    clearance: &'a ClearanceModel<'a>,
    bounds: &'a JointErrorBounds,
    limits: &'a [JointLimits],
) -> PathPlanner<'a> {
    PathPlanner { clearance, bounds, limits, margin_m: MARGIN_M, max_samples: 4000 }
}

fn random(planner: &PathPlanner<'_>, rng: &mut ChaCha8Rng) -> JointAngles {
    JointAngles::from_fn(planner.limits.len(), |j| {
        rng.random_range(planner.limits[j].lower_rad..=planner.limits[j].upper_rad)
    })
}

fn random_free(planner: &PathPlanner<'_>, rng: &mut ChaCha8Rng) -> JointAngles {
    loop {
        let at = random(planner, rng);
        if planner.is_free(&at) {
            return at;
        }
    }
}

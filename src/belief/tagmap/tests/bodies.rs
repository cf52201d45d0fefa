//! Tags on a vehicle that moves, and tags on the seafloor.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;

use crate::tagmap::tests::fixture::{Scene, body, fisheye, look, looking, normal, settings};
use crate::tagmap::{Body, GroupFrame, MapSettings, MapView, TagMap, TagPrior, solve};
use armcal_core::spatial::log;
use armcal_core::stats::stream_rng;
use armcal_core::time::Stamp;

const ATTITUDE_STD_RAD: f64 = 0.002;

struct Dive {
    scene: Scene,
    /// Pose vehicle_from_seafloor in each view.
    relative: Vec<Isometry3<f64>>,
    /// Poses of the seafloor's tags in the frame of tag 10.
    floor: Vec<Isometry3<f64>>,
}

/// Four tags on the vehicle (0 to 3) and four on the seafloor (10 to 13); the vehicle has another place in each view.
fn dive(seed: u64) -> Dive {
    let mut rng = stream_rng(seed, "dive");
    let mut patch = |z: f64| -> Vec<Isometry3<f64>> {
        let tag = |k: i32, rng: &mut rand_chacha::ChaCha8Rng| {
            let place =
                Translation3::new(0.4 * f64::from(k % 2), 0.35 * f64::from(k / 2), z + rng.random_range(-0.1..0.1));
            let lean = Vector3::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), 0.3);
            Isometry3::from_parts(place, UnitQuaternion::from_scaled_axis(lean))
        };
        (0..4).map(|k| tag(k, &mut rng)).collect()
    };
    let mut on_vehicle = patch(0.0);
    let on_floor = patch(0.0);
    on_vehicle[0] = Isometry3::identity();
    let camera = fisheye();
    let (mut views, mut cameras_at, mut relative) = (Vec::new(), Vec::new(), Vec::new());
    let world_from_floor = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, -0.2, 1.0));
    for k in 0..24 {
        let mut small = |size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..size));
        let (shift, turn) = (small(0.15), small(0.15));
        let vehicle_from_floor = Isometry3::from_parts(
            Translation3::from(Vector3::new(0.6, 0.0, -0.4) + shift),
            UnitQuaternion::from_scaled_axis(turn),
        );
        let at = Vector3::new(0.5, 0.2, 0.9) + small(0.35);
        let pose = looking(at, Vector3::new(0.45, 0.2, -0.2), rng.random_range(-3.0..3.0));
        let tags: Vec<(u32, f64, Isometry3<f64>)> = (0_u32..)
            .zip(&on_vehicle)
            .map(|(id, pose)| (id, 0.15, *pose))
            .chain((10_u32..).zip(&on_floor).map(|(id, pose)| (id, 0.15, vehicle_from_floor * pose)))
            .collect();
        let tags = look(&camera, &pose, &tags, 0.3, &mut rng);
        let sensed = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| ATTITUDE_STD_RAD * normal(&mut rng)));
        let attitude = Some(world_from_floor * vehicle_from_floor.rotation.inverse() * sensed);
        views.push(MapView { camera: 0, stamp: Stamp { nanos: k }, tags, attitude });
        cameras_at.push(pose);
        relative.push(vehicle_from_floor);
    }
    let prior =
        |id: u32, body: usize, pose: Option<Isometry3<f64>>| TagPrior { id, size_m: 0.15, body, pose, std: None };
    let mut priors: Vec<TagPrior> = (0..4).map(|id| prior(id, 0, (id == 0).then(Isometry3::identity))).collect();
    priors.extend((10..14).map(|id| prior(id, 1, None)));
    let bodies = vec![Body { is_static: false, ..body("vehicle") }, body("seafloor")];
    let floor: Vec<_> = on_floor.iter().map(|pose| on_floor[0].inv_mul(pose)).collect();
    let relative = relative.iter().map(|pose| pose * on_floor[0]).collect();
    let scene = Scene { cameras: vec![camera], bodies, priors, truth: on_vehicle, views, cameras_at };
    Dive { scene, relative, floor }
}

/// Share of relative poses whose squared Mahalanobis error (6 degrees of freedom) is below the 99 % quantile.
fn check(dive: &Dive, map: &TagMap) -> (usize, usize) {
    assert_eq!(map.groups.len(), 2);
    assert_eq!(map.groups[0].frame, GroupFrame::Body("vehicle".to_owned()));
    assert_eq!(map.groups[1].frame, GroupFrame::Tag(10));
    for (k, truth) in dive.floor.iter().enumerate().skip(1) {
        let tag = map.tag(10 + k as u32).unwrap();
        let xi = log(&tag.frame_from_tag.inv_mul(truth));
        let d2 = xi.dot(&tag.covariance.cholesky().unwrap().solve(&xi));
        assert!(d2 < 33.0, "tag {}: {d2}", tag.id);
    }
    let within = map.relative.iter().filter(|relative| {
        let xi = log(&relative.first_from_second.inv_mul(&dive.relative[relative.view]));
        xi.dot(&relative.covariance.cholesky().unwrap().solve(&xi)) < 16.81
    });
    (within.count(), map.relative.len())
}

#[test]
fn a_moving_vehicle_and_the_seafloor_are_two_maps_with_a_pose_between_them_in_each_view() {
    let (mut within, mut n, mut plain, mut helped) = (0, 0, 0.0, 0.0);
    for seed in 0..10 {
        let dive = dive(seed);
        let map = solve(&dive.scene.input(), &settings()).unwrap();
        let (w, all) = check(&dive, &map);
        (within, n) = (within + w, n + all);
        let with_attitude = MapSettings { attitude_body: Some(0), attitude_std_rad: ATTITUDE_STD_RAD, ..settings() };
        let with = solve(&dive.scene.input(), &with_attitude).unwrap();
        let (w, all) = check(&dive, &with);
        (within, n) = (within + w, n + all);
        assert_eq!(map.relative.len(), with.relative.len());
        for (a, b) in map.relative.iter().zip(&with.relative) {
            plain += a.covariance.fixed_view::<3, 3>(3, 3).trace();
            helped += b.covariance.fixed_view::<3, 3>(3, 3).trace();
        }
    }
    println!("{within} of {n} within, rotation variance {:.3} of that without attitude", helped / plain);
    assert!(n > 300, "{n}");
    let share = within as f64 / n as f64;
    assert!((0.97..=1.0).contains(&share), "{share}");
    assert!(helped < 0.9 * plain, "{helped} {plain}");
}

#[test]
fn a_vehicle_that_stands_still_makes_one_map() {
    let mut dive = dive(3);
    dive.scene.bodies[0] = Body { is_static: true, ..dive.scene.bodies[0].clone() };
    // Scene with the relative pose of the first view in all views.
    let tags: Vec<(u32, f64, Isometry3<f64>)> = (0_u32..)
        .zip(&dive.scene.truth)
        .map(|(id, pose)| (id, 0.15, *pose))
        .chain((10_u32..).zip(&dive.floor).map(|(id, pose)| (id, 0.15, dive.relative[0] * pose)))
        .collect();
    let mut rng = stream_rng(3, "still");
    for (view, pose) in dive.scene.views.iter_mut().zip(&dive.scene.cameras_at) {
        view.tags = look(&dive.scene.cameras[0], pose, &tags, 0.3, &mut rng);
    }
    let map = solve(&dive.scene.input(), &settings()).unwrap();
    assert_eq!(map.groups.len(), 1);
    assert!(map.relative.is_empty());
    let tag = map.tag(12).unwrap();
    let error = tag.frame_from_tag.translation.vector - (dive.relative[0] * dive.floor[2]).translation.vector;
    let d2 = error.dot(&tag.position_covariance_m2().cholesky().unwrap().solve(&error));
    assert!(d2 < 20.0, "{d2}");
}

//! Bad and awkward data.

use armcal_core::codes::Code;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;

use crate::tagmap::tests::fixture::{Scene, fisheye, look, looking, pinhole, settings, size_of, wall};
use crate::tagmap::tests::{distances, position_errors};
use crate::tagmap::{GroupFrame, MapDetection, MapMode, MapRejection, MapSettings, MapView, TagMap, TagPrior, solve};
use armcal_core::stats::stream_rng;
use armcal_core::time::Stamp;

#[test]
fn a_tag_seen_twice_in_one_image_is_not_used_there() {
    let mut scene = wall(fisheye(), 4, 10, 0.3, 1);
    let view = scene.views.iter().position(|view| view.tags.len() > 2).unwrap();
    let twice = scene.views[view].tags[1].clone();
    scene.views[view].tags.push(twice.clone());
    let map = solve(&scene.input(), &settings()).unwrap();
    assert_eq!(map.rejected_by_reason()[&MapRejection::SeenTwice], 2);
    assert!(map.rejected.iter().all(|rejected| (rejected.view, rejected.id) == (view, twice.id)));
}

/// Adds wrong ids and corners with gross errors; returns the spoilt detections by view and id.
fn spoil(scene: &mut Scene, share: f64, seed: u64) -> Vec<(usize, u32)> {
    let mut rng = stream_rng(seed, "outliers");
    let n_tags = scene.truth.len() as u32;
    let mut spoilt = Vec::new();
    for (idx, view) in scene.views.iter_mut().enumerate() {
        let ids: Vec<u32> = view.tags.iter().map(|tag| tag.id).collect();
        for tag in &mut view.tags {
            if rng.random_range(0.0..1.0) >= share {
                continue;
            }
            let other = (0..n_tags).find(|id| !ids.contains(id));
            match other.filter(|_| rng.random_range(0.0..1.0) < 0.5) {
                Some(other) => tag.id = other,
                None => tag.corners_px[rng.random_range(0..4)][0] += rng.random_range(8.0..40.0),
            }
            spoilt.push((idx, tag.id));
        }
    }
    spoilt
}

#[test]
fn five_percent_of_outliers_are_found_and_do_no_harm() {
    let (mut all, mut n_spoilt, mut n_found, mut n_wrongly, mut n) = (Vec::new(), 0, 0, 0, 0);
    for seed in 0..30 {
        let mut scene = wall(if seed % 2 == 0 { fisheye() } else { pinhole() }, 8, 20, 0.3, seed);
        let spoilt = spoil(&mut scene, 0.05, seed);
        let map = solve(&scene.input(), &settings()).unwrap();
        all.extend(distances(&scene, &map));
        let mut rejected: Vec<(usize, u32)> = map.rejected.iter().map(|r| (r.view, r.id)).collect();
        rejected.dedup();
        // With two tags in an image nothing shows which of them is wrong.
        let is_judged = |(view, _): &&(usize, u32)| scene.views[*view].tags.len() > 2;
        n_spoilt += spoilt.iter().filter(is_judged).count();
        n_found += spoilt.iter().filter(is_judged).filter(|one| rejected.contains(one)).count();
        n_wrongly += rejected.iter().filter(is_judged).filter(|one| !spoilt.contains(one)).count();
        n += map.n_detections;
    }
    let within = all.iter().filter(|d2| **d2 < 11.34).count() as f64 / all.len() as f64;
    println!("{n_found} of {n_spoilt} outliers found, {n_wrongly} of {n} wrongly, {within} within");
    assert!(n_spoilt > 60, "{n_spoilt}");
    assert!(n_found as f64 >= 0.97 * f64::from(n_spoilt as u32), "{n_found} of {n_spoilt}");
    assert!(n_wrongly * 200 <= n, "{n_wrongly} of {n}");
    assert!(within >= 0.96, "{within}");
}

/// An image full of noise: random quadrilaterals with ids of existing tags.
#[test]
fn an_image_full_of_noise_is_rejected() {
    let mut scene = wall(fisheye(), 6, 14, 0.3, 2);
    let mut rng = stream_rng(1, "noise image");
    let mut corner = || [rng.random_range(0.0..1223.0), rng.random_range(0.0..1023.0)];
    let tags: Vec<MapDetection> = (0..6)
        .map(|id| MapDetection { id, corners_px: std::array::from_fn(|_| corner()), covariance_px2: None })
        .collect();
    scene.views.push(MapView { camera: 0, stamp: Stamp { nanos: i64::MAX }, tags, attitude: None });
    let map = solve(&scene.input(), &settings()).unwrap();
    let of_noise = map.rejected.iter().filter(|rejected| rejected.view == 14).count();
    assert!(of_noise >= 5, "{:?}", map.rejected);
    assert!(distances(&scene, &map).iter().all(|d2| *d2 < 25.0));
}

/// Two walls that no image shows together.
#[test]
fn groups_that_nothing_connects_are_maps_of_their_own() {
    let (first, second) = (wall(fisheye(), 4, 12, 0.3, 1), wall(fisheye(), 4, 12, 0.3, 2));
    let mut both = Scene { views: first.views.clone(), ..wall(fisheye(), 4, 12, 0.3, 1) };
    for (prior, view) in second.priors.iter().zip(0..) {
        let _: i32 = view;
        both.priors.push(TagPrior { id: prior.id + 10, pose: None, ..prior.clone() });
    }
    for view in &second.views {
        let mut view = view.clone();
        view.tags.iter_mut().for_each(|tag| tag.id += 10);
        both.views.push(view);
    }
    let map = solve(&both.input(), &settings()).unwrap();
    assert_eq!(map.groups.len(), 2);
    assert_eq!(map.groups[0].frame, GroupFrame::Body("base".to_owned()));
    assert_eq!(map.groups[1].frame, GroupFrame::Tag(10));
    assert_eq!(map.groups[1].tags, [10, 11, 12, 13]);
    for id in [11, 12, 13] {
        let tag = map.tag(id).unwrap();
        assert_eq!(tag.group, 1);
        // Tag 10 is where the second wall's tag 0 is, turned like it.
        let truth = second.truth[0].inv_mul(&second.truth[id as usize - 10]);
        let error = tag.frame_from_tag.translation.vector - truth.translation.vector;
        assert!(error.norm() < 5.0 * tag.position_std_m().iter().sum::<f64>(), "{error}");
    }
}

/// Images in a long corridor: each shows only its neighbours.
#[test]
fn a_long_chain_of_tags_holds_together() {
    let camera = pinhole();
    let n = 60_u32;
    let mut rng = stream_rng(4, "corridor");
    let truth: Vec<Isometry3<f64>> = (0..n)
        .map(|id| {
            let lean = Vector3::new(rng.random_range(-0.3..0.3), rng.random_range(-0.3..0.3), 0.1 * f64::from(id));
            let place = Translation3::new(0.3 * f64::from(id), rng.random_range(-0.1..0.1), 0.0);
            Isometry3::from_parts(place, UnitQuaternion::from_scaled_axis(lean))
        })
        .collect();
    let tags: Vec<_> = truth.iter().enumerate().map(|(id, pose)| (id as u32, size_of(id as u32), *pose)).collect();
    let (mut views, mut cameras_at) = (Vec::new(), Vec::new());
    for k in 0..360 {
        let x = 0.05 * f64::from(k);
        let at = Vector3::new(x, rng.random_range(-0.3..0.3), rng.random_range(1.0..1.4));
        let pose = looking(at, Vector3::new(x + rng.random_range(-0.3..0.3), 0.0, 0.0), rng.random_range(-0.5..0.5));
        let tags = look(&camera, &pose, &tags, 0.3, &mut rng);
        views.push(MapView { camera: 0, stamp: Stamp { nanos: i64::from(k) }, tags, attitude: None });
        cameras_at.push(pose);
    }
    let mut scene = wall(camera, 1, 1, 0.0, 1);
    let prior = |(id, size_m, pose): &(u32, f64, Isometry3<f64>)| TagPrior {
        id: *id,
        size_m: *size_m,
        body: 0,
        pose: (*id == 0).then_some(*pose),
        std: None,
    };
    scene.priors = tags.iter().map(prior).collect();
    (scene.truth, scene.views, scene.cameras_at) = (truth, views, cameras_at);
    let map = solve(&scene.input(), &settings()).unwrap();
    assert_eq!((map.groups.len(), map.tags.len()), (1, 60));
    let d2 = distances(&scene, &map);
    assert!(d2.iter().all(|d2| *d2 < 25.0), "{d2:?}");
    // A tag far from the base has a larger standard deviation.
    assert!(map.tag(59).unwrap().position_std_m()[1] > 5.0 * map.tag(5).unwrap().position_std_m()[1]);
}

#[test]
fn sizes_that_are_off_by_ten_are_named() {
    let known = MapSettings { mode: MapMode::PartlyKnown, ..settings() };
    let scene_of = |sizes: &[(u32, f64)], n_tags| {
        let mut scene = wall(fisheye(), n_tags, 14, 0.3, 7);
        for (prior, truth) in scene.priors.iter_mut().zip(&scene.truth) {
            prior.pose = Some(*truth);
            prior.std = Some([1e-3, 1e-3, 1e-3, 3e-3, 3e-3, 3e-3]);
        }
        for (id, factor) in sizes {
            scene.priors[*id as usize].size_m *= factor;
        }
        solve(&scene.input(), &known).unwrap().scale_warnings
    };
    assert_eq!(scene_of(&[], 5), []);
    let one = scene_of(&[(3, 10.0)], 5);
    assert_eq!(one.len(), 1, "{one:?}");
    assert_eq!(one[0].tags, [3]);
    assert!((one[0].factor - 0.1).abs() < 0.01, "{one:?}");
    let all = scene_of(&[(0, 0.1), (1, 0.1), (2, 0.1), (3, 0.1)], 4);
    assert_eq!(all.len(), 1, "{all:?}");
    assert_eq!(all[0].tags, [0, 1, 2, 3]);
    assert!((all[0].factor - 10.0).abs() < 0.5, "{all:?}");
    let of_two = scene_of(&[(1, 10.0)], 2);
    assert_eq!(of_two.len(), 1, "{of_two:?}");
    assert!((of_two[0].factor - 0.1).abs() < 0.02 && of_two[0].tags == [1], "{of_two:?}");
}

#[test]
fn a_known_map_is_held_and_locates_the_cameras() {
    let mut scene = wall(fisheye(), 6, 10, 0.3, 9);
    for (prior, truth) in scene.priors.iter_mut().zip(&scene.truth) {
        (prior.pose, prior.std) = (Some(*truth), Some([1e-3; 6]));
    }
    let map = solve(&scene.input(), &MapSettings { mode: MapMode::Known, ..settings() }).unwrap();
    assert!(map.tags.iter().all(|tag| tag.is_fixed) && position_errors(&scene, &map).is_empty());
    let reduced = map.chi_square / map.degrees_of_freedom as f64;
    assert!((0.7..1.3).contains(&reduced), "{reduced}");
    for (view, truth) in map.views.iter().zip(&scene.cameras_at).filter(|(view, _)| !view.is_empty()) {
        assert!((view[&0].translation.vector - truth.translation.vector).norm() < 0.01);
    }
    // A tag at a wrong place is reported.
    scene.priors[2].pose = Some(Translation3::new(0.05, 0.0, 0.0) * scene.truth[2]);
    let map = solve(&scene.input(), &MapSettings { mode: MapMode::Known, ..settings() }).unwrap();
    let off = map.rejected.iter().filter(|rejected| rejected.id == 2).count();
    assert!(map.warnings.iter().any(|warning| warning.code == Code::MapTagDisagrees), "{:?}", map.warnings);
    assert!(off > 0 && map.rejected.iter().filter(|rejected| rejected.id != 2).count() * 4 < off, "{:?}", map.rejected);
}

#[test]
fn a_known_place_that_the_views_contradict_is_named() {
    let mut scene = wall(fisheye(), 6, 14, 0.3, 9);
    for (prior, truth) in scene.priors.iter_mut().zip(&scene.truth) {
        (prior.pose, prior.std) = (Some(*truth), Some([5e-3, 5e-3, 5e-3, 0.02, 0.02, 0.02]));
    }
    let named = |scene: &Scene| solve(&scene.input(), &settings()).unwrap().warnings;
    assert_eq!(named(&scene), []);
    scene.priors[3].pose = Some(Translation3::new(0.0, 0.08, 0.0) * scene.truth[3]);
    let warnings = named(&scene);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert_eq!(warnings[0].code, Code::MapTagDisagrees);
    insta::assert_snapshot!("contradicted_place", warnings[0]);
}

/// A wall of 300 tags, 30 m long: many chains connect neighbours, some of them long.
#[test]
fn a_long_wall_of_tags_holds_together() {
    let camera = fisheye();
    let mut rng = stream_rng(4, "long wall");
    let truth: Vec<Isometry3<f64>> = (0..300_u32)
        .map(|id| {
            let lean = Vector3::new(rng.random_range(-0.3..0.3), rng.random_range(-0.3..0.3), 0.1 * f64::from(id));
            let place = Translation3::new(0.3 * f64::from(id / 3), 0.5 * f64::from(id % 3) - 0.5, 0.0);
            Isometry3::from_parts(place, UnitQuaternion::from_scaled_axis(lean))
        })
        .collect();
    let tags: Vec<_> = truth.iter().enumerate().map(|(id, pose)| (id as u32, size_of(id as u32), *pose)).collect();
    let (mut views, mut cameras_at) = (Vec::new(), Vec::new());
    for k in 0..600 {
        let x = 0.05 * f64::from(k);
        let at = Vector3::new(x, rng.random_range(-0.3..0.3), rng.random_range(0.5..1.0));
        let pose = looking(at, Vector3::new(x + rng.random_range(-0.3..0.3), 0.0, 0.0), rng.random_range(-0.5..0.5));
        let near: Vec<_> = tags.iter().filter(|tag| (tag.2.translation.x - x).abs() < 0.5).copied().collect();
        let tags = look(&camera, &pose, &near, 0.3, &mut rng);
        views.push(MapView { camera: 0, stamp: Stamp { nanos: i64::from(k) }, tags, attitude: None });
        cameras_at.push(pose);
    }
    let mut scene = wall(camera, 1, 1, 0.0, 1);
    let prior = |(id, size_m, pose): &(u32, f64, Isometry3<f64>)| TagPrior {
        id: *id,
        size_m: *size_m,
        body: 0,
        pose: (*id == 0).then_some(*pose),
        std: None,
    };
    scene.priors = tags.iter().map(prior).collect();
    (scene.truth, scene.views, scene.cameras_at) = (truth, views, cameras_at);
    let started = std::time::Instant::now();
    let map = solve(&scene.input(), &settings()).unwrap();
    println!("{} detections, {:.2} s", map.n_detections, started.elapsed().as_secs_f64());
    assert_eq!((map.groups.len(), map.tags.len()), (1, 300));
    assert!(map.n_used * 1000 >= map.n_detections * 998, "{} of {}", map.n_used, map.n_detections);
    let reduced = map.chi_square / map.degrees_of_freedom as f64;
    assert!((0.9..1.1).contains(&reduced), "{reduced}");
    // Errors of tags far from the base are nearly the same, so their distances are not independent.
    assert!(distances(&scene, &map).iter().all(|d2| *d2 < 30.0));
}

/// Random squares with random tags.
fn nonsense(n_tags: u32, n_views: usize, seed: u64) -> Scene {
    let mut scene = wall(pinhole(), n_tags, n_views, 0.3, seed);
    let mut rng = stream_rng(seed, "nonsense");
    for view in &mut scene.views {
        let mut ids: Vec<u32> = (0..n_tags).collect();
        view.tags.clear();
        for _ in 0..6.min(n_tags) {
            let id = ids.swap_remove(rng.random_range(0..ids.len()));
            let at = Vector3::from_fn(|_, _| rng.random_range(-0.7..0.7)) + Vector3::new(0.0, 0.0, 2.0);
            let camera_from_tag = looking(
                at,
                at + Vector3::new(rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5), -1.0),
                rng.random_range(0.0..6.0),
            );
            view.tags.extend(look(
                &scene.cameras[0],
                &Isometry3::identity(),
                &[(id, size_of(id), camera_from_tag)],
                0.3,
                &mut rng,
            ));
        }
    }
    scene
}

/// The search ends by a number of steps, the same on every machine, and states the reason.
#[test]
fn views_that_contradict_each_other_end_by_the_budget() {
    let scene = nonsense(40, 100, 0);
    let map = solve(&scene.input(), &settings()).unwrap();
    assert!(!map.has_converged);
    assert!(map.warnings.iter().any(|warning| warning.code == Code::MapNotConverged), "{:?}", map.warnings);
    let again = solve(&scene.input(), &settings()).unwrap();
    let poses = |map: &TagMap| map.tags.iter().map(|tag| tag.frame_from_tag).collect::<Vec<_>>();
    assert_eq!(poses(&map), poses(&again));
}

//! The solver against scenes of known truth.

mod anchored;
mod bodies;
mod bound;
mod checked;
mod contradicted;
mod corridor;
mod data;
mod fixture;
mod statistics;

use fixture::{fisheye, pinhole, settings, wall};
use nalgebra::Vector3;

use crate::tagmap::{MapDetection, MapInput, TagMap, TagMapError, solve};
use fixture::Scene;

fn position_errors(scene: &Scene, map: &TagMap) -> Vec<(u32, Vector3<f64>)> {
    map.tags
        .iter()
        .filter(|tag| !tag.is_fixed)
        .map(|tag| (tag.id, tag.frame_from_tag.translation.vector - scene.truth[tag.id as usize].translation.vector))
        .collect()
}

/// Squared Mahalanobis distance of each estimated tag's position.
fn distances(scene: &Scene, map: &TagMap) -> Vec<f64> {
    let squared = |(id, error): (u32, Vector3<f64>)| {
        let covariance = map.tag(id).expect("mapped").position_covariance_m2();
        error.dot(&covariance.cholesky().expect("positive definite").solve(&error))
    };
    position_errors(scene, map).into_iter().map(squared).collect()
}

#[test]
fn without_noise_the_truth_comes_out() {
    for (camera, seed) in [(fisheye(), 1), (pinhole(), 2)] {
        let scene = wall(camera, 7, 20, 0.0, seed);
        let map = solve(&scene.input(), &settings()).unwrap();
        assert!(map.tags.len() >= 6, "{}", map.tags.len());
        assert!(map.has_converged && map.rms_px < 1e-6, "{}", map.rms_px);
        for (id, error) in position_errors(&scene, &map) {
            assert!(error.norm() < 1e-8, "tag {id}: {error}");
        }
        for (view, truth) in map.views.iter().zip(&scene.cameras_at) {
            if let Some(pose) = view.get(&0) {
                assert!((pose.translation.vector - truth.translation.vector).norm() < 1e-7);
            }
        }
    }
}

#[test]
fn a_map_without_its_base_tag_says_which_tags_there_are() {
    let mut scene = wall(fisheye(), 4, 10, 0.3, 1);
    for view in &mut scene.views {
        view.tags.retain(|tag| tag.id != 0);
    }
    let error = solve(&scene.input(), &settings()).unwrap_err();
    assert_eq!(error, TagMapError::NoBaseTag { base_tag: 0, seen: vec![1, 2, 3] });
}

#[test]
fn input_that_cannot_be_meant_is_refused() {
    let scene = wall(fisheye(), 4, 10, 0.3, 1);
    let with = |edit: &dyn Fn(&mut Scene)| {
        let mut scene = wall(fisheye(), 4, 10, 0.3, 1);
        edit(&mut scene);
        solve(&scene.input(), &settings()).map(|_| ()).unwrap_err()
    };
    assert_eq!(with(&|s| s.priors[2].size_m = 0.0), TagMapError::TagSize { id: 2, size_m: 0.0 });
    assert_eq!(with(&|s| s.priors[2].size_m = -0.1), TagMapError::TagSize { id: 2, size_m: -0.1 });
    assert!(matches!(with(&|s| s.priors[2].size_m = f64::NAN), TagMapError::TagSize { id: 2, .. }));
    assert_eq!(with(&|s| s.priors[2].id = 1), TagMapError::TagTwice { id: 1 });
    assert_eq!(with(&|s| s.priors[2].body = 1), TagMapError::NoSuchBody { id: 2, body: 1, n_bodies: 1 });
    assert_eq!(with(&|s| s.views[3].camera = 2), TagMapError::NoSuchCamera { view: 3, camera: 2, n_cameras: 1 });
    assert_eq!(with(&|s| s.views.clear()), TagMapError::NoDetections);
    let many = |s: &mut Scene| {
        let tag = s.views[0].tags[0].clone();
        s.views[0].tags = (0..5001).map(|id| MapDetection { id, ..tag.clone() }).collect();
    };
    assert_eq!(with(&many), TagMapError::ManyTags { n: 5001 });
    let nothing = MapInput { tags: &[], ..scene.input() };
    let error = solve(&nothing, &crate::tagmap::MapSettings { base_tag: None, ..settings() }).unwrap_err();
    let n = scene.views.iter().map(|view| view.tags.len()).sum();
    assert_eq!(error, TagMapError::NothingLeft { rejected: n, reasons: format!("unknown_tag {n}") });
}

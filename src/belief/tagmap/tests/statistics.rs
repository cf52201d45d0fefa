//! Statistics over many seeds: errors as small as the bound, and covariances that match them.

use crate::tagmap::tests::bound::cramer_rao;
use crate::tagmap::tests::fixture::{Scene, body, fisheye, look, looking, pinhole, settings, wall};
use crate::tagmap::tests::{distances, position_errors};
use crate::tagmap::{MapInput, MapSettings, MapView, NoiseScale, TagPrior, solve};
use armcal_core::optics::{CameraModel, LensModel, SquarePose, solve_square_both};
use armcal_core::stats::stream_rng;
use armcal_core::time::Stamp;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;

const NOISE_PX: f64 = 0.3;
/// Chi-square of 3 degrees of freedom, 99 %.
const CHI_SQUARE_3_99: f64 = 11.34;

struct Figures {
    share_within: f64,
    /// Rms position error over the bound's, all tags together.
    efficiency: f64,
    /// Rms of each tag's error over its own bound, so that the worst determined tags do not dominate.
    each: f64,
    n: usize,
}

fn over_seeds(camera: CameraModel, seeds: std::ops::Range<u64>, settings: &MapSettings) -> Figures {
    let (mut all, mut squared_error, mut squared_bound, mut relative) = (Vec::new(), 0.0, 0.0, 0.0);
    for seed in seeds {
        let scene = wall(camera, 6, 14, NOISE_PX, seed);
        let map = solve(&scene.input(), settings).unwrap();
        assert!(map.has_converged, "seed {seed}");
        assert_eq!(map.groups.len(), 1, "seed {seed}");
        all.extend(distances(&scene, &map));
        let ids: Vec<u32> = map.tags.iter().map(|tag| tag.id).collect();
        let bounds = cramer_rao(&scene, &ids, NOISE_PX);
        for ((_, error), bound) in position_errors(&scene, &map).iter().zip(&bounds) {
            squared_error += error.norm_squared();
            squared_bound += bound.trace();
            relative += error.norm_squared() / bound.trace();
        }
    }
    let within = all.iter().filter(|d2| **d2 < CHI_SQUARE_3_99).count();
    Figures {
        share_within: within as f64 / all.len() as f64,
        efficiency: (squared_error / squared_bound).sqrt(),
        each: (relative / all.len() as f64).sqrt(),
        n: all.len(),
    }
}

/// Checks that 99 +- 2 % of 500 cases are within the 99 % quantile. Errors are at most 1.1 times the Cramer-Rao bound;
/// the sample's own scatter is 3 % of the bound. The narrower pinhole sees some tags in one or two images, and these
/// few dominate its sum; there each tag counts alike.
#[test]
fn errors_are_as_small_as_possible_and_as_large_as_said() {
    for (camera, seeds) in [(fisheye(), 0..100), (pinhole(), 0..40)] {
        let figures = over_seeds(camera, seeds, &settings());
        let Figures { share_within, efficiency, each, n } = figures;
        println!("{n} cases: {share_within:.4} within, {efficiency:.3} of the bound, each {each:.3}");
        assert!(n >= 150);
        assert!((0.97..=1.0).contains(&share_within), "{share_within}");
        assert!((0.85..=1.1).contains(&each), "{each}");
        let is_wide = matches!(camera.lens, LensModel::Equidistant(_));
        assert!(!is_wide || (0.85..=1.1).contains(&efficiency), "{efficiency}");
    }
}

/// Checks the covariances if the noise is not known, but estimated from the residuals.
#[test]
fn estimated_noise_gives_honest_covariances() {
    let unsure = MapSettings { corner_std_px: 1.0, noise: NoiseScale::Estimated, ..settings() };
    let figures = over_seeds(fisheye(), 200..240, &unsure);
    assert!((0.96..=1.0).contains(&figures.share_within), "{}", figures.share_within);
    assert!(figures.efficiency < 1.15, "{}", figures.efficiency);
    let scene = wall(fisheye(), 6, 30, NOISE_PX, 1);
    let map = solve(&scene.input(), &unsure).unwrap();
    assert!((map.noise_scale / NOISE_PX - 1.0).abs() < 0.1, "{}", map.noise_scale);
}

/// Small tags, far away and nearly head-on: single images cannot show which way they lean.
#[test]
fn tags_seen_head_on_do_not_end_up_mirrored() {
    let camera = fisheye();
    let (mut n_mirrored, mut n_seen) = (0, 0);
    for seed in 0..20 {
        let mut rng = stream_rng(seed, "head-on");
        let mut truth = Vec::new();
        for id in 0..6 {
            let place = Vector3::new(0.35 * f64::from(id % 3) - 0.35, 0.35 * f64::from(id / 3), 0.0);
            let lean = Vector3::new(rng.random_range(-0.15..0.15), rng.random_range(-0.15..0.15), 0.0);
            truth.push(Isometry3::from_parts(Translation3::from(place), UnitQuaternion::from_scaled_axis(lean)));
        }
        let tags: Vec<_> = truth.iter().enumerate().map(|(id, pose)| (id as u32, 0.1, *pose)).collect();
        let mut views = Vec::new();
        let mut cameras_at = Vec::new();
        for k in 0..20 {
            let at = Vector3::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), 2.0);
            let pose = looking(at, Vector3::zeros(), rng.random_range(-3.0..3.0));
            let tags = look(&camera, &pose, &tags, NOISE_PX, &mut rng);
            for tag in &tags {
                let Ok((best, Some(other))) = solve_square_both(&camera, 0.1, &tag.corners_px) else { continue };
                let true_turn = pose.rotation.inverse() * truth[tag.id as usize].rotation;
                let off = |solved: &SquarePose| solved.camera_from_tag.rotation().angle_to(&true_turn);
                n_seen += 1;
                n_mirrored += usize::from(off(&best) > off(&other));
            }
            views.push(MapView { camera: 0, stamp: Stamp { nanos: k }, tags, attitude: None });
            cameras_at.push(pose);
        }
        let prior = |(id, size_m, pose): &(u32, f64, Isometry3<f64>)| TagPrior {
            id: *id,
            size_m: *size_m,
            body: 0,
            pose: (*id == 0).then_some(*pose),
            std: None,
        };
        let priors = tags.iter().map(prior).collect();
        let scene = Scene { cameras: vec![camera], bodies: vec![body("base")], priors, truth, views, cameras_at };
        let map = solve(&scene.input(), &settings()).unwrap();
        assert_eq!(map.tags.len(), 6);
        let reduced = map.chi_square / map.degrees_of_freedom as f64;
        assert!((0.8..1.2).contains(&reduced), "seed {seed}: {reduced}");
        for tag in map.tags.iter().filter(|tag| !tag.is_fixed) {
            let turn = tag.frame_from_tag.rotation.angle_to(&scene.truth[tag.id as usize].rotation);
            let std = tag.rotation_std_rad().iter().map(|s| s * s).sum::<f64>().sqrt();
            assert!(turn < 4.5 * std, "seed {seed}, tag {}: {turn} rad, std {std}", tag.id);
        }
    }
    println!("{n_mirrored} of {n_seen} single squares fit better mirrored");
    assert!(n_mirrored * 5 > n_seen, "the scene is a hard one: {n_mirrored} of {n_seen}");
}

/// Known places have errors within their standard deviations: the map must be better than the given places.
#[test]
fn known_places_help_and_are_not_believed_too_much() {
    let (mut given, mut found, mut all) = (0.0, 0.0, Vec::new());
    for seed in 0..30 {
        let mut scene = wall(fisheye(), 6, 4, NOISE_PX, seed);
        let mut rng = stream_rng(seed, "survey");
        let std = [2e-3, 2e-3, 2e-3, 5e-3, 5e-3, 5e-3];
        for (prior, truth) in scene.priors.iter_mut().zip(&scene.truth).skip(1) {
            let mut draw = |std: f64| std * crate::tagmap::tests::fixture::normal(&mut rng);
            let xi = nalgebra::Vector6::from(std.map(&mut draw));
            prior.pose = Some(truth * armcal_core::spatial::exp(&xi));
            prior.std = Some(std);
        }
        let map = solve(&scene.input(), &settings()).unwrap();
        all.extend(distances(&scene, &map));
        for (id, error) in position_errors(&scene, &map) {
            found += error.norm_squared();
            let place = scene.priors[id as usize].pose.unwrap().translation.vector;
            given += (place - scene.truth[id as usize].translation.vector).norm_squared();
        }
    }
    assert!(found < 0.6 * given, "{found} {given}");
    let within = all.iter().filter(|d2| **d2 < CHI_SQUARE_3_99).count() as f64 / all.len() as f64;
    assert!(within >= 0.96, "{within}");
}

#[test]
fn the_order_of_views_and_tags_does_not_matter() {
    let scene = wall(fisheye(), 7, 20, NOISE_PX, 3);
    let mut views = scene.views.clone();
    views.reverse();
    views.rotate_left(7);
    for view in &mut views {
        view.tags.reverse();
    }
    let mut tags = scene.priors.clone();
    tags.reverse();
    let a = solve(&scene.input(), &settings()).unwrap();
    let b = solve(&MapInput { views: &views, tags: &tags, ..scene.input() }, &settings()).unwrap();
    for (a, b) in a.tags.iter().zip(&b.tags) {
        assert_eq!(a.id, b.id);
        assert!((a.frame_from_tag.to_homogeneous() - b.frame_from_tag.to_homogeneous()).norm() < 1e-9);
        assert!((a.covariance - b.covariance).norm() <= 1e-9 * a.covariance.norm());
    }
    assert_eq!(a.n_used, b.n_used);
}

#[test]
fn the_joint_covariance_holds_those_of_the_tags() {
    let scene = wall(fisheye(), 6, 14, NOISE_PX, 5);
    let map = solve(&scene.input(), &settings()).unwrap();
    let ids: Vec<u32> = map.tags.iter().map(|tag| tag.id).collect();
    let joint = map.joint_covariance(&ids).unwrap();
    for (k, tag) in map.tags.iter().enumerate() {
        let own = joint.fixed_view::<6, 6>(6 * k, 6 * k).into_owned();
        assert!((own - tag.covariance).norm() <= 1e-9 * tag.covariance.norm().max(1e-12));
    }
    assert!((&joint - joint.transpose()).norm() < 1e-9 * joint.norm());
    assert!(joint.clone().symmetric_eigenvalues().min() > -1e-12 * joint.norm());
    assert!(map.joint_covariance(&[999]).is_none());
}

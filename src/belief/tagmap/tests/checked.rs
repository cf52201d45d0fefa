//! Maps from wrong files are refused, and those from correct files are not.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::say::map_refusal::MapRefusalCause;
use crate::say::refusal::Refusal;
use crate::tagmap::blind::Blind;
use crate::tagmap::odd_tags::{OddTag, Oddity, odd_tag};
use crate::tagmap::tests::distances;
use crate::tagmap::tests::fixture::{Scene, fisheye, look, pinhole, settings, size_of, wall};
use crate::tagmap::{MapMode, MapSettings, NoiseScale, TagMap, TagMapError, checked_map};
use armcal_core::codes::{Code, Coded};
use armcal_core::optics::{CameraModel, Fisheye};
use armcal_core::stats::stream_rng;

const SEEDS: std::ops::Range<u64> = 40..44;
const NOISE_PX: f64 = 0.3;

fn scene(camera: CameraModel, seed: u64) -> Scene {
    wall(camera, 8, 30, NOISE_PX, seed)
}

fn as_stated(mode: MapMode) -> MapSettings {
    MapSettings { mode, noise: NoiseScale::Estimated, ..settings() }
}

fn checked(scene: &Scene, mode: MapMode) -> Result<TagMap, TagMapError> {
    checked_map(&scene.input(), &as_stated(mode))
}

fn with_focal(lens: &CameraModel, ratio: f64) -> CameraModel {
    let [fx, fy, rest @ ..] = lens.intrinsics();
    let [cx, cy, a, b, c, d] = rest;
    lens.with_intrinsics([fx * ratio, fy * ratio, cx, cy, a, b, c, d])
}

/// The scene with all places known, as `written` changes the true ones.
fn surveyed(mut scene: Scene, written: impl Fn(&Isometry3<f64>) -> Isometry3<f64>) -> Scene {
    for (prior, truth) in scene.priors.iter_mut().zip(&scene.truth) {
        (prior.pose, prior.std) = (Some(written(truth)), Some([1e-3, 1e-3, 1e-3, 3e-3, 3e-3, 3e-3]));
    }
    scene
}

#[test]
fn a_map_of_right_files_is_given_out_without_a_word() {
    for (camera, seed) in [fisheye(), pinhole()].into_iter().flat_map(|camera| SEEDS.map(move |seed| (camera, seed))) {
        for mode in [MapMode::Unknown, MapMode::PartlyKnown, MapMode::Known] {
            let scene = surveyed(scene(camera, seed), |pose| *pose);
            let map = checked(&scene, mode).unwrap();
            let blames = |code: Code| matches!(code, Code::Lens | Code::MapTagSize | Code::MapTagDisagrees);
            let blamed: Vec<_> = map.warnings.iter().filter(|warning| blames(warning.code)).collect();
            assert!(blamed.is_empty() && map.lens_errors.is_none(), "seed {seed}, {mode:?}: {blamed:?}");
            assert!(!map.is_contradicted, "seed {seed}, {mode:?}");
        }
    }
}

#[test]
fn a_focal_length_far_off_is_refused_with_what_the_views_show() {
    for (ratio, seed) in [0.75, 0.9, 1.1, 1.33].into_iter().flat_map(|ratio| SEEDS.map(move |seed| (ratio, seed))) {
        let mut scene = scene(pinhole(), seed);
        scene.cameras = vec![with_focal(&pinhole(), ratio)];
        let refused = checked(&scene, MapMode::Unknown).map(|_| ()).unwrap_err();
        assert_eq!(refused.code(), Code::LensContradicted, "seed {seed}: {refused}");
        let TagMapError::Refused(refused) = refused else { panic!("{refused}") };
        let MapRefusalCause::OfCalibration(Refusal::Lens { ratio: found, std, .. }) = refused.cause else {
            panic!("{refused}")
        };
        assert!((found * ratio - 1.0).abs() < 5.0 * std && std < 0.01, "seed {seed}: {found} of {ratio}, {std}");
    }
}

#[test]
fn a_lens_that_is_a_little_off_is_estimated_with_the_map() {
    let (mut all, mut n_estimated) = (Vec::new(), 0);
    for seed in 50..58 {
        let mut scene = scene(fisheye(), seed);
        let [fx, fy, cx, cy, a, b, c, d] = with_focal(&fisheye(), 0.98).intrinsics();
        scene.cameras = vec![fisheye().with_intrinsics([fx, fy, cx + 6.0, cy - 4.0, a, b, c, d])];
        let map = checked(&scene, MapMode::Unknown).unwrap();
        n_estimated += usize::from(map.warnings.iter().any(|warning| warning.code == Code::Lens));
        all.extend(distances(&scene, &map));
    }
    assert!(n_estimated >= 6, "{n_estimated}");
    // Chi-square of 3 degrees of freedom, 99.9 %. Maps in which the lens is not estimated do not include its error.
    let within = all.iter().filter(|squared| **squared < 16.27).count() as f64 / all.len() as f64;
    assert!(within > 0.9, "{within}");
}

/// A fisheye's distortion can imitate a pinhole: then it is estimated, and the map is correct.
#[test]
fn a_lens_of_another_model_or_image_size_does_not_pass() {
    for seed in SEEDS {
        let mut scene = scene(pinhole(), seed);
        let (focal_px, center_px, resolution_px) =
            (pinhole().focal_px(), pinhole().center_px(), pinhole().resolution_px());
        let other = Fisheye { focal_px, center_px, distortion: [0.0; 4], resolution_px, max_view_angle_rad: 1.5 };
        scene.cameras = vec![other.into()];
        match checked(&scene, MapMode::Unknown) {
            Err(refused) => assert_eq!(refused.code(), Code::InputLensModel, "seed {seed}: {refused}"),
            Ok(map) => assert!(map.lens_errors.is_some() && map.noise_scale < 1.5, "seed {seed}: {:?}", map.warnings),
        }
        let [fx, fy, cx, cy, a, b, c, d] = pinhole().intrinsics();
        scene.cameras = vec![pinhole().with_intrinsics([2.0 * fx, 2.0 * fy, 2.0 * cx, 2.0 * cy, a, b, c, d])];
        let refused = checked(&scene, MapMode::Unknown).map(|_| ()).unwrap_err();
        assert_eq!(refused.code(), Code::InputImageSize, "seed {seed}: {refused}");
    }
}

#[test]
fn known_places_that_are_read_otherwise_are_refused_by_their_cause() {
    let swapped = |pose: &Isometry3<f64>| {
        let [x, y, z, w] = [pose.rotation.i, pose.rotation.j, pose.rotation.k, pose.rotation.w];
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(x, y, z, w));
        Isometry3::from_parts(pose.translation, turn)
    };
    let turned = |pose: &Isometry3<f64>| pose * UnitQuaternion::from_scaled_axis(Vector3::x() * (2.0 * FRAC_PI_2));
    let scaled = |by: f64| {
        move |pose: &Isometry3<f64>| Isometry3::from_parts((pose.translation.vector * by).into(), pose.rotation)
    };
    for seed in SEEDS {
        let code = |written: &dyn Fn(&Isometry3<f64>) -> Isometry3<f64>, mode| {
            checked(&surveyed(scene(fisheye(), seed), written), mode).map(|_| ()).unwrap_err().code()
        };
        for mode in [MapMode::Unknown, MapMode::PartlyKnown, MapMode::Known] {
            assert_eq!(code(&swapped, mode), Code::InputOrder, "seed {seed}, {mode:?}");
            assert_eq!(code(&turned, mode), Code::InputTagFrames, "seed {seed}, {mode:?}");
            assert_eq!(code(&scaled(1e3), mode), Code::InputMapUnit, "seed {seed}, {mode:?}");
            assert_eq!(code(&scaled(0.8), mode), Code::InputTagSize, "seed {seed}, {mode:?}");
        }
    }
}

/// Outdated places that do not have another reading are no reason to refuse a map that does not use them.
#[test]
fn old_places_do_not_refuse_a_new_map() {
    for seed in SEEDS {
        let mut scene = surveyed(scene(fisheye(), seed), |pose| *pose);
        let mut rng = stream_rng(seed, "old places");
        for prior in scene.priors.iter_mut().skip(1) {
            let off = Vector3::from_fn(|_, _| 0.3 * crate::tagmap::tests::fixture::normal(&mut rng));
            let turn = Vector3::from_fn(|_, _| crate::tagmap::tests::fixture::normal(&mut rng));
            prior.pose = prior.pose.map(|pose| Translation3::from(off) * pose * UnitQuaternion::from_scaled_axis(turn));
        }
        assert!(checked(&scene, MapMode::Unknown).is_ok(), "seed {seed}");
    }
}

#[test]
fn corners_of_a_mirror_are_told_before_anything_is_solved() {
    let mut scene = scene(fisheye(), 1);
    scene.views.iter_mut().flat_map(|view| &mut view.tags).for_each(|tag| tag.corners_px.reverse());
    let n = scene.views.iter().map(|view| view.tags.len()).sum();
    assert_eq!(checked(&scene, MapMode::Unknown).map(|_| ()).unwrap_err(), TagMapError::CornerOrder { n, of: n });
}

/// Makes the images from view `from` on again, with tag 3 after `change`.
fn changed(seed: u64, from: usize, change: impl Fn(f64, Isometry3<f64>) -> (f64, Isometry3<f64>)) -> Scene {
    let mut scene = scene(fisheye(), seed);
    let mut tags: Vec<_> = (0_u32..).zip(&scene.truth).map(|(id, pose)| (id, size_of(id), *pose)).collect();
    (tags[3].1, tags[3].2) = change(tags[3].1, tags[3].2);
    let mut rng = stream_rng(seed, "changed");
    for (view, at) in scene.views.iter_mut().zip(&scene.cameras_at).skip(from) {
        view.tags = look(&scene.cameras[0], at, &tags, NOISE_PX, &mut rng);
    }
    scene
}

fn found(scene: &Scene) -> Option<OddTag> {
    let blind = Blind::of(&scene.input(), &as_stated(MapMode::Unknown));
    odd_tag(&blind.solved(&scene.cameras).expect("a map"))
}

#[test]
fn a_tag_of_another_size_is_named_with_its_size() {
    for (factor, seed) in [0.98, 1.02].into_iter().flat_map(|factor| SEEDS.map(move |seed| (factor, seed))) {
        let scene = changed(seed, 0, |size_m, pose| (factor * size_m, pose));
        let odd = found(&scene).expect("an odd tag");
        let Oddity::Size(size) = odd.oddity else { panic!("seed {seed}: {odd:?}") };
        assert!(odd.id == 3 && (size / factor - 1.0).abs() < 0.01, "seed {seed}: {odd:?}");
        let map = checked(&scene, MapMode::Unknown).unwrap();
        let codes: Vec<Code> = map.warnings.iter().map(|warning| warning.code).collect();
        assert!(codes.contains(&Code::MapTagSize), "seed {seed}: {codes:?}");
    }
}

#[test]
fn a_tag_that_moves_meanwhile_is_named() {
    for seed in SEEDS {
        let scene = changed(seed, 15, |size_m, pose| (size_m, Translation3::new(0.0, 0.01, 0.005) * pose));
        let odd = found(&scene).expect("an odd tag");
        let Oddity::Moved { distance_m, .. } = odd.oddity else { panic!("seed {seed}: {odd:?}") };
        assert!(odd.id == 3 && (0.006..0.016).contains(&distance_m), "seed {seed}: {odd:?}");
        let map = checked(&scene, MapMode::Unknown).unwrap();
        let codes: Vec<Code> = map.warnings.iter().map(|warning| warning.code).collect();
        assert!(codes.contains(&Code::MapTagDisagrees), "seed {seed}: {codes:?}");
    }
}

/// Checks that the found size has the least sum of squares: maps with sizes 0.4 % off fit worse.
#[test]
fn a_size_found_is_the_one_that_fits_best() {
    for seed in SEEDS {
        let scene = changed(seed, 0, |size_m, pose| (1.015 * size_m, pose));
        let odd = found(&scene).expect("an odd tag");
        let Oddity::Size(size) = odd.oddity else { panic!("seed {seed}: {odd:?}") };
        let chi_square = |factor: f64| {
            let mut resized = changed(seed, 0, |size_m, pose| (1.015 * size_m, pose));
            resized.priors[3].size_m *= factor;
            crate::tagmap::solve(&resized.input(), &settings()).unwrap().chi_square
        };
        let [below, at, above] = [0.996, 1.0, 1.004].map(|by| chi_square(by * size));
        assert!(at < below && at < above, "seed {seed}: {below} {at} {above}");
    }
}

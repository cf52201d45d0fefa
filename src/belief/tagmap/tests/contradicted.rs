//! Sizes and ids that contradict any map are named, and such a map is not accepted.

use crate::say::map_refusal::{MapRefusalCause, WrongSizes};
use crate::tagmap::blind::Blind;
use crate::tagmap::lost_anchor::wrong_sizes;
use crate::tagmap::tests::fixture::{Scene, fisheye, settings, wall};
use crate::tagmap::{TagMapError, checked_map, solve};
use armcal_core::codes::{Code, Coded};

const SEEDS: std::ops::Range<u64> = 60..64;
/// Ratio of stated to true size.
const STATED: f64 = 2.0;

fn with_sizes(seed: u64, is_wrong: impl Fn(u32) -> bool) -> Scene {
    let mut scene = wall(fisheye(), 8, 30, 0.3, seed);
    scene.priors.iter_mut().filter(|prior| is_wrong(prior.id)).for_each(|prior| prior.size_m *= STATED);
    scene
}

fn sizes_found(scene: &Scene, known: &[u32]) -> Option<WrongSizes> {
    let blind = Blind::of(&scene.input(), &settings());
    wrong_sizes(&scene.input(), &blind.solved(&scene.cameras).expect("a map"), known)
}

#[test]
fn groups_of_other_sizes_in_common_images_are_no_sound_map() {
    for seed in SEEDS {
        let map = solve(&with_sizes(seed, |id| id % 2 == 1).input(), &settings()).unwrap();
        assert!(map.is_contradicted, "seed {seed}: {:?}", map.groups);
        assert!(map.warnings.iter().any(|warning| warning.code == Code::MapTagDisagrees), "seed {seed}");
    }
}

#[test]
fn a_base_tag_of_another_size_refuses_the_map_with_its_factor() {
    for seed in SEEDS {
        let scene = with_sizes(seed, |id| id == 0);
        let found = sizes_found(&scene, &[0]).expect("a size");
        assert_eq!(found.tag, Some(0), "seed {seed}");
        assert!((found.factor * STATED - 1.0).abs() < 0.03, "seed {seed}: {found:?}");
        let refused = checked_map(&scene.input(), &settings()).map(|_| ()).unwrap_err();
        assert_eq!(refused.code(), Code::InputTagSize, "seed {seed}: {refused}");
        let TagMapError::Refused(refused) = refused else { panic!("{refused}") };
        assert!(matches!(refused.cause, MapRefusalCause::AnchorLost { .. }), "seed {seed}: {refused}");
    }
}

#[test]
fn two_known_tags_tell_the_size_of_all() {
    for seed in SEEDS {
        let mut scene = with_sizes(seed, |_| true);
        scene.priors[7].pose = Some(scene.truth[7]);
        let found = sizes_found(&scene, &[0, 7]).expect("a size");
        assert_eq!(found.tag, None, "seed {seed}");
        assert!((found.factor * STATED - 1.0).abs() < 0.03, "seed {seed}: {found:?}");
        let mut right = with_sizes(seed, |_| false);
        right.priors[7].pose = Some(right.truth[7]);
        assert_eq!(sizes_found(&right, &[0, 7]), None, "seed {seed}");
    }
}

#[test]
fn an_id_on_two_tags_is_no_sound_map() {
    for seed in SEEDS {
        let mut scene = wall(fisheye(), 8, 30, 0.3, seed);
        let all = scene.views.iter_mut().flat_map(|view| &mut view.tags);
        all.filter(|tag| tag.id == 4).for_each(|tag| tag.id = 3);
        assert!(solve(&scene.input(), &settings()).unwrap().is_contradicted, "seed {seed}");
    }
}

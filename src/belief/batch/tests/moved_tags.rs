//! A displaced tag is found, named and measured; correct surveys and wrong links are not blamed on tags.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::batch::tests::arms::{Built, arm};
use crate::batch::tests::data::titan;
use crate::batch::tests::failures::{Case, case};
use crate::batch::tests::score_test::{input, views_of_changed};
use crate::explain::drawing::Drawing;
use crate::explain::tags::freed::MovedTags;
use crate::explain::tags::identity::TagFault;
use crate::say::finding::{Finding, FindingKind};
use crate::solve::estimate::estimate;
use armcal_core::codes::{Code, Coded};
use armcal_core::robot::Robot;
use armcal_core::spatial::Pose;

#[test]
fn a_tag_that_was_knocked_aside_is_named() {
    let robot = titan();
    for moved_m in [0.015, 0.04] {
        let (mut named, mut sizes, mut all) = (0, Vec::new(), 0);
        for seed in 0..16 {
            let tag_idx = seed as usize % robot.tags.len();
            let aside = Vector3::ith(seed as usize % 3, moved_m);
            let (views, model) = views_of_changed(&robot, &robot, seed, |truth| {
                truth.tags[tag_idx] = Isometry3::translation(aside.x, aside.y, aside.z) * truth.tags[tag_idx];
            });
            let n_seen = views.iter().filter(|view| view.tags.iter().any(|tag| tag.tag_idx == tag_idx)).count();
            if n_seen < 5 {
                continue;
            }
            all += 1;
            let found = estimate(&input(&robot, &views, &model)).expect("solved");
            if let Some(moved) = found.moved_tag().filter(|moved| moved.tag_idx == tag_idx) {
                named += 1;
                sizes.push(moved.shift_m / moved_m);
            }
        }
        sizes.sort_by(f64::total_cmp);
        println!("{moved_m} m: named in {named} of {all}, sizes {sizes:.2?}");
        assert!(all >= 8 && named * 10 >= all * 9, "{moved_m} m: named in {named} of {all}");
    }
}

#[test]
fn a_good_survey_and_a_wrong_link_are_left_alone() {
    let robot = titan();
    let mut suspected = [0, 0];
    const SEEDS: u64 = 40;
    for seed in 0..SEEDS {
        suspected[0] += u64::from(arm(Built::AsDrawn, seed).found.moved_tag().is_some());
        let joint = 1 + seed as usize % (robot.n_seen_joints() - 1);
        suspected[1] += u64::from(arm(Built::Longer(joint), seed).found.moved_tag().is_some());
    }
    println!("tags suspected: {} of {SEEDS} good arms, {} with a wrong link", suspected[0], suspected[1]);
    assert!(suspected[0] == 0 && suspected[1] <= 2, "{suspected:?} of {SEEDS}");
}

/// Moved tags, tags that the model moved together, and the number of displaced tags in the first estimate.
fn moved_together(seed: u64, moved_m: f64, n: usize) -> (Vec<usize>, Vec<usize>, usize) {
    let robot = titan();
    let n_tags = robot.tags.len();
    let mut moved: Vec<usize> = (0..n).map(|k| (seed as usize + k) % n_tags).collect();
    moved.sort_unstable();
    let aside = Vector3::new(0.6, if seed.is_multiple_of(2) { 0.8 } else { -0.8 }, 0.0) * moved_m;
    let (views, model) = views_of_changed(&robot, &robot, seed, |truth| {
        for &tag in &moved {
            truth.tags[tag] = Isometry3::translation(aside.x, aside.y, aside.z) * truth.tags[tag];
        }
    });
    let input = input(&robot, &views, &model);
    let found = estimate(&input).expect("solved");
    let drawing = Drawing::default().better(&input, &found, 0.0).unwrap_or_default();
    let mut named: Vec<usize> = drawing.tags.iter().filter_map(TagFault::moved_tag).collect();
    named.sort_unstable();
    (moved, named, found.departed_tags().len())
}

#[test]
fn tags_that_were_moved_together_are_named() {
    groups_are_named(4, &[(0.01, 2), (0.04, 3)]);
}

#[test]
#[ignore = "second tier: 16 seeds of three kinds, 17 s"]
fn tags_that_were_moved_together_are_named_over_16_seeds() {
    groups_are_named(16, &[(0.01, 2), (0.01, 3), (0.04, 3)]);
}

/// Checks groups of tags; `kinds` has the displacement, m, and the number of tags.
fn groups_are_named(n_seeds: u64, kinds: &[(f64, usize)]) {
    for &(moved_m, n) in kinds {
        // Where no tag departs, base and joints absorb the whole motion.
        let seen: Vec<bool> = (0..n_seeds)
            .map(|seed| moved_together(seed, moved_m, n))
            .filter_map(|(moved, named, n_departed)| (n_departed > 1).then_some(moved == named))
            .collect();
        let named = seen.iter().filter(|is_named| **is_named).count();
        println!("{n} tags by {moved_m} m: named in {named} of {}", seen.len());
        assert!(
            seen.len() >= n_seeds as usize / 2 && named * 10 >= seen.len() * 9,
            "{n} tags by {moved_m} m: {named} of {}",
            seen.len()
        );
    }
}

/// Three of eight tags, where no single tag is suspect or a displaced base explains them nearly as well.
#[test]
fn three_tags_a_little_aside_are_named_and_not_the_base() {
    let named: Vec<bool> = (0..16)
        .map(|seed| moved_together(seed, 0.006, 3))
        .map(|(moved, named, n_departed)| {
            println!("{moved:?} {named:?} {n_departed}");
            moved == named
        })
        .collect();
    let n = named.iter().filter(|is_named| **is_named).count();
    println!("named in {n} of {}", named.len());
    assert!(n >= 13, "{n} of {}", named.len());
}

/// The tag is displaced so far that the estimate rejects all its observations.
#[test]
fn a_tag_that_is_rejected_altogether_is_freed_where_the_observations_have_it() {
    let robot = titan();
    let (mut n_rejected, mut n_freed, mut worst_m) = (0, 0, 0.0_f64);
    for seed in 0..16 {
        let tag_idx = seed as usize % robot.tags.len();
        let aside = Vector3::ith(seed as usize % 3, 0.15);
        let (views, model) = views_of_changed(&robot, &robot, seed, |truth| {
            truth.tags[tag_idx] = Isometry3::translation(aside.x, aside.y, aside.z) * truth.tags[tag_idx];
        });
        let found = estimate(&input(&robot, &views, &model)).expect("solved");
        if found.moved_tag().is_some()
            || views.iter().filter(|v| v.tags.iter().any(|t| t.tag_idx == tag_idx)).count() < 5
        {
            continue;
        }
        n_rejected += 1;
        let (mut moved, mut freed) = (MovedTags::new(&robot), robot.clone());
        if moved.revise(&found, &views, &mut freed) {
            n_freed += 1;
            let by = |robot: &Robot| robot.tags[tag_idx].base_from_tag.isometry().translation.vector;
            worst_m = worst_m.max((by(&freed) - by(&robot) - aside).norm());
        }
    }
    println!("freed {n_freed} of {n_rejected}, at most {:.1} mm from its place", 1e3 * worst_m);
    assert!(n_rejected >= 5 && n_freed == n_rejected && worst_m < 0.02, "{n_freed} of {n_rejected}, {worst_m} m");
}

/// The tag is turned in place, so that it is not displaced: it is rejected, and the result reports it.
#[test]
fn a_tag_of_which_no_observation_fits_is_named() {
    let mut case = case(3, None);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * FRAC_PI_2);
    let tag = &mut case.robot.tags[1];
    tag.base_from_tag = Pose::from_isometry(tag.base_from_tag.isometry() * turn);
    let id = tag.id.to_string();
    let n_seen = case.views.iter().filter(|view| view.tags.iter().any(|tag| tag.tag_idx == 1)).count();
    let findings = case.calibrated().findings;
    let named: Vec<&Finding> = findings.iter().filter(|found| found.kind == FindingKind::TagLeftOut).collect();
    let [left_out] = named[..] else { panic!("{findings:?}") };
    assert_eq!((&left_out.name, left_out.size), (&id, Some(n_seen as f64)));
}

#[test]
fn a_size_is_repaired_up_to_twice_the_stated_one() {
    for (factor, is_repaired) in [(1.25, true), (0.6, true), (3.0, false), (0.3, false)] {
        let mut case = case(4, None);
        let n_seen =
            |idx: &usize| case.views.iter().flat_map(|view| &view.tags).filter(|tag| tag.tag_idx == *idx).count();
        let most = (0..case.robot.tags.len()).max_by_key(n_seen).expect("tags");
        case.robot.tags[most].size_m *= factor;
        case.views.iter_mut().for_each(|view| view.see_through(&case.robot));
        let calibration = case.calibrated();
        let is_named = calibration.findings.iter().any(|found| found.kind == FindingKind::TagSize);
        let is_refused = calibration.refusals.iter().any(|refusal| refusal.code() == Code::RepairTooLarge);
        assert_eq!((is_named, is_refused), (true, !is_repaired), "{factor}: {:?}", calibration.findings);
    }
}

/// The size error is too small for a rejection, and the tag is seen from so many sides that it keeps its place. No tag
/// of a correct arm is named.
#[test]
fn a_size_that_is_off_by_little_is_named_with_its_tag() {
    let mut n_named = 0;
    for seed in 0..6 {
        let sound = case(seed, None);
        let n_seen =
            |idx: &usize| sound.views.iter().flat_map(|view| &view.tags).filter(|tag| tag.tag_idx == *idx).count();
        let most = (0..sound.robot.tags.len()).max_by_key(n_seen).expect("tags");
        let id = sound.robot.tags[most].id.to_string();
        let sizes = |mut case: Case, factor: f64| -> Vec<Finding> {
            case.robot.tags[most].size_m *= factor;
            case.views.iter_mut().for_each(|view| view.see_through(&case.robot));
            let findings = case.calibrated().findings;
            findings.into_iter().filter(|found| found.kind == FindingKind::TagSize).collect()
        };
        let named = sizes(case(seed, None), 1.025);
        assert!(named.iter().all(|found| found.name == id), "seed {seed}: {named:?}");
        n_named += named.len();
        assert_eq!(sizes(sound, 1.0), Vec::new(), "seed {seed}: as it is");
    }
    assert!(n_named >= 3, "{n_named} of 6");
}

#[test]
fn tags_with_exchanged_ids_are_no_group() {
    let robot = titan();
    let n_tags = robot.tags.len();
    let (mut named, mut all) = (0, 0);
    for seed in 0..8 {
        let pair = [seed as usize % n_tags, (seed as usize + 1) % n_tags];
        let (views, model) = views_of_changed(&robot, &robot, seed, |truth| truth.tags.swap(pair[0], pair[1]));
        let input = input(&robot, &views, &model);
        let found = estimate(&input).expect("solved");
        let drawing = Drawing::default().better(&input, &found, 0.0).unwrap_or_default();
        let sorted = [pair[0].min(pair[1]), pair[0].max(pair[1])];
        named += usize::from(drawing.tags == [TagFault::Swapped(sorted)]);
        all += 1;
    }
    println!("exchanged: named in {named} of {all}");
    assert!(named * 8 >= all * 7, "{named} of {all}");
}

/// The revised survey names ids of three to five of eight tags, exchanged in a ring.
#[test]
fn ids_exchanged_in_a_ring_are_named() {
    let robot = titan();
    let (mut named, mut all) = (0, 0);
    for seed in 0..9 {
        let n = 3 + seed as usize % 3;
        // Each tag is at the surveyed place of the one before it.
        let ring: Vec<usize> = (0..n).map(|k| (seed as usize + k) % robot.tags.len()).collect();
        let (views, model) = views_of_changed(&robot, &robot, seed, |truth| {
            let places = ring.clone().into_iter().map(|tag| truth.tags[tag]).collect::<Vec<_>>();
            (0..n).for_each(|k| truth.tags[ring[(k + 1) % n]] = places[k]);
        });
        let (mut survey, mut moved, mut drawing) = (robot.clone(), MovedTags::new(&robot), Drawing::default());
        let rings = loop {
            let mut input = input(&survey, &views, &model);
            drawing.apply(&mut input);
            let found = estimate(&input).expect("solved");
            let mut revised = survey.clone();
            if let Some(better) = drawing.better(&input, &found, 0.0) {
                drawing.apply_new_faults(&better, &mut revised);
                moved.resurveyed(&mut revised, &better);
                drawing = better;
            } else if !moved.revise(&found, &views, &mut revised) {
                break moved.rings(&found);
            }
            survey = revised;
        };
        let mut expected: Vec<usize> = ring.iter().rev().copied().collect();
        let first = expected.iter().position(|tag| Some(tag) == ring.iter().min()).unwrap_or(0);
        expected.rotate_left(first);
        println!("seed {seed}: {expected:?}, named {rings:?}");
        named += usize::from(rings == [expected]);
        all += 1;
    }
    println!("rings: named in {named} of {all}");
    assert!(named * 9 >= all * 8, "{named} of {all}");
}

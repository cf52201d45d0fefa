//! A tag that was knocked aside is found, named and measured; good surveys and wrong links are left to others.

use nalgebra::{Isometry3, Vector3};

use crate::calib::bundle::estimate::estimate;
use crate::calib::bundle::tests::data::titan;
use crate::calib::bundle::tests::score_test::{input, views_of, views_of_changed, with_link};

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
        let (views, model) = views_of(&robot, &robot, seed);
        let found = estimate(&input(&robot, &views, &model)).expect("solved");
        suspected[0] += u64::from(found.moved_tag().is_some());
        let joint = 1 + seed as usize % (robot.camera.mount.n_joints - 1);
        let (views, model) = views_of(&robot, &with_link(&robot, joint, 0.01, Vector3::zeros()), seed);
        let found = estimate(&input(&robot, &views, &model)).expect("solved");
        suspected[1] += u64::from(found.moved_tag().is_some());
    }
    println!("tags suspected: {} of {SEEDS} good arms, {} with a wrong link", suspected[0], suspected[1]);
    assert!(suspected[0] == 0 && suspected[1] <= 2, "{suspected:?} of {SEEDS}");
}

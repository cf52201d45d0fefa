//! Camera, base or tags that moved while the views were captured: only they are named, with the gap.

use nalgebra::{Isometry3, Vector6};

use crate::batch::tests::data::{Noise, Truth, rng, titan, views, watched_titan};
use crate::batch::tests::failures::calibrated;
use crate::batch::tests::statistics;
use crate::model::scales::Hyperparameters;
use crate::say::moved_body::MovedBody;
use crate::say::refusal::Refusal;
use crate::views::view::View;
use armcal_core::robot::Robot;
use armcal_core::spatial::exp;

const N_VIEWS: usize = 32;

/// Views of an arm that `happens` changes before the view of that index.
fn views_until(robot: &Robot, seed: u64, at: usize, happens: impl Fn(&mut Truth)) -> Vec<View> {
    let mut truth = statistics::case(robot, seed, 10).truth;
    let noise = Noise { corner_px: 0.3, n_frames: 5, joint_rad: Hyperparameters::datasheet(robot).joint_std_rad };
    let mut rng = rng(seed, "moved between");
    let before = views(robot, &truth, &noise, N_VIEWS, &mut rng);
    happens(&mut truth);
    let after = views(robot, &truth, &noise, N_VIEWS, &mut rng);
    before.into_iter().take(at).chain(after.into_iter().skip(at)).collect()
}

fn knock(scale: f64) -> Isometry3<f64> {
    exp(&(Vector6::new(0.02, -0.01, 0.015, 0.03, -0.04, 0.035) * scale))
}

/// Refusals of these views.
fn refusals(robot: &Robot, views: Vec<View>) -> Vec<Refusal> {
    calibrated(robot.clone(), views).refusals
}

fn assert_named(seed: u64, refusals: &[Refusal], expected: MovedBody, at: usize, [least_m, most_m]: [f64; 2]) {
    let Some(Refusal::MovedBetweenViews { body, views, shift_m, .. }) = refusals.first() else {
        panic!("seed {seed}, {expected:?} before view index {at}: {refusals:?}")
    };
    assert_eq!(*body, expected, "seed {seed}");
    // Views are numbered from 1.
    assert_eq!(*views, [at as u32, at as u32 + 1], "seed {seed}");
    assert!((least_m..most_m).contains(shift_m), "seed {seed}: {shift_m}");
}

/// The camera moves by 27 mm and 61 mrad, early, in the middle and late.
#[test]
fn a_camera_that_moves_on_its_mount_is_named_with_the_gap() {
    let robot = titan();
    for (seed, at) in [(0, 16), (1, 9), (2, 23)] {
        let views = views_until(&robot, seed, at, |truth| truth.mount *= knock(1.0));
        assert_named(seed, &refusals(&robot, views), MovedBody::Camera, at, [0.02, 0.034]);
    }
}

#[test]
fn a_standing_camera_that_moves_is_named() {
    let robot = watched_titan();
    for (seed, at) in [(3, 16), (4, 20)] {
        let views = views_until(&robot, seed, at, |truth| truth.mount *= knock(1.0));
        assert_named(seed, &refusals(&robot, views), MovedBody::StandingCamera, at, [0.02, 0.034]);
    }
}

/// All tags move alike in the base's frame.
#[test]
fn a_base_that_moves_is_named_and_the_camera_is_not() {
    let robot = titan();
    for (seed, at) in [(5, 16), (6, 12)] {
        let views =
            views_until(&robot, seed, at, |truth| truth.tags.iter_mut().for_each(|tag| *tag = knock(1.0) * *tag));
        assert_named(seed, &refusals(&robot, views), MovedBody::BaseOrTags, at, [0.01, 0.05]);
    }
}

/// Faults that resemble a motion: none at all, a slip, one displaced tag.
#[test]
fn nothing_else_is_called_a_motion() {
    for seed in 10..14 {
        let robot = if seed % 2 == 0 { titan() } else { watched_titan() };
        let joint = (seed % 5) as usize;
        let cases: [&dyn Fn(&mut Truth); 3] =
            [&|_| {}, &|truth| truth.parameters.offset_rad[joint] += 0.02, &|truth| {
                truth.tags[0] = knock(1.0) * truth.tags[0]
            }];
        for (k, happens) in cases.into_iter().enumerate() {
            let refusals = refusals(&robot, views_until(&robot, seed, 16, happens));
            let is_motion = |refusal: &Refusal| matches!(refusal, Refusal::MovedBetweenViews { .. });
            assert!(!refusals.iter().any(is_motion), "seed {seed}, case {k}: {refusals:?}");
        }
    }
}

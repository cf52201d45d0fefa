//! Images that stand still, and events that no fault of the arm explains.

use crate::batch::tests::data::titan;
use crate::follow::doubts::Doubts;
use crate::follow::estimator::OnlineEstimator;
use crate::follow::event::OnlineEvent;
use crate::follow::follower::Follower;
use crate::follow::settings::OnlineSettings;
use crate::follow::tests::drifting::Dive;
use crate::say::finding::{Finding, FindingKind};
use crate::views::view::View;
use armcal_core::codes::{Code, Coded};

const REACH_M: f64 = 2.0;

/// Views that repeat an earlier image are left out and raise a doubt; a new image ends it.
#[test]
fn views_of_a_frozen_stream_do_not_count() {
    let robot = titan();
    for seed in 0..3 {
        let mut dive = Dive::new(&robot, seed);
        let mut follower = Follower::new(robot.clone(), OnlineSettings::default());
        let mut clock = OnlineEstimator::new(robot.clone(), OnlineSettings::default());
        let mut at_s = 0.0;
        let mut next = || {
            at_s += 12.0;
            dive.advance(&mut clock, at_s);
            dive.view()
        };
        let first: Vec<View> = (0..10).map(|_| next()).collect();
        let tags = first[9].tags.clone();
        follower.add(first);
        assert_eq!((follower.estimator().n_views(), follower.doubt()), (10, None), "seed {seed}");
        for n_frozen in 1..=4 {
            let mut frozen = next();
            frozen.tags.clone_from(&tags);
            follower.add(vec![frozen]);
            assert_eq!(follower.estimator().n_views(), 10, "seed {seed}");
            let code = follower.doubt().map(|doubt| doubt.code());
            assert_eq!(code, (n_frozen >= 3).then_some(Code::ImagesFrozen), "seed {seed}: {n_frozen}");
        }
        assert_eq!(follower.is_good_enough(), Some(false), "seed {seed}");
        assert_eq!(follower.belief().and_then(|row| row.doubt), Some(Code::ImagesFrozen), "seed {seed}");
        follower.add(vec![next()]);
        assert_eq!((follower.estimator().n_views(), follower.doubt()), (11, None), "seed {seed}");
    }
}

/// An arm that stands still before a noise-free image shows the same again, and that is no fault.
#[test]
fn the_same_image_at_the_same_place_counts() {
    let robot = titan();
    let view = Dive::new(&robot, 7).view();
    let mut doubts = Doubts::default();
    let n_repeated = (0..5).filter(|_| doubts.repeats_image(&view, &robot)).count();
    assert_eq!((n_repeated, doubts.now()), (0, None));
}

/// The doubt after events at these numbers of views: kind, name and size in m or rad.
fn doubt(events: &[(usize, FindingKind, &str, f64)]) -> Option<Code> {
    let mut doubts = Doubts::default();
    for &(n_views, kind, name, size) in events {
        let finding = Finding {
            kind,
            name: name.to_owned(),
            size: Some(size),
            unit: None,
            tool_error_m: None,
            time_s: None,
            repaired: true,
        };
        let (nanos, lead_nats) = (n_views as i64, 9.0);
        let event =
            OnlineEvent { since_nanos: nanos, decided_nanos: nanos, finding, at_rad: None, lead_nats, or_else: None };
        doubts.hear(&[event], n_views, REACH_M);
    }
    doubts.now().map(|doubt| doubt.code())
}

#[test]
fn a_base_that_moves_far_or_on_is_doubted() {
    use FindingKind::Base;
    assert_eq!(doubt(&[(25, Base, "base", 0.012)]), None);
    assert_eq!(doubt(&[(25, Base, "base", 0.012), (90, Base, "base", 0.02)]), None);
    assert_eq!(doubt(&[(25, Base, "base", 0.65)]), Some(Code::BaseDoubtful));
    assert_eq!(doubt(&[(25, Base, "base", 0.05), (29, Base, "base", 0.08)]), Some(Code::BaseDoubtful));
}

#[test]
fn what_moves_again_and_again_is_a_lens_and_what_moves_once_is_not() {
    use FindingKind::{CameraMount, TagMoved, TagsMoved};
    let mount = |n_views| (n_views, CameraMount, "camera mount", 0.008);
    let tags = |n_views, names| (n_views, TagsMoved, names, 0.006);
    let lens = [mount(28), tags(29, "20, 22, 23 and 24"), mount(33), tags(36, "15, 22 and 25")];
    assert_eq!(doubt(&lens), Some(Code::LensChanged));
    assert_eq!(doubt(&lens[..3]), None);
    // A moved base may be reported in three parts.
    assert_eq!(doubt(&[tags(27, "11, 12 and 13"), tags(28, "15 and 19"), tags(29, "23, 24 and 25")]), None);
    assert_eq!(doubt(&[mount(28), mount(33)]), None);
    // A loose tag.
    let loose = |n_views| (n_views, TagMoved, "5", 0.02);
    assert_eq!(doubt(&[loose(26), loose(29), loose(33), loose(36)]), None);
    // The three parts are spread over a long dive.
    assert_eq!(doubt(&[mount(28), mount(80), mount(150), mount(220)]), None);
}

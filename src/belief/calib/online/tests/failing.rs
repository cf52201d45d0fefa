//! Sensors that say something wrong now and then, joints without one, and what happens while something else is looked
//! into.

use crate::calib::bundle::tests::data::titan;
use crate::calib::finding::FindingKind;
use crate::calib::online::event::OnlineEvent;
use crate::calib::online::tests::faults::{Happens, after_an_hour};
use crate::calib::views::view::View;

fn lines(events: &[OnlineEvent]) -> Vec<String> {
    events.iter().map(OnlineEvent::to_line).collect()
}

/// Views in which a sensor is right say nothing against that it fails in others: it is named, and nothing else is.
#[test]
fn a_sensor_that_fails_now_and_then_is_named() {
    let robot = titan();
    let mut missed = Vec::new();
    for seed in 0..10 {
        let joint = seed as usize % 5;
        let (mut online, mut dive) = after_an_hour(&robot, seed, Happens::Nothing);
        online.take_events();
        for k in 0..12 {
            let mut view = dive.view();
            if k % 4 == 0 {
                view.travel_rad[joint] = -1.2;
            }
            online.add_view(&view);
        }
        let events = online.take_events();
        let is_right = |event: &OnlineEvent| {
            event.finding.kind == FindingKind::SensorFailed && event.finding.name == robot.sensors[joint].joint
        };
        if events.len() != 1 || !is_right(&events[0]) {
            missed.push((seed, joint, lines(&events)));
        }
    }
    assert!(missed.len() <= 1, "{missed:?}");
}

/// A joint whose sensor is left out stands where the tags show it, however far from there its reading is: no tag, no
/// camera and no other sensor is blamed.
#[test]
fn a_reading_that_is_left_out_may_be_anything() {
    let robot = titan();
    let mut told = Vec::new();
    for seed in 0..5 {
        let joint = seed as usize;
        let (mut online, mut dive) = after_an_hour(&robot, seed, Happens::Nothing);
        online.take_events();
        online.leave_out(joint);
        for k in 0..12 {
            let mut view = dive.view();
            view.travel_rad[joint] = [-1.5, 0.0, 1.5][k % 3];
            online.add_view(&view);
        }
        told.extend(lines(&online.take_events()).into_iter().map(|line| (joint, line)));
    }
    assert_eq!(told, []);
}

/// A sensor slips while a view of a misread tag is looked into: it is named.
#[test]
fn a_slip_is_named_while_another_view_is_looked_into() {
    let robot = titan();
    let mut missed = Vec::new();
    const SEEDS: u64 = 10;
    for seed in 0..SEEDS {
        let joint = seed as usize % 4;
        let (mut online, mut dive) = after_an_hour(&robot, seed, Happens::Nothing);
        online.take_events();
        let sees = |view: &View| view.tags.len() > 4;
        let mut view = std::iter::repeat_with(|| dive.view()).find(sees).expect("it ends");
        let other = view.tags[1].tag_idx;
        view.tags.remove(1);
        view.tags[0].tag_idx = other;
        online.add_view(&view);
        dive.befall(|_, at_start| at_start[joint] += 0.025);
        (0..5).for_each(|_| _ = online.add_view(&dive.view()));
        let events = online.take_events();
        let is_right = |event: &OnlineEvent| {
            event.finding.kind == FindingKind::SensorSlip && event.finding.name == robot.sensors[joint].joint
        };
        if events.len() != 1 || !is_right(&events[0]) {
            missed.push((seed, joint, lines(&events)));
        }
    }
    assert!(missed.len() <= 1, "{missed:?}");
}

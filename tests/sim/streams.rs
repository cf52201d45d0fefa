//! The messages' order, rates and repeatability.

use armcal::sim::WorldSpec;
use armcal::streams::{Arm, Message};
use armcal::time::Stamp;

use super::{Site, Tape, Witness};

fn ten_seconds(seed: u64) -> Tape {
    let site = Site::titan();
    let mut world = site.world(WorldSpec::default(), seed);
    let mut tape = Tape::default();
    let target: Vec<f64> = site.robot.stowed.iter().map(|a| a - 0.1).collect();
    world.command(&site.nominal_counts(&target)).expect("accepted");
    tape.run(&mut world, 10.0);
    tape
}

#[test]
fn one_seed_gives_one_stream() {
    let (first, second, other) = (ten_seconds(1), ten_seconds(1), ten_seconds(2));
    assert!(first.messages == second.messages);
    assert!(first.messages != other.messages);
}

#[test]
fn watching_the_truth_changes_nothing() {
    let site = Site::titan();
    let mut plain = Tape::default();
    plain.run(&mut site.world(WorldSpec::default(), 7), 3.0);
    let mut world = site.world(WorldSpec::default(), 7);
    world.set_truth_sink(Box::new(Witness::default())).expect("accepted");
    let mut watched = Tape::default();
    watched.run(&mut world, 3.0);
    assert!(plain.messages == watched.messages);
}

#[test]
fn log_times_never_go_back_and_rates_are_as_documented() {
    let tape = ten_seconds(3);
    assert!(tape.messages.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    let count = |f: fn(&Message) -> bool| tape.messages.iter().filter(|(_, m)| f(m)).count();
    assert_eq!(count(|m| matches!(m, Message::JointSensors(_))), 1000);
    assert_eq!(count(|m| matches!(m, Message::Attitude(_))), 200);
    assert_eq!(count(|m| matches!(m, Message::Temperature(_))), 20);
    assert_eq!(count(|m| matches!(m, Message::Pressure(_))), 10);
    let images = count(|m| matches!(m, Message::Detections(_)));
    assert!((49..=50).contains(&images), "{images}: the last may still be under way");
    assert_eq!(count(|m| matches!(m, Message::JointStates(_) | Message::JointCommand(_) | Message::Mark(_))), 0);
}

#[test]
fn joint_readings_are_whole_counts_of_sixteen_bits() {
    for (_, message) in &ten_seconds(4).messages {
        if let Message::JointSensors(sample) = message {
            assert!(sample.counts.iter().all(|c| c.fract() == 0.0 && (0.0..65536.0).contains(c)));
        }
    }
}

/// The joint sensors' clock advances in whole periods.
#[test]
fn now_is_the_stamp_of_the_last_reading() {
    let site = Site::titan();
    let mut world = site.world(WorldSpec::default(), 1);
    let start = world.now();
    let mut tape = Tape::default();
    tape.run(&mut world, 1.0);
    let last: Option<Stamp> = tape.messages.iter().rev().find_map(|(_, m)| match m {
        Message::JointSensors(sample) => Some(sample.stamp),
        _ => None,
    });
    assert_eq!(last, Some(world.now()));
    assert_eq!(world.now(), start.plus_s(1.0));
}

/// Simulated seconds per second, for information; this does not test the machine.
#[test]
fn speed_is_reported() {
    let site = Site::titan();
    let mut world = site.world(WorldSpec::default(), 1);
    let mut tape = Tape::default();
    let start = std::time::Instant::now();
    tape.run(&mut world, 20.0);
    eprintln!("{:.1} simulated s per s", 20.0 / start.elapsed().as_secs_f64());
}

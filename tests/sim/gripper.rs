//! The gripper's motion in its messages.

use armcal::sim::{World, WorldInput, WorldSpec};
use armcal::streams::{Arm, ArmError, Message};
use armcal::time::SIMULATION_EPOCH;

use super::{Site, Tape};

/// Reported times (s) and gaps (m).
fn gaps(tape: &Tape) -> Vec<(f64, f64)> {
    let gap = |message: &Message| match message {
        Message::Gripper(sample) => Some((sample.stamp.since_s(SIMULATION_EPOCH), sample.opening_m)),
        _ => None,
    };
    tape.messages.iter().filter_map(|(_, message)| gap(message)).collect()
}

#[test]
fn the_gap_follows_the_command_at_its_rate_and_is_told_on_the_way() {
    let site = Site::titan();
    let gripper = site.robot.gripper.clone().expect("a gripper");
    let mut world = site.world(WorldSpec::default(), 1);
    let mut tape = Tape::default();
    tape.run(&mut world, 3.0);
    let at_rest = gaps(&tape);
    assert_eq!(at_rest.len(), 3, "once a second: {at_rest:?}");
    assert!(at_rest.iter().all(|(_, gap_m)| (gap_m - gripper.rest_opening_m).abs() < 1e-9));
    for (opening, expected_m) in [(1.0, gripper.opening_max_m), (0.0, 0.0), (0.5, 0.5 * gripper.opening_max_m)] {
        tape.messages.clear();
        world.grip(opening).expect("accepted");
        tape.run(&mut world, gripper.closing_time_s + 1.0);
        let told = gaps(&tape);
        let (first_m, last_m) = (told[0].1, told[told.len() - 1].1);
        assert!((last_m - expected_m).abs() < 2e-4, "{opening}: {told:?}");
        let way = (last_m - first_m).signum();
        let rate_m_s = gripper.opening_max_m / gripper.closing_time_s;
        for pair in told.windows(2) {
            let ((t0, a), (t1, b)) = (pair[0], pair[1]);
            assert!(t1 > t0 && way * (b - a) > -1e-9, "it turns back: {pair:?}");
            assert!((b - a).abs() <= rate_m_s * (t1 - t0) + 1.1e-4, "too fast for a rounded gap: {pair:?}");
        }
        // Messages come at 25 Hz during the motion of at least 0.022 m at 0.05 m/s.
        assert!(told.len() >= 12, "{}", told.len());
    }
    assert!(tape.messages.windows(2).all(|pair| pair[0].0 <= pair[1].0), "log times go back");
}

#[test]
fn jaws_told_before_a_wait_are_there_after_it() {
    let mut world = Site::titan().world(WorldSpec::default(), 1);
    let mut tape = Tape::default();
    world.grip(0.0).expect("accepted");
    world.idle(60.0, &mut tape).expect("it waits");
    assert!(gaps(&tape).last().expect("told").1.abs() < 1e-9);
}

/// The jaws draw no random number and exert no force: all other messages are the same, byte for byte.
#[test]
fn jaws_change_nothing_but_themselves() {
    let others = |grips: bool| {
        let mut world = Site::titan().world(WorldSpec::default(), 3);
        let mut tape = Tape::default();
        tape.run(&mut world, 1.0);
        if grips {
            world.grip(1.0).expect("accepted");
        }
        tape.run(&mut world, 4.0);
        tape.messages.retain(|(_, message)| !matches!(message, Message::Gripper(_)));
        tape.messages
    };
    assert!(others(true) == others(false));
}

#[test]
fn what_no_jaw_can_do_is_refused() {
    let mut world = Site::titan().world(WorldSpec::default(), 1);
    for opening in [-0.1, 1.1, f64::NAN] {
        assert!(matches!(world.grip(opening), Err(ArmError::Opening { .. })), "{opening}");
    }
    let Site { mut robot, vehicle, scene } = Site::titan();
    robot.gripper = None;
    let input = WorldInput { robot: &robot, vehicle: &vehicle, scene: &scene, spec: WorldSpec::default(), seed: 1 };
    let mut world = World::new(input).expect("a world");
    assert!(matches!(world.grip(0.5), Err(ArmError::NoGripper)));
    let mut tape = Tape::default();
    tape.run(&mut world, 2.0);
    assert!(gaps(&tape).is_empty());
}

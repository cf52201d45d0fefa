//! Changes of a world during a run: it waits, and components fail.

use armcal::sim::{Fault, WorldSpec};
use armcal::streams::{Arm, ArmError, Message};

use super::{Site, Tape, Witness};

fn spec(fault: Fault) -> WorldSpec {
    WorldSpec { fault: vec![fault.into()], ..WorldSpec::default() }
}

fn detections(tape: &Tape) -> Vec<usize> {
    let seen = |message: &Message| match message {
        Message::Detections(detections) => Some(detections.tags.len()),
        _ => None,
    };
    tape.messages.iter().filter_map(|(_, message)| seen(message)).collect()
}

#[test]
fn an_hour_at_rest_passes_with_temperatures_and_drift_and_the_arm_in_its_place() {
    let site = Site::titan();
    let mut spec = WorldSpec::default();
    spec.temperature.water_c = 25.0;
    spec.temperature.oil_start_c = 25.0;
    spec.temperature.water_change_k = -27.0;
    let mut squares = 0.0;
    let seeds = 6;
    for seed in 1..=seeds {
        let mut world = site.world(spec.clone(), seed);
        let witness = Witness::default();
        world.set_truth_sink(Box::new(witness.clone())).expect("accepted");
        let mut tape = Tape::default();
        tape.run(&mut world, 2.35);
        let start = world.now();
        world.idle(3600.0, &mut tape).expect("it waits");
        let passed_s = world.now().since_s(start);
        assert!((3600.0..3600.02).contains(&passed_s), "{passed_s}");
        assert!(tape.messages.windows(2).all(|pair| pair[0].0 <= pair[1].0), "log times go back");
        let states = witness.states.borrow();
        let (first, last) = (states[20], *states.last().expect("states"));
        assert!(last.water_c < 3.0 && last.oil_c < first.oil_c - 10.0, "{} {}", last.water_c, last.oil_c);
        // The controller holds its readings, so the joints only follow the effect of the cold on the sensors.
        for (joint, built) in witness.header.borrow().as_ref().expect("a header").as_built.joints.iter().enumerate() {
            let cold_k = last.oil_c - first.oil_c;
            let travel_rad = first.angles[joint] - built.center_rad;
            let cold_rad =
                built.temperature_offset_rad_per_k * cold_k + built.temperature_gain_per_k * cold_k * travel_rad;
            let moved_rad = last.angles[joint] - first.angles[joint];
            // The limit has twice the controller's rest band, the backlash of the shaft, and the walk of an hour, 0.02
            // deg one sigma.
            assert!((moved_rad + cold_rad).abs() < 0.0025, "seed {seed}, joint {joint}: {moved_rad} {cold_rad}");
            squares += (moved_rad + cold_rad).powi(2);
        }
    }
    let rms_rad = (squares / (6 * seeds) as f64).sqrt();
    assert!(rms_rad > 1e-4, "the sensors walk in an hour: {rms_rad}");
    assert!(rms_rad < 9e-4, "{rms_rad}");
}

#[test]
fn one_seed_waits_in_one_way() {
    let wait = || {
        let mut tape = Tape::default();
        Site::titan().world(WorldSpec::default(), 4).idle(61.7, &mut tape).expect("it waits");
        tape.messages
    };
    assert!(wait() == wait());
}

#[test]
fn a_stuck_sensor_keeps_its_word_while_the_arm_moves() {
    let site = Site::titan();
    let fault = Fault::SensorStuck { joint: "wrist_yaw".to_owned() };
    let mut world = site.world(spec(fault), 1);
    let mut tape = Tape::default();
    tape.run(&mut world, 1.0);
    world.fault(0).expect("it breaks");
    tape.messages.clear();
    tape.run(&mut world, 1.0);
    let words: Vec<f64> = tape
        .messages
        .iter()
        .filter_map(|(_, message)| match message {
            Message::JointSensors(sample) => Some(sample.counts[4]),
            _ => None,
        })
        .collect();
    assert!(words.len() > 90 && words.iter().all(|word| *word == words[0]));
}

#[test]
fn silt_hides_everything_for_its_time_and_a_lost_tag_stays_lost() {
    let site = Site::titan();
    let mut world = site.world(spec(Fault::Silt { seconds: 2.0 }), 1);
    let mut tape = Tape::default();
    tape.run(&mut world, 1.0);
    let before = *detections(&tape).last().expect("an image");
    assert!(before >= 3, "{before} tags");
    world.fault(0).expect("it breaks");
    tape.messages.clear();
    tape.run(&mut world, 2.0);
    // The first image may have been taken before.
    assert!(detections(&tape)[1..].iter().all(|n| *n == 0));
    tape.messages.clear();
    tape.run(&mut world, 2.0);
    assert!(*detections(&tape).last().expect("an image") >= 3);

    let ids = |tape: &Tape| -> Vec<u32> {
        let of = |message: &Message| match message {
            Message::Detections(detections) => detections.tags.iter().map(|tag| tag.id).collect(),
            _ => Vec::new(),
        };
        tape.messages.iter().flat_map(|(_, message)| of(message)).collect()
    };
    let mut tape = Tape::default();
    tape.run(&mut site.world(WorldSpec::default(), 1), 2.0);
    let id = ids(&tape)[0];
    let mut world = site.world(spec(Fault::TagLost { id }), 1);
    world.fault(0).expect("it breaks");
    let mut tape = Tape::default();
    tape.run(&mut world, 2.0);
    assert!(!ids(&tape).is_empty() && !ids(&tape).contains(&id));
}

#[test]
fn a_fault_that_nobody_described_is_an_error() {
    let mut world = Site::titan().world(WorldSpec::default(), 1);
    assert!(matches!(world.fault(0), Err(ArmError::NoSuchFault { number: 0, known: 0 })));
}

//! Effect of each fault on the messages, with its time: two runs of one seed differ only by the fault.

use armcal::sim::{Fault, ScheduledFault, WorldSpec};
use armcal::streams::{Arm, ArmError, JointCounts, Message, TagDetection};
use armcal::time::{SIMULATION_EPOCH, Stamp};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};

use super::{Site, Tape, Witness};

fn at(at_s: f64, fault: Fault) -> ScheduledFault {
    ScheduledFault { at_s: Some(at_s), fault }
}

fn spec(faults: Vec<ScheduledFault>) -> WorldSpec {
    WorldSpec { fault: faults, ..WorldSpec::default() }
}

fn jump(joint: &str, by_rad: f64) -> Fault {
    Fault::SensorJump { joint: joint.to_owned(), by_rad }
}

fn readings(tape: &Tape) -> Vec<(Stamp, JointCounts)> {
    let reading = |message: &Message| match message {
        Message::JointSensors(sample) => Some((sample.stamp, sample.counts)),
        _ => None,
    };
    tape.messages.iter().filter_map(|(_, message)| reading(message)).collect()
}

fn tags(tape: &Tape) -> Vec<(Stamp, TagDetection)> {
    let seen = |message: &Message| match message {
        Message::Detections(image) => image.tags.iter().map(|tag| (image.stamp, tag.clone())).collect(),
        _ => Vec::new(),
    };
    tape.messages.iter().flat_map(|(_, message)| seen(message)).collect()
}

/// Messages and truth of a world with these faults within `seconds`, commanded to `shift` from the stowed pose.
fn run(faults: Vec<ScheduledFault>, seconds: f64, shift: [f64; 6]) -> (Tape, Witness) {
    let site = Site::titan();
    let mut world = site.world(spec(faults), 1);
    let witness = Witness::default();
    world.set_truth_sink(Box::new(witness.clone())).expect("accepted");
    let target: Vec<f64> = site.robot.stowed.iter().zip(shift).map(|(a, b)| a + b).collect();
    world.command(&site.nominal_counts(&target)).expect("accepted");
    let mut tape = Tape::default();
    tape.run(&mut world, seconds);
    (tape, witness)
}

const STAY: [f64; 6] = [0.0; 6];
/// Shoulder and wrist turn, and the upper arm is lifted.
const LIFT: [f64; 6] = [0.2, 0.25, 0.0, 0.0, 0.3, 0.0];

fn seconds(stamp: Stamp) -> f64 {
    stamp.since_s(SIMULATION_EPOCH)
}

/// Angles at the start and at the end of a witnessed run.
fn travel(witness: &Witness) -> Vec<f64> {
    let states = witness.states.borrow();
    let (first, last) = (states[0].angles, states[states.len() - 1].angles);
    first.iter().zip(last.iter()).map(|(a, b)| b - a).collect()
}

#[test]
fn a_fault_with_a_time_happens_then_and_the_truth_alone_says_so() {
    let by_rad = 0.05;
    let faults = vec![at(1.5, jump("wrist_yaw", by_rad)), at(0.0, Fault::TagLost { id: 5 })];
    let (calm, _) = run(Vec::new(), 3.0, STAY);
    let (upset, witness) = run(faults, 3.0, STAY);
    let differing: Vec<_> = readings(&calm).into_iter().zip(readings(&upset)).filter(|(a, b)| a != b).collect();
    let ((stamp, before), (_, after)) = differing[0];
    // The fault occurs at the beginning of a period, which ends with a reading.
    assert!((seconds(stamp) - 1.51).abs() < 1e-9, "{stamp:?}");
    let jumped = after[4] - before[4];
    let expected = by_rad * Site::titan().robot.sensors[4].counts_per_rad;
    assert!((jumped - expected).abs() <= 1.0, "rounded to whole counts: {jumped} {expected}");
    let others = |j: &usize| *j != 4 && before[*j] != after[*j];
    assert_eq!((0..6).filter(others).count(), 0);
    let told = witness.faults.borrow();
    let kinds: Vec<_> = told.iter().map(|fault| (fault.kind.as_str(), seconds(fault.stamp))).collect();
    assert_eq!(kinds, [("tag_lost", 0.0), ("sensor_jump", 1.5)]);
    assert_eq!(told[0].details, "id = 5");
    // The camera saw the tag until then, and no message names the fault.
    let ids = |tape: &Tape| tags(tape).iter().filter(|(_, tag)| tag.id == 5).count();
    assert!(ids(&calm) > 0 && ids(&upset) == 0);
}

#[test]
fn faults_of_one_time_happen_in_their_order_and_steps_count_their_own() {
    let faults = vec![
        at(0.5, jump("wrist_yaw", 0.1)),
        Fault::TagLost { id: 1 }.into(),
        at(0.5, jump("wrist_pitch", 0.1)),
        Fault::TagLost { id: 2 }.into(),
        at(0.25, Fault::Silt { seconds: 1.0 }),
    ];
    let mut world = Site::titan().world(spec(faults), 1);
    let witness = Witness::default();
    world.set_truth_sink(Box::new(witness.clone())).expect("accepted");
    world.fault(1).expect("it breaks");
    Tape::default().run(&mut world, 1.0);
    assert!(matches!(world.fault(2), Err(ArmError::NoSuchFault { number: 2, known: 2 })));
    let details: Vec<String> = witness.faults.borrow().iter().map(|fault| fault.details.clone()).collect();
    let expected =
        ["id = 2", "seconds = 1.0", "by_rad = 0.1, joint = \"wrist_yaw\"", "by_rad = 0.1, joint = \"wrist_pitch\""];
    assert_eq!(details, expected);
}

#[test]
fn a_fault_in_a_wait_happens_at_its_time_and_the_arm_answers() {
    let by_rad = 0.05;
    let mut world = Site::titan().world(spec(vec![at(50.25, jump("wrist_pitch", by_rad))]), 1);
    let witness = Witness::default();
    world.set_truth_sink(Box::new(witness.clone())).expect("accepted");
    let mut tape = Tape::default();
    world.idle(100.7, &mut tape).expect("it waits");
    assert!((100.7..100.72).contains(&seconds(world.now())), "{:?}", world.now());
    assert!((seconds(witness.faults.borrow()[0].stamp) - 50.25).abs() < 1e-9);
    assert!(tape.messages.windows(2).all(|pair| pair[0].0 <= pair[1].0), "log times go back");
    let words: Vec<(f64, f64)> = readings(&tape).iter().map(|(stamp, counts)| (seconds(*stamp), counts[3])).collect();
    let jumped = words.windows(2).find(|pair| (pair[1].1 - pair[0].1).abs() > 50.0).expect("it jumps");
    assert!((jumped[0].0 - 50.25).abs() < 1e-9 && (jumped[1].0 - 50.26).abs() < 1e-9, "{jumped:?}");
    // Most of the wait was skipped; the controller drove the joint back to the angle of the same reading.
    assert!(words.len() < 2000, "{}", words.len());
    let states = witness.states.borrow();
    let moved_rad = states[states.len() - 1].angles[3] - states[0].angles[3];
    assert!((moved_rad + by_rad).abs() < 0.005, "{moved_rad}");
}

#[test]
fn a_dead_sensor_says_nothing_of_its_joint() {
    let (tape, _) = run(vec![at(0.5, Fault::SensorDead { joint: "wrist_yaw".to_owned() })], 2.0, LIFT);
    let words: Vec<f64> = readings(&tape).iter().filter(|(stamp, _)| seconds(*stamp) > 0.505).map(|r| r.1[4]).collect();
    assert!(words.len() > 140 && words.iter().all(|word| (0.0..10.0).contains(word)), "{words:?}");
    let alive = readings(&tape)[40].1[4];
    assert!(alive > 100.0, "{alive}");
}

#[test]
fn a_locked_joint_stays_where_the_others_go() {
    let (_, free) = run(Vec::new(), 6.0, LIFT);
    let (_, locked) = run(vec![at(0.0, Fault::JointLocked { joint: "wrist_yaw".to_owned() })], 6.0, LIFT);
    let (free, locked) = (travel(&free), travel(&locked));
    assert!(free[4] > 0.25 && locked[4].abs() < 0.01, "{free:?} {locked:?}");
    assert!((free[1] - locked[1]).abs() < 0.01 && locked[0] > 0.15, "{free:?} {locked:?}");
}

#[test]
fn without_pressure_nothing_is_lifted() {
    let (_, free) = run(Vec::new(), 6.0, LIFT);
    let (_, of_pump) = run(vec![at(0.0, Fault::PressureLost { joint: None, ratio: 1.0 })], 6.0, LIFT);
    let joint = Some("shoulder_pitch".to_owned());
    let (_, of_joint) = run(vec![at(0.0, Fault::PressureLost { joint, ratio: 1.0 })], 6.0, LIFT);
    let (free, of_pump, of_joint) = (travel(&free), travel(&of_pump), travel(&of_joint));
    eprintln!("lifted by {:.3}, without pump {:.3}, without pressure {:.3} rad", free[1], of_pump[1], of_joint[1]);
    // Without pressure the joint may sink, but never rise.
    assert!(free[1] > 0.2 && of_pump[1] < 0.02 && of_joint[1] < 0.02, "{free:?} {of_pump:?} {of_joint:?}");
    assert!(of_joint[4] > 0.25 && of_pump[4].abs() < of_joint[4], "{of_joint:?} {of_pump:?}");
    // With a quarter less pressure the arm still lifts.
    let (_, weak) = run(vec![at(0.0, Fault::PressureLost { joint: None, ratio: 0.25 })], 6.0, LIFT);
    assert!(travel(&weak)[1] > 0.2, "{:?}", travel(&weak));
}

/// Corners of a moved tag, compared with the projection of the moved square by the true camera.
#[test]
fn a_moved_tag_is_seen_where_it_is_now() {
    let (calm, _) = run(Vec::new(), 1.0, STAY);
    let by_margin =
        |a: &(Stamp, TagDetection), b: &(Stamp, TagDetection)| a.1.decision_margin.total_cmp(&b.1.decision_margin);
    let id = tags(&calm).into_iter().max_by(by_margin).expect("tags in view").1.id;
    // The tag moves away from its carrier, so that a turned corner does not sink into that.
    let (by_m, by_rad) = ([0.02, -0.015, 0.03], [0.1, 0.0, -0.2]);
    let (tape, witness) = run(vec![at(2.0, Fault::TagMoved { id, by_m, by_rad })], 4.0, STAY);
    let motion = Isometry3::from_parts(
        Translation3::from(Vector3::from(by_m)),
        UnitQuaternion::from_scaled_axis(Vector3::from(by_rad)),
    );
    let lens = Site::titan().robot.camera.lens;
    let header = witness.header.borrow().clone().expect("a header");
    let built = header.as_built.tags.iter().find(|tag| tag.id == id).expect("a known tag");
    let states = witness.states.borrow();
    let (mut squares, mut n) = ([0.0, 0.0], [0.0, 0.0]);
    for (stamp, tag) in tags(&tape).iter().filter(|(_, tag)| tag.id == id) {
        // Stamps are late by 20 ms; images are taken five times per second, states every 20 ms. The image of 2.0 s is
        // taken before the period at whose beginning the tag is moved.
        let exposed_s = ((seconds(*stamp) - 0.02) * 5.0).round() / 5.0;
        let state = &states[(exposed_s * 50.0).round() as usize - 1];
        let is_moved = usize::from(exposed_s > 2.01);
        let base_from_tag = built.base_from_tag().isometry() * [Isometry3::identity(), motion][is_moved];
        let camera_from_tag = state.base_from_camera.isometry().inverse() * base_from_tag;
        for (corner, pixel) in armcal::optics::square_corners(built.size_m).iter().zip(&tag.corners_px) {
            let predicted = lens.project(&(camera_from_tag * corner).coords).expect("in view");
            squares[is_moved] += (predicted - Vector2::from(*pixel)).norm_squared();
            n[is_moved] += 2.0;
        }
    }
    let rms_px = [0, 1].map(|k| (squares[k] / f64::max(n[k], 1.0)).sqrt());
    eprintln!("corner rms before {:.2} px, after {:.2} px", rms_px[0], rms_px[1]);
    assert!(n[0] >= 40.0 && n[1] >= 40.0, "{n:?}");
    assert!(rms_px.iter().all(|rms| *rms < 0.8), "the noise of the corners: {rms_px:?}");
}

#[test]
fn a_misread_tag_has_another_id_and_the_same_corners() {
    let (calm, _) = run(Vec::new(), 2.0, STAY);
    let id = tags(&calm)[0].1.id;
    let (upset, _) = run(vec![at(0.0, Fault::TagMisread { id, as_id: 77 })], 2.0, STAY);
    let mut renamed: Vec<_> = tags(&calm)
        .into_iter()
        .map(|(stamp, tag)| (stamp, TagDetection { id: if tag.id == id { 77 } else { tag.id }, ..tag }))
        .collect();
    assert!(renamed.iter().any(|(_, tag)| tag.id == 77));
    // A detector sorts by id.
    renamed.sort_by_key(|(stamp, tag)| (*stamp, tag.id));
    assert_eq!(renamed, tags(&upset));
}

/// A blow moves its object, and the truth has its time: the vehicle swings out and comes back, the joints give way and
/// come back.
#[test]
fn blows_move_what_they_hit() {
    let blows = [
        Fault::VehicleImpulse { force_n: [4000.0, 0.0, 0.0], duration_s: 0.2, at_m: [0.0; 3] },
        Fault::ArmImpulse { link: "forearm_link".to_owned(), force_n: [0.0, 0.0, -800.0], duration_s: 0.2 },
    ];
    for blow in blows {
        let (_, calm) = run(Vec::new(), 25.0, STAY);
        let (_, upset) = run(vec![at(5.0, blow.clone())], 25.0, STAY);
        assert_eq!(upset.faults.borrow()[0].kind, blow.kind());
        let differences: Vec<(f64, f64)> = calm
            .states
            .borrow()
            .iter()
            .zip(upset.states.borrow().iter())
            .map(|(a, b)| {
                let moved = (b.world_from_vehicle.origin().vector() - a.world_from_vehicle.origin().vector()).norm();
                (moved, a.angles.max_abs_difference(&b.angles))
            })
            .collect();
        let at_s = |s: f64| (s * 50.0) as usize;
        assert!(differences[..at_s(4.9)].iter().all(|d| *d == (0.0, 0.0)), "nothing before its time");
        let most = |pick: fn(&(f64, f64)) -> f64| differences.iter().map(pick).fold(0.0, f64::max);
        let (vehicle_m, joints_rad) = (most(|d| d.0), most(|d| d.1));
        eprintln!("{}: vehicle {vehicle_m:.3} m, joints {joints_rad:.1e} rad", blow.kind());
        match blow {
            // An impulse of 800 N s on 4 t: 0.2 m/s for a second or two.
            Fault::VehicleImpulse { .. } => assert!((0.1..1.0).contains(&vehicle_m), "{vehicle_m}"),
            _ => assert!(vehicle_m == 0.0 && joints_rad > 5e-3, "{joints_rad}"),
        }
        let last = differences[differences.len() - 1];
        assert!(last.0 < 5e-3 && last.1 < 5e-3, "it is back: {last:?}");
    }
}

use rand_distr::{Distribution, StandardNormal};

use crate::views::association::associate;
use crate::views::conditions::*;
use armcal_core::robot::Robot;
use armcal_core::stats::stream_rng;
use armcal_core::streams::{CaptureSet, JointCounts, JointSensorSample, MarkKind, PressureSample, TemperatureSample};
use armcal_core::time::SIMULATION_EPOCH;

fn titan() -> Robot {
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
    armcal_core::robot::load(&folder).expect("the robot reads")
}

fn at(seconds: f64) -> Stamp {
    SIMULATION_EPOCH.plus_s(seconds)
}

fn recording(robot: &Robot, messages: Vec<Message>) -> Recording {
    Recording {
        path: "synthetic.mcap".into(),
        messages: messages.into_iter().map(|message| (SIMULATION_EPOCH, message)).collect(),
        joint_names: robot.joint_names(),
        ..Default::default()
    }
}

fn oil(seconds: f64, temperature_c: f64) -> Message {
    let thermometer = Thermometer::Oil;
    Message::Temperature(TemperatureSample { stamp: at(seconds), thermometer, temperature_c, variance_c2: 0.01 })
}

fn pressure(seconds: f64, pressure_pa: f64) -> Message {
    Message::Pressure(PressureSample { stamp: at(seconds), pressure_pa, variance_pa2: 1.0 })
}

fn mark(start_s: f64, end_s: f64) -> Message {
    let kind = MarkKind::Capture { set: CaptureSet::Fit, pose_idx: 0 };
    Message::Mark(Mark { start: at(start_s), end: at(end_s), kind })
}

/// Returns readings at 100 Hz of joints at `travel_rad(seconds)`, with the datasheet's noise.
fn readings(robot: &Robot, until_s: f64, seed: u64, travel_rad: impl Fn(f64, usize) -> f64) -> Vec<Message> {
    let mut rng = stream_rng(seed, "readings");
    let one = |k: usize| {
        let stamp = at(0.01 * k as f64);
        let counts = JointCounts::from_fn(robot.n_joints(), |j| {
            let spec = &robot.sensors[j];
            let noise: f64 = StandardNormal.sample(&mut rng);
            let angle_rad = spec.center_rad + travel_rad(0.01 * k as f64, j);
            let counts = spec.offset_counts + spec.counts_per_rad * angle_rad + spec.noise_std_counts * noise;
            counts.round().rem_euclid(spec.wrap_counts)
        });
        Message::JointSensors(JointSensorSample { stamp, counts })
    };
    (0..(until_s * 100.0) as usize).map(one).collect()
}

#[test]
fn samples_within_a_span_are_averaged_and_others_joined_by_a_line() {
    let robot = titan();
    let messages = vec![
        oil(0.0, 10.0),
        oil(10.0, 12.0),
        oil(10.5, 13.0),
        pressure(40.0, 2e6),
        pressure(0.0, 1e6),
        oil(200.0, 30.0),
    ];
    let surroundings = ConditionHistory::of(&recording(&robot, messages));
    let mut used = Vec::new();
    let inside = surroundings.over_noting(at(9.9), at(10.6), &mut used);
    assert_eq!((inside.oil_c, inside.stamp), (Some(12.5), Some(at(10.25))));
    assert!((inside.pressure_pa.expect("known") - (1e6 + 1e6 * 10.25 / 40.0)).abs() < 1e-3);
    used.sort_unstable();
    assert_eq!(used, [1, 2, 3, 4]);
    let between = surroundings.over(at(4.0), at(6.0));
    assert!((between.oil_c.expect("known") - 11.0).abs() < 1e-9);
    // Only one side has a reading near enough.
    assert_eq!(surroundings.over(at(65.0), at(66.0)).oil_c, Some(13.0));
    assert_eq!(surroundings.over(at(65.0), at(66.0)).pressure_pa, Some(2e6));
    // Neither side has one.
    let far = surroundings.over(at(110.0), at(111.0));
    assert_eq!((far.oil_c, far.pressure_pa), (None, None));
}

#[test]
fn a_view_knows_its_rate_and_the_side_that_each_joint_came_from() {
    let robot = titan();
    // Joint 0 came from below, 1 from above, 2 overshot from below, 3 never moved, 4 jumped once, 5 came from below and
    // creeps.
    let travel = |s: f64, j: usize| match j {
        0 => (0.1 * (s - 3.0)).min(0.0) + 0.4,
        1 => 0.4 - (0.1 * (s - 3.0)).min(0.0),
        2 if s < 2.0 => 0.1 * s - 0.2,
        2 => (0.05 * (1.0 - (s - 2.5).abs() / 0.5)).max(0.0),
        4 if (s - 2.0).abs() < 0.004 => 0.5,
        4 => 0.2,
        5 => {
            if s < 3.0 {
                0.1 * (s - 3.0)
            } else {
                0.002 * (s - 3.0)
            }
        }
        _ => 0.2,
    };
    for seed in 0..40 {
        let mut messages = readings(&robot, 5.0, seed, travel);
        messages.extend([oil(2.0, 20.0), oil(6.0, 24.0), mark(4.0, 5.0)]);
        let n = messages.len();
        let found = associate(&recording(&robot, messages), &robot);
        let view = &found.fit[0];
        assert_eq!(view.approach[..6], [1.0, -1.0, -1.0, 0.0, 0.0, 1.0], "seed {seed}");
        // Standard deviation of the slope: noise / (sqrt(n / 12) * 1 s).
        let sigma_rad_s = 2.02 / (46.0 * 57.3) / (100.0_f64 / 12.0).sqrt();
        for (j, expected) in [0.0, 0.0, 0.0, 0.0, 0.0, 0.002].into_iter().enumerate() {
            assert!(
                (view.rate_rad_s[j] - expected).abs() < 5.0 * sigma_rad_s,
                "seed {seed}: {j} {:?}",
                view.rate_rad_s
            );
        }
        assert!((view.conditions.oil_c.expect("known") - 22.5).abs() < 1e-9);
        assert_eq!(view.conditions.pressure_pa, None);
        // The messages that a method without terms hashes are the same as before; the others are in `used_for_terms`.
        assert!(found.used.iter().all(|&idx| idx >= 400 && idx != n - 2 && idx != n - 3), "{:?}", found.used);
        assert!(found.used_for_terms.contains(&(n - 2)) && found.used_for_terms.contains(&(n - 3)));
        assert!(found.used_for_terms.iter().all(|idx| found.used.binary_search(idx).is_err()));
        assert!(found.used_for_terms.len() <= 2 + 2 * 4, "two readings a joint decide: {:?}", found.used_for_terms);
    }
}

/// A calibration during the recording equals one from the finished recording: later messages were not known then.
#[test]
fn what_was_heard_after_the_calibration_does_not_matter() {
    let robot = titan();
    let mut messages = readings(&robot, 3.0, 1, |_, _| 0.1);
    messages.extend([oil(1.0, 20.0), pressure(1.0, 1e5), mark(2.5, 3.0)]);
    let growing = recording(&robot, messages.clone());
    // The last message was measured before the end and arrived after it.
    messages.extend([oil(5.0, 30.0), pressure(5.0, 2e5), oil(2.9, 40.0)]);
    let mut finished = recording(&robot, messages);
    finished.messages.last_mut().expect("messages").0 = at(3.3);
    let span = Some((at(0.0), at(3.2)));
    let [a, b] =
        [&growing, &finished].map(|recording| crate::views::association::associate_within(recording, &robot, span));
    assert_eq!(a.fit[0].conditions, b.fit[0].conditions);
    assert_eq!(a.used_for_terms, b.used_for_terms);
    assert_eq!(b.fit[0].conditions.oil_c, Some(20.0));
    assert_eq!(associate(&finished, &robot).fit[0].conditions.oil_c, Some(40.0));
}

/// The result does not depend on the order of the messages.
#[test]
fn the_order_of_messages_does_not_matter() {
    let robot = titan();
    let mut messages = readings(&robot, 3.0, 1, |s, j| 0.1 * (s.min(2.0)) * (j as f64 - 2.0));
    messages.extend([oil(2.2, 20.0), oil(2.2, 21.0), pressure(1.0, 1e5), mark(2.5, 3.0)]);
    let forwards = associate(&recording(&robot, messages.clone()), &robot);
    messages.reverse();
    let backwards = associate(&recording(&robot, messages), &robot);
    let (a, b) = (&forwards.fit[0], &backwards.fit[0]);
    assert_eq!((a.approach, a.conditions, a.rate_rad_s), (b.approach, b.conditions, b.rate_rad_s));
    assert_eq!(a.approach[..6], [-1.0, -1.0, 0.0, 1.0, 1.0, 1.0]);
}

/// A joint that turns past the end of its word has not jumped.
#[test]
fn words_that_wrap_are_no_motion() {
    let robot = titan();
    let spec = &robot.sensors[5];
    let turn_rad = spec.wrap_counts / spec.counts_per_rad;
    let mut messages =
        readings(&robot, 3.0, 1, |s, j| if j == 5 { 0.5 * turn_rad + 0.01 * (s - 2.0).min(0.0) } else { 0.0 });
    messages.push(mark(2.0, 2.4));
    let found = associate(&recording(&robot, messages), &robot);
    let view = &found.fit[0];
    assert!(view.rate_rad_s[5].abs() < 0.01, "{:?}", view.rate_rad_s);
}

//! The paper's other methods from recorded bytes: end stops without a camera, and least spread without a map.

use armcal::calib::{CalibError, Calibration, Status, calibrate};
use armcal::codes::{Code, Coded};
use armcal::log::{Recording, RecordingHeader, RecordingWriter, read_recording};
use armcal::routine::Method;
use armcal::stats::stream_rng;
use armcal::streams::{CaptureSet, JointAngles, JointSensorSample, Mark, MarkKind, Message, Sink};
use armcal::time::SIMULATION_EPOCH;
use rand_chacha::ChaCha8Rng;

use crate::support::synthetic::{N_SEEN, TrueArm};
use crate::support::{temp, titan};

const N_FIT: usize = 20;
const N_HELD_OUT: usize = 6;

fn recording(arm: &TrueArm, rng: &mut ChaCha8Rng) -> Recording {
    let mut shots = arm.shots(CaptureSet::Fit, N_FIT, rng);
    shots.extend(arm.shots(CaptureSet::HeldOut, N_HELD_OUT, rng));
    arm.recording(&shots)
}

/// Adds a mark and a reading at each of these stops: (joint, angle).
fn add_stops(recording: &mut Recording, arm: &TrueArm, stops: &[(usize, f64)]) {
    for (k, &(joint, angle_rad)) in stops.iter().enumerate() {
        let start = SIMULATION_EPOCH.plus_s(1000.0 + 2.0 * k as f64);
        let (stamp, end) = (start.plus_s(0.2), start.plus_s(0.5));
        let angles = JointAngles::from_fn(6, |j| if j == joint { angle_rad } else { arm.robot.stowed[j] });
        let counts = arm.counts(&angles);
        recording.messages.push((stamp, Message::JointSensors(JointSensorSample { stamp, counts })));
        let kind = MarkKind::Stop { joint_idx: joint as u32, angle_rad };
        recording.messages.push((end, Message::Mark(Mark { start, end, kind })));
    }
}

fn codes(found: &Calibration) -> Vec<Code> {
    found.refusals.iter().map(Coded::code).collect()
}

fn both_stops(arm: &TrueArm) -> Vec<(usize, f64)> {
    let ends = |joint: usize| {
        let limits = arm.robot.chain.joints()[joint].limits.expect("limits");
        [(joint, limits.lower_rad), (joint, limits.upper_rad)]
    };
    (0..N_SEEN).flat_map(ends).collect()
}

fn largest_error(arm: &TrueArm, found: &Calibration, joints: std::ops::Range<usize>) -> f64 {
    let sensors = found.sensors(arm.robot).expect("for this robot");
    let errors = joints.map(|j| {
        let correction = sensors.models[j].correction;
        (correction.gain - arm.gain[j]).abs().max((correction.offset_rad - arm.offset_rad[j]).abs())
    });
    errors.fold(0.0, f64::max)
}

#[test]
fn stops_in_a_file_give_the_sensors_and_views_the_verdict() {
    let robot = titan();
    let dir = temp();
    for seed in 1..=5 {
        let mut rng = stream_rng(seed, "joint limits");
        let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
        let mut written = recording(&arm, &mut rng);
        add_stops(&mut written, &arm, &both_stops(&arm));
        let path = dir.path().join(format!("{seed}.mcap"));
        let mut writer = RecordingWriter::create(&path, RecordingHeader::new(robot.joint_names())).expect("a file");
        for (stamp, message) in &written.messages {
            writer.record(*stamp, message).expect("recorded");
        }
        writer.finish().expect("finished");
        let read = read_recording(&path).expect("read");
        let found = calibrate(&read, &robot, Method::JointLimits).expect("calibrated");
        assert_eq!((found.status, found.method), (Status::Accepted, Method::JointLimits), "{:?}", found.refusal);
        assert!(largest_error(&arm, &found, 0..N_SEEN) < 1e-9, "seed {seed}");
        assert!(found.fit.cost_final < 1e-18 && found.fit.cost_initial > 1e-3, "{:?}", found.fit);
        assert!(found.unobservable.iter().any(|line| line.starts_with("wrist_rotate")));
    }
}

#[test]
fn a_joint_that_the_vehicle_blocks_keeps_its_datasheet_and_no_stops_at_all_are_refused() {
    let robot = titan();
    let mut rng = stream_rng(3, "joint limits");
    let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
    let mut some = recording(&arm, &mut rng);
    let problem = calibrate(&some, &robot, Method::JointLimits).expect_err("nothing to fit");
    assert!(matches!(problem, CalibError::NoStops { .. }), "{problem}");
    let stops: Vec<(usize, f64)> = both_stops(&arm).into_iter().filter(|(joint, _)| *joint != 1).collect();
    add_stops(&mut some, &arm, &stops);
    add_stops(&mut some, &arm, &[]);
    let found = calibrate(&some, &robot, Method::JointLimits).expect("four joints");
    assert!(!found.joint[1].gain_estimated && found.joint[1].offset_rad == 0.0);
    assert!(found.joint[2].gain_estimated && largest_error(&arm, &found, 2..N_SEEN) < 1e-9);
    // Without camera data there is no evidence, so the result is not usable.
    let mut blind = arm.recording(&[]);
    add_stops(&mut blind, &arm, &both_stops(&arm));
    let found = calibrate(&blind, &robot, Method::JointLimits).expect("fitted");
    assert_eq!(found.status, Status::Refused);
    assert_eq!(codes(&found), [Code::TooFewHeldOutViews]);
    let text = found.to_toml();
    assert!(text.contains("method = \"joint_limits\""));
}

#[test]
fn minimum_variance_finds_all_but_the_first_offset_and_says_so() {
    let robot = titan();
    for seed in 1..=5 {
        let mut rng = stream_rng(seed, "minimum variance");
        let mut arm = TrueArm::with_sensor_errors(&robot, &mut rng);
        let found = calibrate(&recording(&arm, &mut rng), &robot, Method::MinimumVariance).expect("calibrated");
        assert!(found.unobservable.iter().any(|line| line.starts_with("shoulder_yaw offset")));
        assert!(!found.joint[0].offset_estimated && found.joint[0].gain_estimated && found.joint[0].offset_rad == 0.0);
        assert!(largest_error(&arm, &found, 1..N_SEEN) < 1e-6, "seed {seed}");
        assert!((found.joint[0].gain_over_datasheet.expect("a gain") - arm.gain[0]).abs() < 1e-6);
        assert!(found.fit.cost_final < 1e-12 && found.fit.cost_initial > 1e-4, "{:?}", found.fit);
        // The held offset is right if the datasheet is.
        arm.offset_rad[0] = 0.0;
        let found = calibrate(&recording(&arm, &mut rng), &robot, Method::MinimumVariance).expect("calibrated");
        // The error of the held offset decides: its datasheet's sigma moves the tool by about the tolerance.
        assert!(codes(&found).iter().all(|code| *code == Code::BeyondTolerance), "{:?}", found.refusal);
        assert!(largest_error(&arm, &found, 0..N_SEEN) < 1e-6);
    }
}

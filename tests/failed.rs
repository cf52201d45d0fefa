//! Sensors that fail in a recording of the simulated arm, with its own readings altered; and priors that no longer
//! hold.

use armcal::calib::{Calibration, Status, calibrate, calibrate_data, prepare_pooled};
use armcal::log::{Recording, read_recording};
use armcal::robot::{FailedKind, Robot};
use armcal::routine::Method;
use armcal::streams::Message;

use crate::support::{self, ShortRoutine, Simulated, answer, program, read, robot_folder, shared_run, temp, titan};

const FOREARM: usize = 2;
const WRIST_PITCH: usize = 3;

fn recording() -> Recording {
    read_recording(shared_run().file("run.mcap")).expect("it reads")
}

/// The recording with the words of one joint's sensor changed, by word and share of the time that has passed.
fn altered(robot: &Robot, joint: usize, word: impl Fn(f64, f64) -> f64) -> Recording {
    let mut recording = recording();
    let stamps = || recording.messages.iter().map(|(stamp, _)| *stamp);
    let (first, last) = (stamps().min().expect("messages"), stamps().max().expect("messages"));
    let wrap = robot.sensors[joint].wrap_counts;
    for (_, message) in &mut recording.messages {
        if let Message::JointSensors(sample) = message {
            let share = sample.stamp.since_s(first) / last.since_s(first);
            sample.counts[joint] = word(sample.counts[joint], share).rem_euclid(wrap);
        }
    }
    recording
}

fn sound(robot: &Robot) -> Calibration {
    let calibration = calibrate(&recording(), robot, Method::Bundle).expect("calibrated");
    assert_eq!((calibration.status, &calibration.failed_joint[..]), (Status::Accepted, &[][..]), "{calibration:?}");
    calibration
}

/// Difference of a joint's angle at mid-range from the sound recording's, rad.
fn off_rad(one: &Calibration, other: &Calibration, robot: &Robot, joint: usize) -> f64 {
    let angle = |calibration: &Calibration| {
        let model = &calibration.sensors(robot).expect("its sensors").models[joint];
        let spec = &model.spec;
        model.angle_rad(spec.offset_counts + spec.counts_per_rad * spec.center_rad)
    };
    angle(one) - angle(other)
}

#[test]
fn a_dead_sensor_is_found_the_rest_calibrated_and_the_task_refused() {
    let robot = titan();
    let dead = altered(&robot, WRIST_PITCH, |_, share| (1e4 * share).rem_euclid(3.0).floor());
    let calibration = calibrate(&dead, &robot, Method::Bundle).expect("calibrated");
    let [failed] = &calibration.failed_joint[..] else { panic!("{:?}", calibration.failed_joint) };
    assert_eq!(
        (failed.joint.as_str(), failed.kind, failed.found.as_str()),
        ("wrist_pitch", FailedKind::Dead, "detected")
    );
    let refusal = calibration.refusal.as_deref().expect("the task needs that joint");
    assert!(refusal.contains("wrist_pitch"), "{refusal}");
    let (blind, seeing) = (failed.tool_error_m.expect("a task"), failed.tool_error_by_camera_m.expect("a task"));
    assert!(blind.p95 > 0.1 && seeing.p95 < 0.02, "{failed:?}");
    assert!(!calibration.joint[WRIST_PITCH].offset_estimated && calibration.joint[FOREARM].offset_estimated);
    let sound = sound(&robot);
    for joint in (0..5).filter(|&joint| joint != WRIST_PITCH) {
        let off_deg = off_rad(&calibration, &sound, &robot, joint).to_degrees();
        assert!(off_deg.abs() < 0.5, "joint {joint}: {off_deg:.3} deg");
    }
    // The same recording as a file.
    let folder = temp();
    let file = folder.path().join("calibration.toml");
    std::fs::write(&file, calibration.to_toml()).expect("written");
    assert_eq!(
        Calibration::parse(&file, &calibration.to_toml()).expect("it reads").failed_joint,
        calibration.failed_joint
    );
}

#[test]
fn a_lasting_slip_is_found_and_the_sensor_calibrated_as_it_is_now() {
    let robot = titan();
    let by_rad = 2.0_f64.to_radians();
    let by_counts = by_rad * robot.sensors[FOREARM].counts_per_rad;
    let slipped = altered(&robot, FOREARM, |word, share| if share > 0.55 { word + by_counts } else { word });
    let calibration = calibrate(&slipped, &robot, Method::Bundle).expect("calibrated");
    let [failed] = &calibration.failed_joint[..] else { panic!("{:?}", calibration.failed_joint) };
    assert_eq!((failed.joint.as_str(), failed.kind), ("forearm_pitch", FailedKind::Jumps), "{failed:?}");
    // The readings before the failure are used, with a step of their own.
    assert!(failed.since_pose.is_some() && failed.poses.is_empty(), "{failed:?}");
    assert!(failed.evidence.contains("slipped"), "{failed:?}");
    let off_deg = (off_rad(&calibration, &sound(&robot), &robot, FOREARM) + by_rad).to_degrees();
    assert!(off_deg.abs() < 0.3, "{off_deg:.3} deg");
}

#[test]
fn a_prior_is_refused_after_a_slip_and_names_the_joint() {
    let robot = titan();
    let prior = sound(&robot);
    let by_counts = 1.0_f64.to_radians() * robot.sensors[FOREARM].counts_per_rad;
    let slipped = altered(&robot, FOREARM, |word, _| word + by_counts);
    let prepared = prepare_pooled(&[slipped], &robot, None, None, Method::Bundle).expect("views");
    let calibration = calibrate_data(prepared, Method::Bundle, Some(&prior)).expect("calibrated");
    let refusal = calibration.refusal.as_deref().expect("refused");
    assert!(refusal.contains("prior") && refusal.contains("forearm_pitch"), "{refusal}");
    let table = calibration.prior.expect("a table");
    assert!(!table.agrees && (table.worst_off_rad.to_degrees() + 1.0).abs() < 0.3, "{table:?}");
}

#[test]
fn a_joint_is_declared_on_the_command_line() {
    let run = shared_run().file("run.mcap");
    let folder = temp();
    let with = |failed: &str| {
        let mut command = program();
        command
            .arg("calibrate")
            .arg("--details")
            .arg(&run)
            .arg("--robot")
            .arg(robot_folder())
            .arg("--out")
            .arg(folder.path());
        answer(command.arg("--failed").arg(failed))
    };
    let declared = with("wrist_pitch=dead");
    assert_ne!(declared.code, 0, "{declared:?}");
    let text = read(&folder.path().join("calibration.toml"));
    assert!(text.contains("found = \"declared\"") && text.contains("kind = \"dead\""), "{text}");
    let beyond = with("wrist_rotate=dead");
    assert!(beyond.stderr.contains("wrist_rotate") && beyond.stderr.contains("[key_ignored]"), "{beyond:?}");
    assert!(!declared.stderr.contains("[key_ignored]"), "{declared:?}");
    for (wrong, word) in [("nose=dead", "wrist_pitch"), ("wrist_pitch=odd", "stuck"), ("wrist_pitch", "locked")] {
        let refused = with(wrong);
        assert!(refused.code != 0 && refused.stderr.contains(word), "{refused:?}");
    }
}

/// A joint whose readings move is not locked, and a joint has one failure.
#[test]
fn a_declaration_that_the_readings_contradict_is_the_error() {
    let run = shared_run().file("run.mcap");
    let folder = temp();
    let with = |failed: &[&str]| {
        let mut command = program();
        command.arg("calibrate").arg(&run).arg("--robot").arg(robot_folder()).arg("--out").arg(folder.path());
        failed.iter().for_each(|one| {
            command.arg("--failed").arg(one);
        });
        answer(&mut command)
    };
    with(&["forearm_pitch=locked"]).expect("it moves", 2, &["forearm_pitch", " deg", "dead", "[value_invalid]"]);
    let twice = with(&["forearm_pitch=locked", "forearm_pitch=dead"]);
    twice.expect("two kinds", 2, &["forearm_pitch", "locked", "dead", "[usage_invalid]"]);
}

/// A sensor sticks after the first calibration: the joint is held, and the script continues without it. The finished
/// recording gives the same calibration.
#[test]
fn an_arm_whose_sensor_sticks_goes_on_without_that_joint() {
    let steps = ["capture", "calibrate", "fault", "reach", "capture", "recalibrate", "reach"].map(|step| {
        let fault = if step == "fault" { "kind = \"sensor_stuck\"\njoint = \"forearm_pitch\"\n" } else { "" };
        format!("[[step]]\ndo = \"{step}\"\n{fault}")
    });
    let folder = temp();
    // In this world the forearm stops where four of the targets are still reachable.
    let run = Simulated::of(&ShortRoutine { seed: 3, tail: steps.concat(), ..ShortRoutine::default() }, folder.path());
    let (summary, calibration) = (&run.finished().summary, &run.finished().calibration);
    assert_eq!(summary.status, Status::Accepted);
    let [held] = &summary.held_joints[..] else { panic!("{:?}", summary.held_joints) };
    assert_eq!((held.joint.as_str(), held.kind), ("forearm_pitch", FailedKind::Stuck));
    let [failed] = &calibration.failed_joint[..] else { panic!("{:?}", calibration.failed_joint) };
    // The sensor is stuck, and the joint is held at the angle that the camera shows.
    assert_eq!((failed.joint.as_str(), failed.kind), ("forearm_pitch", FailedKind::Stuck));
    assert!(failed.angle_rad.is_some() && failed.camera_std_rad.is_none(), "{failed:?}");
    let prior = calibration.prior.as_ref().expect("it starts from the first");
    assert!(prior.chi_square < 5.0 * prior.degrees_of_freedom as f64, "{prior:?}");
    let still = summary.still_reachable.as_ref().expect("a reach after it");
    let reached =
        summary.score.as_ref().and_then(|score| score.reaches.last()?.side.tool_error_m).expect("some reached");
    assert!(reached.n == still.reachable && reached.n + still.needs.len() + still.no_path.len() <= still.of, "{still}");
    assert!(reached.n >= 3 && reached.median < 0.005, "{reached:?}; {still}");
    assert_eq!(summary.capture.collisions, Some(0));
    let recording = folder.path().join("run.mcap");
    std::fs::copy(run.file("run"), &recording).expect("copied");
    support::calibrate(&recording, &robot_folder(), folder.path()).expect("calibrate", 0, &["ACCEPTED"]);
    assert!(read(&folder.path().join("calibration.toml")) == calibration.to_toml());
}

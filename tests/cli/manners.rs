//! First and last lines of the output, and its errors: verdict, figures, next step; one clear error.

use std::path::Path;

use armcal::log::ros::JointState;
use armcal::log::{RecordingHeader, RecordingWriter, RosMessage};
use armcal::time::SIMULATION_EPOCH;

use crate::support::texts::{Texts, note_without_digits};
use crate::support::{Answer, answer, edit, program, robot_copy, robot_folder, shared_run, temp, vehicle_file, write};

fn calibrated(more: &[&str], out: &Path) -> Answer {
    let mut command = program();
    command.arg("calibrate").arg(shared_run().file("run.mcap")).arg("--robot").arg(robot_folder());
    answer(command.arg("--out").arg(out).args(more))
}

#[test]
fn the_closing_lines_are_verdict_two_figures_and_the_next_step() {
    let _texts = Texts::of("the_closing_lines_are_verdict_two_figures_and_the_next_step");
    let folder = temp();
    let said = calibrated(&[], folder.path());
    let lines: Vec<&str> = said.stdout.lines().filter(|line| !line.starts_with("warning")).collect();
    note_without_digits("closing lines of calibrate", &lines.join("\n"));
    assert_eq!(lines.len(), 5, "{said:#?}");
    assert!(said.stdout.lines().count() < 8, "{said:#?}");
    let detailed = calibrated(&["--details"], folder.path());
    assert!(detailed.stdout.lines().count() > 2 * said.stdout.lines().count(), "{detailed:#?}");
}

#[test]
fn json_is_summary_json_alone_and_quiet_says_the_verdict_alone() {
    let _texts = Texts::of("json_is_summary_json_alone_and_quiet_says_the_verdict_alone");
    let folder = temp();
    let told = calibrated(&["--json"], folder.path());
    let json: serde_json::Value = serde_json::from_str(&told.stdout).expect("JSON alone on stdout");
    let file = crate::support::read(&folder.path().join("summary.json"));
    assert_eq!(json, serde_json::from_str::<serde_json::Value>(&file).expect("summary.json"));
    assert_eq!((json["version"].as_u64(), json["status"].as_str()), (Some(1), Some("accepted")));
    let quiet = calibrated(&["--quiet"], folder.path());
    assert_eq!((quiet.stdout.as_str(), quiet.stderr.as_str()), ("calibration  ACCEPTED\n", ""));
    let verbose = calibrated(&["-v"], folder.path());
    for word in ["run.mcap: ", "messages", "fitted", "bytes"] {
        assert!(verbose.stderr.contains(word), "no `{word}` in {verbose:#?}");
    }
    answer(program().args(["check", "--quiet", "-v", "x.toml"])).expect("both", 2, &[]);
}

/// Only the lines of belief.jsonl; a stationary estimate has a last line with its batch.
#[test]
fn a_belief_that_is_followed_has_a_json_form() {
    let _texts = Texts::of("a_belief_that_is_followed_has_a_json_form");
    let folder = temp();
    let file = folder.path().join("belief.jsonl");
    let watched = |more: &[&str]| {
        let mut command = program();
        command.arg("watch").arg(shared_run().file("run.mcap")).arg("--robot").arg(robot_folder());
        answer(command.arg("--json").arg("--out").arg(folder.path()).args(more))
    };
    let told = watched(&[]);
    assert!(told.stdout.lines().count() > 1 && told.stdout == crate::support::read(&file), "{told:#?}");
    let told = watched(&["--stationary"]);
    let last = told.stdout.strip_prefix(&crate::support::read(&file)).expect("the file's lines come first");
    let last: serde_json::Value = serde_json::from_str(last).expect("one line of JSON");
    assert_eq!((last["batch"]["status"].as_str(), last["batch"]["refusal"].is_null()), (Some("accepted"), true));
    assert!(last["batch"]["largest_difference_sigmas"].as_f64().is_some_and(|sigmas| sigmas < 0.1), "{last}");
}

#[test]
fn checks_maps_and_plans_have_a_json_form() {
    let _texts = Texts::of("checks_maps_and_plans_have_a_json_form");
    let folder = temp();
    let wrong = folder.path().join("wrong.toml");
    write(&wrong, "version = 1\n");
    let told = answer(program().args(["check", "--json"]).arg(robot_folder()).arg(&wrong));
    let json: serde_json::Value = serde_json::from_str(&told.stdout).expect("JSON alone on stdout");
    assert_eq!((told.code, json[0]["ok"].as_bool(), json[1]["ok"].as_bool()), (2, Some(true), Some(false)));
    assert_eq!(json[1]["code"], "file_kind", "{json}");
    let mut command = program();
    command.arg("tagmap").arg(shared_run().file("run.mcap")).arg("--robot").arg(robot_folder()).arg("--json");
    let map: serde_json::Value = serde_json::from_str(&answer(&mut command).stdout).expect("JSON alone on stdout");
    let tags = map["tags"].as_array().expect("tags");
    assert!(tags.len() == 8 && tags.iter().all(|tag| tag["position_m"].as_array().is_some_and(|m| m.len() == 3)));
    let mut command = program();
    command.arg("plan").arg(&shared_run().routine).arg("--json").arg("--out").arg(folder.path().join("plan"));
    let plan: serde_json::Value = serde_json::from_str(&answer(&mut command).stdout).expect("JSON alone on stdout");
    let poses = plan["pose"].as_array().expect("poses");
    assert!(poses.len() > 10 && poses[0]["raw_counts"].as_array().is_some_and(|counts| counts.len() == 6), "{plan}");
}

#[test]
fn a_wrong_kind_of_file_is_named_with_the_command_that_takes_it() {
    let _texts = Texts::of("a_wrong_kind_of_file_is_named_with_the_command_that_takes_it");
    let (folder, run) = (temp(), shared_run());
    let recording = run.file("run.mcap");
    let (routine, calibration, urdf) =
        (run.routine.clone(), run.file("calibration.toml"), robot_folder().join("titan4.urdf"));
    let robot_file = robot_folder().join("robot.toml");
    let out = folder.path().join("out");
    let refused = |words: &[&str], files: &[&Path], expected: &[&str]| {
        let mut command = program();
        command.args(words).args(files);
        answer(&mut command).expect(&format!("{words:?} {files:?}"), 2, expected);
    };
    refused(&["run"], &[&recording], &[]);
    refused(&["plan"], &[&calibration], &[]);
    refused(&["replay"], &[&routine], &[]);
    refused(&["inspect"], &[&urdf], &[]);
    refused(&["export", "--as", "yaml"], &[&recording], &[]);
    refused(&["check"], &[&recording], &["run.mcap: is a recording"]);
    refused(&["new-robot"], &[&recording, Path::new("--out"), &out], &["not a URDF"]);
    let calibrate = |option: &str, file: &Path, expected: &[&str]| {
        let mut command = program();
        command.arg("calibrate").arg(&recording).arg("--robot").arg(robot_folder()).arg("--out").arg(&out);
        answer(command.arg(option).arg(file)).expect(option, 2, expected);
    };
    calibrate("--input", &routine, &[]);
    calibrate("--tag-map", &calibration, &[]);
    calibrate("--task", &vehicle_file(), &["vehicle="]);
    calibrate("--prior", &run.file("summary.json"), &["summary.json"]);
    let mut command = program();
    command.arg("calibrate").arg(&recording).arg("--robot").arg(&robot_file).arg("--out").arg(&out);
    answer(&mut command).expect("a file for a folder", 2, &[]);
}

/// Writes joint readings on a topic of another program, and none of armcal's topics.
fn recording_of_others(file: &Path) {
    let mut writer = RecordingWriter::create(file, RecordingHeader::new(Vec::new())).expect("a file");
    for n in 0..5 {
        let joints = JointState { name: vec!["a".to_owned()], position: vec![1.0], ..JointState::default() };
        writer.write_ros("/joint_states", &JointState::SCHEMA, SIMULATION_EPOCH.plus_s(f64::from(n)), &joints).unwrap();
    }
    writer.finish().expect("finished");
}

#[test]
fn a_forgotten_input_map_is_told_and_how_to_get_one() {
    let _texts = Texts::of("a_forgotten_input_map_is_told_and_how_to_get_one");
    let folder = temp();
    let file = folder.path().join("field.mcap");
    recording_of_others(&file);
    let mut command = program();
    command.arg("calibrate").arg(&file).arg("--robot").arg(robot_folder()).arg("--out").arg(folder.path().join("out"));
    let words = ["field.mcap", "--input", "--write-input"];
    answer(&mut command).expect("no map", 2, &words);
}

/// The map may name the lens, so that a missing lens is no reason before it.
#[test]
fn a_forgotten_input_map_comes_before_a_missing_lens() {
    let folder = temp();
    let file = folder.path().join("field.mcap");
    recording_of_others(&file);
    let robot = robot_copy(folder.path());
    for key in ["model = \"equidistant\"\n", "resolution_px = [1224, 1024]\n", "focal_px = [387.33, 387.06]\n"] {
        edit(&robot.join("robot.toml"), key, "");
    }
    for key in ["center_px = [633.605, 510.9]\n", "distortion = [0.02268, -0.01345, 0.01296, -0.00418]\n"] {
        edit(&robot.join("robot.toml"), key, "");
    }
    edit(&robot.join("robot.toml"), "max_view_angle_rad = 1.4\n", "");
    let mut command = program();
    command.arg("calibrate").arg(&file).arg("--robot").arg(&robot).arg("--out").arg(folder.path().join("out"));
    answer(&mut command).expect("no map", 2, &["--input", "[joints_mismatch]"]);
}

#[test]
fn the_truth_is_no_recording_and_the_recording_is_named() {
    let folder = temp();
    let (truth, recording) = (shared_run().file("truth.mcap"), shared_run().file("run.mcap").display().to_string());
    let mut calibrate = program();
    calibrate.arg("calibrate").arg(&truth).arg("--robot").arg(robot_folder()).arg("--out").arg(folder.path());
    let mut replay = program();
    replay.arg("replay").arg(&truth).arg("--save").arg(folder.path().join("a.rrd"));
    for command in [&mut calibrate, &mut replay] {
        answer(command).expect("truth", 2, &["[file_kind]", "truth.mcap", &recording]);
    }
}

#[test]
fn missing_keys_are_told_at_once_and_unknown_ones_with_the_nearest() {
    let _texts = Texts::of("missing_keys_are_told_at_once_and_unknown_ones_with_the_nearest");
    let folder = temp();
    let map = folder.path().join("map.toml");
    write(&map, "version = 1\nkind = \"input\"\n[joint_sensors]\ntopic = \"/j\"\n[tags]\ntopics = \"/t\"\n");
    let check = |file: &Path| answer(program().arg("check").arg(file));
    check(&map).expect("unknown", 2, &["map.toml", "line 6", "`topics`"]);
    write(&map, "version = 1\nkind = \"input\"\n[joint_sensors]\ntopic = \"/j\"\n[tags]\n");
    check(&map).expect("missing", 2, &[]);
    let routine = folder.path().join("r.toml");
    write(&routine, "version = 1\nkind = \"routine\"\nrobot = \"a\"\nvehicle = \"b\"\n[task]\n");
    check(&routine).expect("routine", 2, &[]);
    let robot = robot_copy(folder.path());
    edit(&robot.join("robot.toml"), "mount_std_m", "mount_std");
    check(&robot).expect("robot", 2, &["robot.toml", "mount_std"]);
}

#[test]
fn a_rendered_run_says_at_its_start_how_long_it_takes() {
    let folder = temp();
    let routine = crate::support::ShortRoutine {
        tail: "[camera]\nmode = \"rendered\"\n[world.vehicle]\nmotion = \"adrift\"\n".to_owned(),
        ..crate::support::ShortRoutine::default()
    };
    // The run is refused before anything moves, so there is no prediction.
    let said = crate::support::run(&routine.write(folder.path()), &folder.path().join("out"));
    assert!(said.code == 2 && !said.stderr.contains("rendered"), "{said:#?}");
    let routine = crate::support::ShortRoutine {
        tail: "[camera]\nmode = \"rendered\"\n".to_owned(),
        poses: 3,
        held_out: 0,
        min_tags: 9,
        ..crate::support::ShortRoutine::default()
    };
    let said = crate::support::run(&routine.write(folder.path()), &folder.path().join("out"));
    let words = [" 30 images", "rendered", "capture.min_tags"];
    said.expect("too few tags", 2, &words);
}

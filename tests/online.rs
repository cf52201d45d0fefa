//! The online estimate on recordings of whole runs.

use std::fs;
use std::path::Path;

use crate::map::mapping_run;
use crate::support::{Answer, answer, edit, program, robot_copy, robot_folder, temp};

fn follow(recording: &Path, out: &Path) -> Answer {
    answer(program().arg("watch").arg(recording).arg("--robot").arg(robot_folder()).arg("--out").arg(out))
}

fn root(path: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The estimate ends as certain as the sample's batch, with the same bytes each time.
#[test]
fn a_recording_is_followed_and_its_belief_written() {
    let folder = temp();
    let outs = ["one", "two"].map(|name| folder.path().join(name));
    for out in &outs {
        let said = follow(&root("recordings/sample/run.mcap"), out);
        said.expect("the sample", 0, &["belief.jsonl"]);
    }
    let [one, two] = outs.map(|out| fs::read_to_string(out.join("belief.jsonl")).expect("written"));
    assert_eq!(one, two);
    let rows: Vec<serde_json::Value> = one.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let beliefs: Vec<&serde_json::Value> = rows.iter().filter_map(|row| row.get("belief")).collect();
    let median_m = |row: &serde_json::Value| row["tool_error_m"]["median"].as_f64().expect("a number");
    let (first, last) = (beliefs[0], beliefs[beliefs.len() - 1]);
    assert!(median_m(last) < 0.004, "{last}");
    assert!(median_m(last) < median_m(first), "{first} {last}");
    assert!(rows.iter().all(|row| row.get("event").is_none()), "nothing happened in the sample: {one}");
    let later = last["tool_error_in_an_hour_m"]["median"].as_f64().expect("a number");
    assert!(later > median_m(last), "without views the belief gets worse");
}

/// Without drift, views one by one give the result of the batch.
#[test]
fn a_stationary_belief_ends_at_the_batch() {
    let folder = temp();
    let mut command = program();
    command.args(["watch", "--stationary"]).arg(root("recordings/sample/run.mcap"));
    let said = answer(command.arg("--robot").arg(robot_folder()).arg("--out").arg(folder.path()));
    said.expect("the sample", 0, &["batch        accepted"]);
    let line = said.stdout.lines().find(|line| line.starts_with("difference")).expect("a line of the difference");
    let sigmas: f64 = line.split_whitespace().nth(3).and_then(|word| word.parse().ok()).expect("a number");
    assert!(sigmas < 0.1, "{line}");
    assert!(folder.path().join("belief.jsonl").exists());
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let folder = temp();
    let absent = folder.path().join("absent.mcap");
    let mut waiting = program();
    waiting.arg("watch").arg(&absent).args(["--idle-s", "1", "--robot"]).arg(robot_folder());
    answer(&mut waiting).expect("absent", 2, &["absent.mcap"]);
    let robot = robot_copy(folder.path());
    edit(&robot.join("robot.toml"), "joint = \"wrist_yaw\"", "joint = \"wrist_sway\"");
    edit(&robot.join("titan4.urdf"), "joint name=\"wrist_yaw\"", "joint name=\"wrist_sway\"");
    let mut other = program();
    other.arg("watch").arg(root("recordings/sample/run.mcap"));
    let said = answer(other.arg("--robot").arg(robot).arg("--out").arg(folder.path()));
    said.expect("another arm", 2, &["run.mcap", "wrist_sway"]);
    assert!(!folder.path().join("belief.jsonl").exists(), "nothing was written");
}

/// The angle of a joint with a dead sensor is unknown between views, so the arm is not good enough for any views.
#[test]
fn with_a_dead_sensor_the_arm_is_not_good_enough() {
    let folder = temp();
    let mut declared = program();
    declared.arg("watch").arg(root("recordings/sample/run.mcap"));
    declared.args(["--failed", "forearm_pitch=dead", "--robot"]).arg(robot_folder()).arg("--out").arg(folder.path());
    answer(&mut declared).expect("a dead forearm", 4, &[]);
}

/// Tags of unknown pose are mapped first; no estimate uses them before.
#[test]
fn tags_of_unknown_place_are_not_believed_in() {
    let folder = temp();
    let (run, _) = mapping_run();
    let n_views = |said: &Answer| -> usize {
        let line = said.stdout.lines().find_map(|line| line.strip_prefix("views ")).expect("a line");
        line.trim().parse().expect("a number")
    };
    let by_one = follow(&run.join("run.mcap"), folder.path());
    assert!(by_one.stderr.contains("tags 1, 2, 3, 4, 5, 6, 7"), "{by_one:#?}");
    let mut mapped = program();
    mapped.arg("watch").arg(run.join("run.mcap")).arg("--robot").arg(robot_folder());
    mapped.arg("--tag-map").arg(run.join("tagmap.toml")).arg("--out").arg(folder.path());
    let by_map = answer(&mut mapped);
    assert!(n_views(&by_map) > 2 * n_views(&by_one), "{by_map:#?}");
}

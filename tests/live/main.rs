//! Arms behind ROS 2 topics: the program on both ends, in a separate network namespace.
//!
//! Run `cargo test --release --features live --test live -- --ignored`; user namespaces must be allowed. `python3` must
//! have cyclonedds, websockets and rerun-sdk (tests/oracle/requirements.txt) for independent implementations of arm,
//! relay, rosbridge and viewer.

#![allow(clippy::print_stderr, reason = "figures of a test, for whoever reads its output")]

use std::path::{Path, PathBuf};
use std::process::Command;

use armcal::log::read_recording;
use armcal::sensor::ArmSensors;
use armcal::sim::truth::{Truth, read_truth};
use armcal::stats::quantile;
use armcal::streams::{MarkKind, Message, ReachAttempt};
use serde_json::Value;

mod discover;
mod faults;
mod hostile;
mod rosbridge;
#[path = "../support/mod.rs"]
#[allow(dead_code, reason = "the other tests use the rest")]
mod support;
mod viewer;

use crate::support::{Answer, ShortRoutine, answer, read, root, temp, titan, write};

/// Command that enters a namespace with only its own loopback.
const NAMESPACE: &str = "ip link set lo up multicast on && ip route add 239.0.0.0/8 dev lo && exec bash -c \"$@\"";
const CYCLONE: &str = "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\" multicast=\"true\"/>\
                       </Interfaces></General></Domain></CycloneDDS>";

/// Runs a script in a namespace; `$ARMCAL`, `$OUT` and `$ROUTINE` are set.
fn in_namespace(out: &Path, routine: &Path, script: &str) -> Answer {
    let mut command = Command::new("unshare");
    command.args(["-rn", "--pid", "--fork", "--kill-child", "bash", "-c", NAMESPACE, "netns", script]);
    command.env("ARMCAL", env!("CARGO_BIN_EXE_armcal")).env("OUT", out).env("ROUTINE", routine);
    command.env("CYCLONEDDS_URI", CYCLONE).env("PEER", root().join("tests/oracle/ros2_arm.py"));
    command.env("RELAY", root().join("tests/oracle/ros2_relay.py"));
    command.env("BRIDGE_SCRIPT", root().join("tests/oracle/ros2_rosbridge.py"));
    let answer = answer(command.current_dir(out));
    assert!(!answer.stderr.contains("unshare:"), "user namespaces are needed: {}", answer.stderr);
    answer
}

fn connection(out: &Path, more: &str) -> PathBuf {
    let file = out.join("arm.toml");
    write(&file, &format!("version = 1\nkind = \"arm\"\nnetworks = [\"127.0.0.1\"]\n{more}"));
    file
}

/// Distances of the true tool from the target at each reach of this kind, m.
fn reach_errors_m(recording: &Path, truth: &Truth, wanted: ReachAttempt) -> Vec<f64> {
    let recording = read_recording(recording).expect("the recording reads");
    let task = recording.messages.iter().find_map(|(_, message)| match message {
        Message::Task(task) => Some(task.targets_m.clone()),
        _ => None,
    });
    let task = task.expect("a task");
    let reaches = recording.messages.iter().filter_map(|(_, message)| match message {
        Message::Mark(mark) => match mark.kind {
            MarkKind::Reach { attempt, target_idx } if attempt == wanted => Some((*mark, target_idx as usize)),
            _ => None,
        },
        _ => None,
    });
    let error = |(mark, target): (armcal::streams::Mark, usize)| {
        let middle = mark.start.plus_s(0.5 * mark.end.since_s(mark.start));
        let tool = truth.state_at(middle).expect("the truth of that moment").base_from_tool;
        (nalgebra::Vector3::from(task[target]) - tool.origin().vector()).norm()
    };
    reaches.map(error).collect()
}

/// The whole loop over the wire at eight times real time: it is accepted, and reaches the targets that it missed
/// before. `calibrate` on the recording gives the same bytes.
#[test]
#[ignore = "needs user namespaces"]
fn a_served_arm_is_calibrated_and_reaches_its_targets() {
    let out = temp();
    let routine = ShortRoutine::default().write(out.path());
    connection(out.path(), "");
    let script = "$ARMCAL serve $ROUTINE --arm arm.toml --factor 8 --truth truth.mcap 2>serve.log & SERVER=$!; \
                  $ARMCAL drive $ROUTINE --arm arm.toml --unattended --details --out out; CODE=$?; \
                  kill -INT $SERVER; wait $SERVER; exit $CODE";
    let said = in_namespace(out.path(), &routine, script);
    said.expect("drive", 0, &["ACCEPTED", "time  "]);
    assert!(said.stderr.contains(" ms, 99 % "), "{}", said.stderr);
    let recording = out.path().join("out/run.mcap");
    let truth = read_truth(out.path().join("truth.mcap")).expect("the truth reads");
    assert!(truth.contacts.is_empty(), "{:?}", truth.contacts.first());
    let median = |attempt| quantile(&reach_errors_m(&recording, &truth, attempt), 0.5).expect("reaches");
    let (before_m, after_m) = (median(ReachAttempt::Before), median(ReachAttempt::After));
    assert!(before_m > 0.03 && after_m < 0.006, "{before_m} m before, {after_m} m after");

    let again = crate::support::calibrate(&recording, &crate::support::robot_folder(), &out.path().join("again"));
    again.expect("calibrate", 0, &[]);
    for file in ["calibration.toml", "calibration.covariance.toml"] {
        let [live, later] = ["out", "again"].map(|folder| read(&out.path().join(folder).join(file)));
        assert_eq!(live, later, "{file}");
    }

    let direct = crate::support::run(&routine, &out.path().join("direct"));
    direct.expect("run", 0, &["ACCEPTED"]);
    let worst = largest_difference_sigma(&out.path().join("direct"), &out.path().join("out"));
    assert!(worst < 4.5, "served and direct calibrations differ by {worst} sigma");
}

/// Largest difference of gain and offset, in sigmas, between two independent calibrations of the same sensors.
fn largest_difference_sigma(a: &Path, b: &Path) -> f64 {
    let joints = |folder: &Path| {
        let table: toml::Table = read(&folder.join("calibration.toml")).parse().expect("TOML");
        table["joint"].as_array().expect("joints").clone()
    };
    let mut worst = 0.0_f64;
    for (a, b) in joints(a).iter().zip(&joints(b)) {
        for (value, std) in [("offset_rad", "offset_std_rad"), ("gain_rad_per_count", "gain_std_rad_per_count")] {
            let of = |joint: &toml::Value, key: &str| joint.get(key).and_then(toml::Value::as_float);
            let stds = of(a, std).zip(of(b, std)).map(|(a, b)| a.hypot(b)).filter(|std| *std > 0.0);
            let difference = of(a, value).zip(of(b, value)).map(|(a, b)| (a - b).abs());
            worst = difference.zip(stds).map_or(worst, |(difference, std)| worst.max(difference / std));
        }
    }
    assert!(worst > 0.0, "nothing was compared");
    worst
}

/// The driver ends during a motion: the run ends soon after the last reading, and the recording is readable. A
/// restarted driver is received again.
#[test]
#[ignore = "needs user namespaces"]
fn a_run_whose_arm_dies_stops_and_keeps_its_recording() {
    let out = temp();
    let routine = ShortRoutine::default().write(out.path());
    connection(out.path(), "");
    let script = "serve() { exec $ARMCAL serve $ROUTINE --arm arm.toml --factor 5 2>serve.log; }; serve & SERVER=$!; \
                  $ARMCAL drive $ROUTINE --arm arm.toml --unattended --out out & RUN=$!; \
                  sleep 10; kill -9 $SERVER; date +%s.%N >killed; wait $RUN; CODE=$?; date +%s.%N >ended; \
                  serve & SERVER=$!; $ARMCAL drive $ROUTINE --arm arm.toml --no-motion; \
                  kill -INT $SERVER; wait $SERVER; exit $CODE";
    let said = in_namespace(out.path(), &routine, script);
    said.expect("drive", 1, &[]);
    assert!(said.stderr.contains("[readings_stale]") && said.stderr.contains("run-cut-1.mcap"), "{}", said.stderr);
    let heard = said.stderr.lines().filter(|line| line.starts_with("  shoulder_yaw ")).count();
    assert_eq!(heard, 2, "it is not heard again: {}", said.stderr);
    let [killed_s, ended_s] =
        ["killed", "ended"].map(|name| read(&out.path().join(name)).trim().parse::<f64>().expect("a time"));
    assert!(ended_s - killed_s < 5.0, "{} s", ended_s - killed_s);
    let recording = read_recording(out.path().join("out/run-cut-1.mcap")).expect("it reads");
    let is_told = |message: &Message| matches!(message, Message::Log(line) if line.name == "guard");
    assert!(recording.messages.iter().any(|(_, message)| is_told(message)), "the recording does not say why it ends");
}

/// The operator confirms the steps of one degree per joint, and refuses the first motion.
#[test]
#[ignore = "needs user namespaces"]
fn a_served_arm_follows_one_degree_at_a_time() {
    let out = temp();
    let routine = ShortRoutine::default().write(out.path());
    connection(out.path(), "");
    let script = "$ARMCAL serve $ROUTINE --arm arm.toml --factor 8 2>serve.log & SERVER=$!; \
                  (yes | head -n 12; echo a) | $ARMCAL drive $ROUTINE --arm arm.toml --nudge --out out; CODE=$?; \
                  kill -INT $SERVER; wait $SERVER; exit $CODE";
    let said = in_namespace(out.path(), &routine, script);
    said.expect("run --nudge", 1, &["[interrupted]"]);
    // The lines have the commanded, the read and the remaining angle.
    let told = said.stderr.lines().filter(|line| line.matches(" deg").count() == 3);
    assert_eq!(told.count(), titan().n_joints(), "{}", said.stderr);
}

/// A camera without a detector node: tags are found in the images that come over the wire.
#[test]
#[ignore = "needs user namespaces"]
fn images_of_a_served_camera_are_searched_for_tags() {
    let out = temp();
    let routine = root().join("routines/titan4-rendered.toml");
    // Rendering on a busy machine delays the readings.
    connection(out.path(), "detections = \"\"\n[guard]\nready_s = 10.0\nstale_s = 5.0\n");
    let script = "$ARMCAL serve $ROUTINE --arm arm.toml 2>serve.log & SERVER=$!; \
                  $ARMCAL drive $ROUTINE --arm arm.toml --no-motion; CODE=$?; \
                  kill -INT $SERVER; wait $SERVER; exit $CODE";
    let said = in_namespace(out.path(), &routine, script);
    said.expect("run --no-motion", 0, &[]);
    let words: Vec<&str> = said.stderr.split_whitespace().collect();
    let before =
        |word: &str| words.windows(2).find(|pair| pair[1] == word).and_then(|pair| pair[0].parse::<u32>().ok());
    let (images, tags) = (before("images").expect("images"), before("tags").expect("tags"));
    assert!(images >= 3 && tags >= images, "{}", said.stderr);
    assert!(!said.stderr.contains("[messages_rejected]"), "{}", said.stderr);
}

/// Writes start and rate of an arm of another make, counts: the stowed pose, and one and a half times its allowed rate.
fn write_peer_start(out: &Path) -> (Vec<f64>, Vec<f64>) {
    let robot = titan();
    let counts = ArmSensors::nominal(&robot).counts(&robot.stowed).to_vec();
    let rates: Vec<f64> = robot.sensors.iter().map(|s| 1.5 * s.max_rate_rad_s * s.counts_per_rad.abs()).collect();
    let wraps: Vec<f64> = robot.sensors.iter().map(|s| s.wrap_counts).collect();
    let start = serde_json::json!({
        "names": robot.joint_names(), "counts": counts, "rate_counts": rates, "wrap_counts": wraps,
    });
    write(&out.join("start.json"), &start.to_string());
    (counts, rates)
}

/// An arm with another middleware, in another language: it is read, it does not exceed its rate, and Ctrl-C stops it.
#[test]
#[ignore = "needs user namespaces and Python's cyclonedds"]
fn an_arm_of_another_make_is_read_moved_and_stopped() {
    let out = temp();
    let routine = ShortRoutine::default().write(out.path());
    connection(out.path(), "");
    let robot = titan();
    let (counts, rates) = write_peer_start(out.path());
    let wraps: Vec<f64> = robot.sensors.iter().map(|s| s.wrap_counts).collect();
    let way = |joint: usize, by: f64| (by + wraps[joint] / 2.0).rem_euclid(wraps[joint]) - wraps[joint] / 2.0;
    let script = "python3 $PEER peer.jsonl start.json & PEER=$!; \
                  $ARMCAL drive $ROUTINE --arm arm.toml --unattended --out out & RUN=$!; \
                  sleep 12; kill -INT $RUN; wait $RUN; CODE=$?; sleep 1; kill $PEER; exit $CODE";
    let said = in_namespace(out.path(), &routine, script);
    said.expect("drive", 1, &[]);
    assert!(said.stderr.contains("[interrupted]"), "{}", said.stderr);
    let log: Vec<Value> =
        read(&out.path().join("peer.jsonl")).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let set_points: Vec<(f64, Vec<f64>)> = log.iter().filter_map(set_point).collect();
    assert!(set_points.len() > 200, "{} set-points", set_points.len());
    for (joint, rate) in rates.iter().enumerate() {
        let moved = set_points.windows(2).map(|pair| way(joint, pair[1].1[joint] - pair[0].1[joint]).abs());
        // Two set-points may arrive at once; each one is within the motion of two periods.
        let most = moved.fold(0.0, f64::max);
        assert!(most <= rate / 1.5 * 1.2 * 0.02 * 1.01, "joint {joint}: {most} counts at once");
    }
    let travelled =
        |joint: usize| way(joint, set_points.last().expect("some").1[joint] - counts[joint]).abs() / rates[joint];
    assert!((0..rates.len()).any(|joint| travelled(joint) > 0.05), "it never moved");
    let stop = log.iter().position(|line| line["stop"] == true).expect("it was told to stop");
    assert!(log[stop..].iter().all(|line| set_point(line).is_none()), "a set-point after the stop");
}

fn set_point(line: &Value) -> Option<(f64, Vec<f64>)> {
    let positions = line["set_point"].as_array()?.iter().filter_map(Value::as_f64).collect();
    Some((line["at_s"].as_f64()?, positions))
}

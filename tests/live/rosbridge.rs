//! A served arm behind an independent rosbridge, with ROS 1 spelling.

use std::path::Path;

use serde_json::Value;

use super::{connection, in_namespace, reach_errors_m};
use armcal::log::read_recording;
use armcal::sim::truth::read_truth;
use armcal::stats::quantile;
use armcal::streams::{Message, ReachAttempt};

use crate::support::{ShortRoutine, calibrate, read, robot_folder, temp};

/// Ratio of the arm's time to ours.
const FACTOR: f64 = 8.0;
/// Longest time without readings, by our clock, s.
const STALE_S: f64 = 1.0;
/// Delay that a busy machine may add to a guaranteed time, and that the end of the program takes, s.
const BUSY_S: f64 = 1.0;

/// Writes the map of both sides: the server reads its topics, and ignores the bridge.
fn write_map(out: &Path) {
    let more = format!(
        "images = \"\"\n[rosbridge]\nurl = \"ws://127.0.0.1:9090\"\nros = 1\n[guard]\nstale_s = {STALE_S}\n\
         [stop]\nservice = \"/halt\"\n[commands]\ntype = \"trajectory_msgs/JointTrajectory\"\n"
    );
    connection(out, &more);
}

/// Script with the arm as $SERVER and the bridge as $BRIDGE.
fn with_bridge(script: &str) -> String {
    format!(
        "$ARMCAL serve $ROUTINE --arm arm.toml --factor {FACTOR} --truth truth.mcap 2>serve.log & SERVER=$!; \
         python3 $BRIDGE_SCRIPT bridge.jsonl 9090 & BRIDGE=$!; \
         until ss -ltn | grep -q 127.0.0.1:9090 || ! kill -0 $BRIDGE; do sleep 0.05; done; {script}"
    )
}

const END: &str = "CODE=$?; kill -KILL $BRIDGE; kill -INT $SERVER; wait $SERVER; exit $CODE";

/// Messages to the bridge, with their times.
fn told(out: &Path) -> Vec<(f64, Value)> {
    let line = |line: &str| {
        let value: Value = serde_json::from_str(line).expect("JSON");
        (value["at_s"].as_f64().expect("a time"), value)
    };
    read(&out.join("bridge.jsonl")).lines().map(line).collect()
}

/// The whole loop through JSON: it is accepted, and reaches the targets that it missed before. `calibrate` on the
/// recording gives the same bytes.
#[test]
#[ignore = "needs user namespaces, and Python's cyclonedds and websockets"]
fn an_arm_behind_a_rosbridge_is_calibrated_and_reaches_its_targets() {
    let out = temp();
    let routine = ShortRoutine::default().write(out.path());
    write_map(out.path());
    let run = "$ARMCAL drive $ROUTINE --arm arm.toml --unattended --details --out out;";
    let said = in_namespace(out.path(), &routine, &with_bridge(&format!("{run} {END}")));
    said.expect("drive", 0, &["ACCEPTED", " ms, 99 % "]);
    assert!(!said.stderr.contains("[messages_rejected]"), "{}", said.stderr);
    let told = told(out.path());
    assert!(
        told.iter().all(|(_, line)| line["error"].is_null()),
        "{:?}",
        told.iter().find(|l| l.1["error"].is_string())
    );
    let n_set_points = told.iter().filter(|(_, line)| line["set_point"].is_array()).count();
    assert!(n_set_points > 1000, "{n_set_points}");
    let recording = out.path().join("out/run.mcap");
    let truth = read_truth(out.path().join("truth.mcap")).expect("the truth reads");
    assert!(truth.contacts.is_empty(), "{:?}", truth.contacts.first());
    let median_m = |attempt| quantile(&reach_errors_m(&recording, &truth, attempt), 0.5).expect("reaches");
    let (before_m, after_m) = (median_m(ReachAttempt::Before), median_m(ReachAttempt::After));
    eprintln!("rosbridge: {:.1} mm before, {:.1} mm after\n{}", 1e3 * before_m, 1e3 * after_m, said.stderr);
    assert!(before_m > 0.03 && after_m < 0.006, "{before_m} m before, {after_m} m after");
    calibrate(&recording, &robot_folder(), &out.path().join("again")).expect("calibrate", 0, &[]);
    for file in ["calibration.toml", "calibration.covariance.toml"] {
        let [live, later] = ["out", "again"].map(|folder| read(&out.path().join(folder).join(file)));
        assert_eq!(live, later, "{file}");
    }
}

/// A bridge that ends also ends the run at once; one that hangs has the effect of missing readings. A stopped run tells
/// the arm so, in both ways.
#[test]
#[ignore = "needs user namespaces, and Python's cyclonedds and websockets"]
fn a_bridge_that_dies_or_hangs_stops_the_run_and_a_stop_goes_over_it() {
    for (signal, limit_s, word) in [
        ("KILL $BRIDGE", 0.0, "[arm_connection]"),
        ("STOP $BRIDGE", STALE_S, "[readings_stale]"),
        ("INT $RUN", 0.0, "[interrupted]"),
    ] {
        let out = temp();
        let routine = ShortRoutine::default().write(out.path());
        write_map(out.path());
        let run = format!(
            "$ARMCAL drive $ROUTINE --arm arm.toml --unattended --out out & RUN=$!; \
             until [ $(grep -cs set_point bridge.jsonl) -gt 500 ] || ! kill -0 $RUN; do sleep 0.05; done; \
             date +%s.%N >signal; kill -{signal}; wait $RUN; CODE=$?; date +%s.%N >ended; \
             kill -CONT $BRIDGE; sleep 0.5; (exit $CODE); {END}"
        );
        let said = in_namespace(out.path(), &routine, &with_bridge(&run));
        said.expect(signal, 1, &["run-cut-1.mcap"]);
        assert!(said.stderr.contains(word), "{signal}: {}", said.stderr);
        let time_s = |name: &str| read(&out.path().join(name)).trim().parse::<f64>().expect("a time");
        let (signal_s, told) = (time_s("signal"), told(out.path()));
        let recording = out.path().join("out/run-cut-1.mcap");
        let messages = read_recording(&recording).expect("it reads").messages;
        let is_why = |(_, message): &(_, Message)| matches!(message, Message::Log(line) if line.text.contains(word));
        let is_told = messages.iter().any(is_why) || signal == "INT $RUN";
        assert!(is_told, "{signal}: the recording does not say why it ends");
        let after_s = time_s("ended") - signal_s;
        eprintln!("{signal}: the program ended {after_s:.2} s later");
        assert!(after_s < limit_s + BUSY_S, "{signal}: {after_s} s");
        let stops: Vec<usize> = (0..told.len()).filter(|n| told[*n].1["stop"] == true).collect();
        let n_set_points = |from: usize| told[from..].iter().filter(|(_, l)| l["set_point"].is_array()).count();
        if let Some(stop) = stops.first() {
            assert_eq!(n_set_points(*stop), 0, "{signal}: a set-point after the stop");
        }
        // A bridge that hangs or has ended may pass on nothing.
        if signal == "INT $RUN" {
            assert_eq!(stops.len(), 1, "{signal}");
            assert!(told.iter().any(|(_, line)| line["service"] == "/halt"), "{signal}: no call of the service");
        }
    }
}

//! Sensors of which nobody knows more than 8 % and 8 degrees: the arm finds its way without touching anything.

use std::path::Path;

use armcal::calib::Status;
use armcal::report::RunSummary;

use crate::support::{answer, program, read, root, temp};

const ROUTINES: [&str; 3] = ["uncalibrated-open-frame", "uncalibrated-tight-basket", "uncalibrated-ice-shelf"];
const ARMS: [&str; 2] = ["titan4-uncalibrated", "kraft-predator-uncalibrated"];

fn run(routine: &str, arm: &str, seed: u64, more: &[&str], out: &Path) -> RunSummary {
    let mut command = program();
    command.arg("run").arg("--details").arg(root().join(format!("routines/{routine}.toml")));
    command.arg("--robot").arg(root().join("robots").join(arm)).args(["--seed", &seed.to_string()]);
    for set in more {
        command.args(["--set", set]);
    }
    let said = answer(command.arg("--out").arg(out));
    assert!(out.join("summary.json").exists(), "{routine}, {arm}, seed {seed}: {said:?}");
    serde_json::from_str(&read(&out.join("summary.json"))).expect("a summary")
}

/// One seed of each arm on each vehicle; the study has hundreds (docs/theory/planning.md).
#[test]
fn no_contact_on_the_way_to_a_good_calibration() {
    let (mut links, mut beyond) = (0, 0);
    for (n, routine) in ROUTINES.iter().enumerate() {
        for (k, arm) in ARMS.iter().enumerate() {
            let folder = temp();
            let seed = 1 + (2 * n + k) as u64;
            let summary = run(routine, arm, seed, &[], folder.path());
            let name = format!("{routine}, {arm}, seed {seed}");
            assert_eq!(summary.status, Status::Accepted, "{name}: {:?}", summary.refusal);
            assert_eq!(summary.capture.collisions, Some(0), "{name}");
            let after = summary.score.expect("scored").after.expect("reached").tool_error_m.expect("targets");
            assert!(after.median < 0.005, "{name}: {after:?}");
            assert!(summary.capture.renewals.len() >= 3, "{name}: {:?}", summary.capture.renewals);
            let margins = summary.capture.margins.expect("views");
            assert!(margins.first_largest_m.is_some_and(|first_m| first_m > 0.02), "{name}: {margins:?}");
            (links, beyond) = (links + margins.links, beyond + margins.exceeded_q99);
            let [first, last] = [0, summary.capture.renewals.len() - 1].map(|k| summary.capture.renewals[k]);
            assert!(last.predicted_tool_error_m < 0.2 * first.predicted_tool_error_m, "{name}");
        }
    }
    // Links of one run share their arm: six runs are not many.
    assert!(beyond * 100 < links * 5, "{beyond} of {links}");
}

/// The worlds are hard: planned once for the believed arm, without margins for wrong sensors, arms do touch things.
#[test]
fn without_margins_arms_collide() {
    let folder = temp();
    let more = ["capture.margins=\"off\"", "capture.replan_every=0"];
    let contacts = (1..=4).map(|seed| {
        let out = folder.path().join(seed.to_string());
        run(ROUTINES[1], ARMS[0], seed, &more, &out).capture.collisions.expect("truth")
    });
    let contacts: Vec<usize> = contacts.collect();
    assert!(contacts.iter().any(|n| *n > 0), "{contacts:?}");
}

#[test]
fn a_capture_that_plans_as_it_goes_gives_the_same_bytes_again() {
    let folder = temp();
    let bytes = |name: &str| {
        let out = folder.path().join(name);
        run(ROUTINES[0], ARMS[0], 3, &[], &out);
        ["run.mcap", "calibration.toml"].map(|file| std::fs::read(out.join(file)).expect("a file"))
    };
    assert!(bytes("a") == bytes("b"));
}

/// Why there were no more views is said: the time was over, or the tolerance reached.
#[test]
fn a_capture_says_why_it_ended() {
    let folder = temp();
    let ended = |name: &str, more: &[&str]| {
        run(ROUTINES[2], ARMS[0], 2, more, &folder.path().join(name)).capture.stop_reason.expect("a reason")
    };
    let by_error = ended("error", &[]);
    assert!(by_error.contains("predicted tool error"), "{by_error}");
    let by_poses = ended("poses", &["capture.stop_at_tool_error_m=0.0001", "capture.poses=12"]);
    assert!(by_poses.contains("all planned views"), "{by_poses}");
    let by_time = ended("time", &["capture.stop_at_tool_error_m=0.0001", "capture.max_time_s=110.0"]);
    assert!(by_time.contains("time"), "{by_time}");
}

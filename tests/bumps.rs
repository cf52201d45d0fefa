//! Obstacles that are in no description: the arm touches them, notices, and goes back; it never reports a bump without
//! a touch.

use std::fs::File;
use std::path::Path;
use std::process::Stdio;

use armcal::calib::Calibration;
use armcal::log::read_recording;
use armcal::sim::truth::{Truth, TruthClearance, read_truth};
use armcal::stats::Summary;
use armcal::streams::{LogLevel, Message};
use armcal::time::Stamp;

use crate::support::{
    Answer, FinishedRun, ShortRoutine, Simulated, answer, finished, program, root, shared, temp, write,
};

/// Age of a touch above which it has been noticed late, s.
const NOTICED_S: f64 = 1.0;
/// Duration below which a touch pushes no joint as far as a bump does, s.
const BRUSH_S: f64 = 0.6;
/// Largest time from noticing until the arm is back where it came from, s.
const BACK_S: f64 = 40.0;

/// An obstacle at the fourth target of the short routine, in the vehicle's frame: the base is at (1.7, -0.6, 0.1).
const ROCK: &str = "[[world.obstacle]]\nname = \"undrawn\"\nshape = \"sphere\"\nradius_m = 0.2\n\
                    position_m = [3.306, -0.735, 0.585]\n";

fn logged(recording: &Path, word: &str) -> Vec<(Stamp, LogLevel, String)> {
    let recording = read_recording(recording).expect("the recording reads");
    let lines = recording.messages.into_iter().filter_map(|(_, message)| match message {
        Message::Log(line) if line.text.contains(word) => Some((line.stamp, line.level, line.text)),
        _ => None,
    });
    lines.collect()
}

/// Time since the latest touch of the arm before `stamp` began, s; `None` where there was none.
fn touched_before_s(truth: &Truth, stamp: Stamp) -> Option<f64> {
    let ages = truth.contacts.iter().map(|contact| stamp.since_s(contact.stamp)).filter(|age_s| *age_s >= -0.02);
    ages.min_by(f64::total_cmp)
}

#[test]
fn an_undrawn_rock_is_noticed_left_alone_and_calibrated_around() {
    let folder = temp();
    let run = finished(&ShortRoutine { tail: ROCK.to_owned(), ..ShortRoutine::default() }, folder.path());
    let summary = run.summary();
    let truth = read_truth(run.file("truth.mcap")).expect("the truth reads");
    let bumps = logged(&run.file("run.mcap"), "bump: ");
    eprintln!("{} contacts, bumps {bumps:?}", truth.contacts.len());
    assert!(summary.capture.collisions.is_some_and(|n| n > 0), "the rock is there");
    assert!(truth.contacts.iter().any(|c| c.part_a == "undrawn" || c.part_b == "undrawn"), "{:?}", truth.contacts);
    assert!(!bumps.is_empty());
    assert!(summary.capture.targets_skipped >= 1, "the rock lies in the target");
    skipped_targets_are_named(&run);
    for (stamp, level, text) in &bumps {
        assert_eq!(*level, LogLevel::Warn);
        let age_s = touched_before_s(&truth, *stamp).expect("something was touched");
        assert!(age_s < 5.0, "{text}: {age_s} s after the last touch began");
        // The touch ends: some time later nothing is near.
        let after = |seconds: f64| stamp.plus_s(seconds);
        let freed =
            truth.clearances.iter().any(|c| c.stamp > after(0.5) && c.stamp < after(BACK_S) && c.distance_m > 0.02);
        assert!(freed, "{text}");
    }
    // A touch after a time without one is noticed at once, unless it is brief and over at once.
    let mut last: Option<Stamp> = None;
    for contact in &truth.contacts {
        let is_first = last.is_none_or(|last| contact.stamp.since_s(last) > BACK_S);
        last = Some(contact.stamp);
        let noticed = bumps.iter().any(|(stamp, ..)| (-0.02..NOTICED_S).contains(&stamp.since_s(contact.stamp)));
        let soon = |c: &TruthClearance| (0.0..BRUSH_S).contains(&c.stamp.since_s(contact.stamp));
        let clear = |c: &TruthClearance| soon(c) && c.distance_m > 0.02;
        assert!(!is_first || noticed || truth.clearances.iter().any(clear), "{contact:?} in {bumps:?}");
    }
    // The estimator has no data on the rock: no input names it, only the bump reports do.
    let bytes = String::from_utf8_lossy(&run.bytes("run.mcap")).into_owned();
    assert!(!bytes.contains("undrawn"));
}

/// Every report of a run names the reason; errors before and after are over the same targets.
fn skipped_targets_are_named(run: &FinishedRun) {
    let summary = run.summary();
    let skipped = &summary.capture.skipped_targets;
    assert_eq!(skipped.len(), summary.capture.targets_skipped);
    let html = String::from_utf8(run.bytes("report.html")).expect("text");
    let lines = logged(&run.file("run.mcap"), "a target is left out: ");
    for one in skipped {
        assert!(one.target == 3 && one.reason.contains("met something"), "{one}");
        assert!(html.contains(&one.to_string()) && lines.iter().any(|(.., text)| text.contains(&one.to_string())));
    }
    let score = summary.score.expect("a score");
    let after = score.after.expect("accepted");
    assert!(!score.compared_targets.contains(&3), "{:?}", score.compared_targets);
    assert_eq!((score.before.targets, after.targets), (5, 5));
    let n = |side: Option<Summary>| side.map(|summary| summary.n);
    assert_eq!(n(score.before.tool_error_m), Some(score.compared_targets.len()));
    assert_eq!(n(after.tool_error_m), Some(score.compared_targets.len()));
}

/// A result "4 of 5" with a skipped target does not satisfy "all".
#[test]
fn limits_of_hits_and_skipped_targets_fail_a_run_that_hits_few() {
    let folder = temp();
    let steps = "[[step]]\ndo = \"capture\"\n[[step]]\ndo = \"calibrate\"\n[[step]]\ndo = \"reach\"\n[[step]]\n\
                 do = \"assert\"\nhits = 5\ntargets_skipped = 0\nposes = 10\nposes_skipped = 9\n";
    let routine = ShortRoutine { tail: format!("{ROCK}{steps}"), ..ShortRoutine::default() }.write(folder.path());
    let told = crate::support::run(&routine, &folder.path().join("out"));
    let words = ["FAILS: step 4, hits 5, measured 4", "FAILS: step 4, targets_skipped 0, measured 1", "4 of 5"];
    told.expect("skipped", 4, &words);
    told.expect("named", 4, &["step 3, target 4", "holds: step 4, poses 10"]);
}

/// Runs a routine and expects a touch in the truth for each bump that the arm noticed.
#[track_caller]
fn expect_no_bump_without_a_touch(routine: &Path, seed: u64, settings: &[(&str, toml::Value)], out: &Path) {
    let run = Simulated::new(routine, Some(seed), settings, out);
    // With a locked joint there may be no view; that is no bump either, and the recording stays.
    let truth = read_truth(run.file("truth")).expect("the truth reads");
    for (stamp, _, text) in logged(&run.file("run"), "bump: ") {
        let touched_s = touched_before_s(&truth, stamp);
        assert!(touched_s.is_some_and(|age_s| age_s < 5.0), "{}: {text}: {touched_s:?}", routine.display());
    }
}

/// One run has a joint that is declared locked, the other rough water and worn sensors.
#[test]
fn nothing_is_bumped_into_where_there_is_nothing() {
    const LOCKED: &str = "[[failed_joint]]\njoint = \"wrist_yaw\"\nkind = \"locked\"\n\
                          [[world.fault]]\nat_s = 0.5\nkind = \"joint_locked\"\njoint = \"wrist_yaw\"\n";
    const ROUGH: &str = "[world.vehicle]\nrotation_rms_rad = 0.035\ntranslation_rms_m = 0.12\nperiod_min_s = 4.0\n\
                         [world.joint_sensors]\nnonlinearity_peak = 0.005\nnoise_rms_counts = 8.0\n\
                         backlash_rad = 0.0017\n";
    for (seed, tail) in [(11, LOCKED), (2, ROUGH)] {
        let folder = temp();
        let routine = ShortRoutine { tail: tail.to_owned(), ..ShortRoutine::default() }.write(folder.path());
        expect_no_bump_without_a_touch(&routine, seed, &[], &folder.path().join("out"));
    }
}

/// Ten ordinary runs, including rough water, worn sensors and a floating vehicle.
#[test]
#[ignore = "second tier: 10 routines of the project, 35 s"]
fn nothing_is_bumped_into_in_ten_routines() {
    let names = [
        "titan4-quickstart",
        "rough-sea",
        "worn-sensors",
        "free-vehicle",
        "tight-basket",
        "kraft-open-frame",
        "under-ice",
        "all-effects",
        "recorded-motion",
        "slipped-sensor",
    ];
    for (name, seed) in names.into_iter().zip(1..) {
        let folder = temp();
        let few = [("capture.poses", 12.into()), ("capture.held_out", 0.into())];
        expect_no_bump_without_a_touch(&root().join(format!("routines/{name}.toml")), seed, &few, folder.path());
    }
}

fn confirmed(routine: &Path, out: &Path, answers: &str, folder: &Path) -> Answer {
    let file = folder.join("answers");
    write(&file, answers);
    let stdin = Stdio::from(File::open(&file).expect("opened"));
    answer(program().arg("run").arg("--details").arg(routine).arg("--confirm").arg("--out").arg(out).stdin(stdin))
}

#[test]
fn an_operator_approves_holds_and_aborts() {
    let folder = temp();
    let routine = ShortRoutine::default().write(folder.path());
    let out = |name: &str| folder.path().join(name);
    // Without an answer nothing moves.
    let none = confirmed(&routine, &out("none"), "", folder.path());
    none.expect("no answer", 1, &["next: ", "recording"]);
    let kept = out("none").join("run-cut-1.mcap");
    assert_eq!(logged(&kept, "approved: ").len(), 0);
    assert_eq!(logged(&kept, "aborted").len(), 1);
    // Two motions, a hold before the second, an invalid answer before the third, and an abort.
    let some = confirmed(&routine, &out("some"), "y\nh\n\nmaybe\na\n", folder.path());
    some.expect("aborted", 1, &[]);
    let kept = out("some").join("run-cut-1.mcap");
    let approved = logged(&kept, "approved: ");
    assert_eq!(approved.len(), 2, "{approved:?}");
    assert!(approved[0].2.contains("m clear") && approved[0].2.contains("deg"), "{approved:?}");
    let held = logged(&kept, "held ");
    assert_eq!(held.len(), 1);
    assert!(approved[1].0.since_s(held[0].0) >= 5.0, "it waits");
    assert_eq!(logged(&kept, "aborted").len(), 1);
    // With every motion approved, the run equals the run without confirmation.
    let all = confirmed(&routine, &out("all"), &"y\n".repeat(2000), folder.path());
    all.expect("approved", 0, &["ACCEPTED"]);
    let free = shared(&ShortRoutine::default());
    let [confirmed, free] =
        [&out("all"), &free.out].map(|out| Calibration::read(&out.join("calibration.toml")).expect("it reads"));
    assert_eq!(confirmed.joint, free.joint);
}

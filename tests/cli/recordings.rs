//! Recordings that are of other programs, cut or damaged: readable data is used, and losses are reported.

use std::fs;
use std::path::{Path, PathBuf};

use armcal::calib::calibrate as estimate;
use armcal::log::{Completeness, RecordingHeader, RecordingWriter, read_recording};
use armcal::routine::Method;
use armcal::stats::stream_rng;
use armcal::streams::{CaptureSet, MarkKind, Message, Sink};
use rand::RngExt;

use crate::support::synthetic::TrueArm;
use crate::support::texts::Texts;
use crate::support::{
    Answer, answer, calibrate, edit, program, read, robot_copy, robot_folder, shared_run, temp, titan,
};

fn calibrate_bytes(bytes: &[u8], folder: &Path) -> Answer {
    let path = folder.join("given.mcap");
    fs::write(&path, bytes).expect("written");
    calibrate(&path, &robot_folder(), &folder.join("out"))
}

#[test]
fn what_is_no_recording_is_refused_by_name() {
    let _texts = Texts::of("what_is_no_recording_is_refused_by_name");
    let folder = temp();
    let absent = folder.path().join("absent.mcap");
    calibrate(&absent, &robot_folder(), folder.path()).expect("absent", 2, &["absent.mcap"]);
    calibrate(folder.path(), &robot_folder(), folder.path()).expect("a folder", 2, &[]);
    calibrate_bytes(b"", folder.path()).expect("empty", 2, &["given.mcap", "empty"]);
    calibrate_bytes(b"\x89MCAP", folder.path()).expect("cut in the magic", 2, &["given.mcap"]);
    calibrate_bytes(b"#ROSBAG V2.0\n and more", folder.path()).expect("a bag", 2, &["given.mcap"]);
    calibrate_bytes(&[0; 4096], folder.path()).expect("zeros", 2, &["given.mcap"]);
    assert!(!folder.path().join("out").exists(), "nothing was written");
}

#[test]
fn a_recording_without_any_message_is_refused() {
    let folder = temp();
    let path = folder.path().join("silent.mcap");
    RecordingWriter::create(&path, RecordingHeader::new(titan().joint_names()))
        .expect("a file")
        .finish()
        .expect("finished");
    calibrate(&path, &robot_folder(), &folder.path().join("out")).expect("silent", 2, &["silent.mcap"]);
}

/// A recording of an arm that stood still, without marks of views.
#[test]
fn a_recording_without_captures_is_refused_with_the_reason() {
    let _texts = Texts::of("a_recording_without_captures_is_refused_with_the_reason");
    let folder = temp();
    let path = folder.path().join("idle.mcap");
    let robot = titan();
    let mut rng = stream_rng(1, "idle");
    let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
    let mut writer = RecordingWriter::create(&path, RecordingHeader::new(robot.joint_names())).expect("a file");
    for (log_time, message) in arm.messages(&arm.shots(CaptureSet::Fit, 3, &mut rng)) {
        if !matches!(message, Message::Mark(_)) {
            writer.record(log_time, &message).expect("recorded");
        }
    }
    writer.finish().expect("finished");
    let out = folder.path().join("out");
    calibrate(&path, &robot_folder(), &out).expect("idle", 2, &["idle.mcap", "/marks"]);
}

#[test]
fn tags_that_the_survey_does_not_know_are_named() {
    let _texts = Texts::of("tags_that_the_survey_does_not_know_are_named");
    let folder = temp();
    let robot = robot_copy(folder.path());
    let file = robot.join("robot.toml");
    for id in 1..8 {
        edit(&file, &format!("\nid = {id}\n"), &format!("\nid = {}\n", id + 100));
    }
    edit(&file, "\nid = 0\n", "\nid = 100\n");
    edit(&file, "base_tag = 0", "base_tag = 100");
    let recording = shared_run().file("run.mcap");
    calibrate(&recording, &robot, &folder.path().join("out")).expect("other tags", 2, &["107"]);
}

#[test]
fn a_recording_of_another_arm_is_refused_with_both_joint_lists() {
    let folder = temp();
    let robot = robot_copy(folder.path());
    edit(&robot.join("robot.toml"), "joint = \"wrist_yaw\"", "joint = \"wrist_sway\"");
    edit(&robot.join("titan4.urdf"), "joint name=\"wrist_yaw\"", "joint name=\"wrist_sway\"");
    let recording = shared_run().file("run.mcap");
    let words = ["run.mcap", "wrist_yaw", "wrist_sway"];
    calibrate(&recording, &robot, &folder.path().join("out")).expect("another arm", 2, &words);
}

/// Number of capture marks in the recording at `path`.
fn marks_in(path: &Path) -> usize {
    let recording = read_recording(path).expect("it reads");
    let is_capture = |m: &Message| matches!(m, Message::Mark(mark) if matches!(mark.kind, MarkKind::Capture { .. }));
    recording.messages.iter().filter(|(_, message)| is_capture(message)).count()
}

#[test]
fn a_recording_cut_after_the_captures_calibrates_as_if_whole() {
    let run = shared_run();
    let folder = temp();
    let bytes = run.bytes("run.mcap");
    let cut = &bytes[..bytes.len() * 95 / 100];
    let answer = calibrate_bytes(cut, folder.path());
    assert_eq!(marks_in(&folder.path().join("given.mcap")), marks_in(&run.file("run.mcap")));
    answer.expect("cut at 95 %", 3, &["given.mcap", "cut", "ACCEPTED"]);
    assert!(read(&folder.path().join("out/calibration.toml")) == read(&run.file("calibration.toml")));
}

/// Any cut gives one of three results, each reported: calibrated with a warning, refused by the verdict, or nothing to
/// fit.
#[test]
fn a_recording_cut_anywhere_is_read_as_far_as_it_goes() {
    let run = shared_run();
    let bytes = run.bytes("run.mcap");
    let mut seen = Vec::new();
    for percent in [1, 5, 20, 35, 50, 65, 80, 99] {
        let folder = temp();
        let answer = calibrate_bytes(&bytes[..bytes.len() * percent / 100], folder.path());
        assert!(answer.stderr.contains("cut"), "{percent} %: {answer:#?}");
        match answer.code {
            2 => assert!(answer.stderr.contains("error: ") && answer.stderr.contains("given.mcap"), "{answer:#?}"),
            3 => assert!(answer.stdout.contains("ACCEPTED"), "{answer:#?}"),
            4 => assert!(answer.stdout.contains("REFUSED"), "{answer:#?}"),
            other => panic!("{percent} %: exit code {other}: {answer:#?}"),
        }
        seen.push(answer.code);
    }
    eprintln!("exit codes {seen:?}");
    assert!(seen[0] == 2 && seen.last() == Some(&3), "{seen:?}");
    assert!(
        seen.is_sorted_by_key(|code| [2, 4, 3].iter().position(|c| c == code)),
        "more data, better result: {seen:?}"
    );
}

/// The records of a finished file before the end of its data, and the rest.
fn data_records(bytes: &[u8]) -> (Vec<&[u8]>, &[u8]) {
    let (mut records, mut at) = (Vec::new(), 8);
    while bytes[at] != 15 {
        let len = 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("8 bytes")) as usize;
        records.push(&bytes[at..at + len]);
        at += len;
    }
    (records, &bytes[at..])
}

/// Chunks are sorted and read once, so the result does not change. A warning says that the file is not in order.
#[test]
fn chunks_swapped_or_doubled_calibrate_as_if_whole() {
    let run = shared_run();
    let bytes = run.bytes("run.mcap");
    let (records, tail) = data_records(&bytes);
    let chunks: Vec<usize> = (0..records.len()).filter(|&n| records[n][0] == 6).collect();
    let (early, late) = (chunks[chunks.len() / 3], chunks[chunks.len() / 2]);
    let mut swapped = records.clone();
    swapped.swap(early, late);
    let mut doubled = records.clone();
    doubled.insert(late, records[early]);
    for records in [swapped, doubled] {
        let folder = temp();
        let answer = calibrate_bytes(&[&bytes[..8], &records.concat(), tail].concat(), folder.path());
        answer.expect("chunks", 3, &["given.mcap", "damaged", "ACCEPTED"]);
        assert!(read(&folder.path().join("out/calibration.toml")) == read(&run.file("calibration.toml")));
    }
}

/// A flipped bit may cost data, but never silently and never a crash.
#[test]
fn flipped_bits_never_panic_and_never_change_the_result_silently() {
    let run = shared_run();
    let robot = titan();
    let whole = run.bytes("run.mcap");
    let expected = estimate(&read_recording(run.file("run.mcap")).expect("it reads"), &robot, Method::MinimumDistance)
        .expect("calibrated");
    let folder = temp();
    let path = folder.path().join("flipped.mcap");
    let mut rng = stream_rng(1, "flips");
    let (mut damaged, mut changed) = (0, 0);
    for round in 0..40 {
        let mut bytes = whole.clone();
        // One bit in even rounds, a burst in odd ones; every fifth near an end, which holds the structure.
        let span = if round % 5 == 0 { 4096 } else { bytes.len() };
        let at = if round % 10 == 0 { bytes.len() - 1 - rng.random_range(0..span) } else { rng.random_range(0..span) };
        for k in 0..if round % 2 == 0 { 1 } else { 300 } {
            let at = (at + k).min(bytes.len() - 1);
            bytes[at] ^= 1 << rng.random_range(0..8);
        }
        fs::write(&path, &bytes).expect("written");
        let Ok(recording) = read_recording(&path) else {
            damaged += 1;
            continue;
        };
        let is_whole = recording.completeness == Completeness::Whole && recording.rejected.is_empty();
        damaged += u32::from(!is_whole);
        let result = estimate(&recording, &robot, Method::MinimumDistance);
        let is_same = result.as_ref().is_ok_and(|calibration| *calibration == expected);
        changed += u32::from(!is_same);
        assert!(is_same || !is_whole, "round {round}, byte {at}: {:?}", result.err());
    }
    eprintln!("{damaged} of 40 told of damage, {changed} results changed");
    assert!(damaged > 20, "{damaged}");
}

#[test]
fn a_damaged_recording_says_so_at_the_command_line() {
    let mut bytes = shared_run().bytes("run.mcap");
    let folder = temp();
    // Three places are tried, because one may lie in an index of a chunk, which no reader needs.
    for at in [3, 4, 5].map(|eighths| bytes.len() / 8 * eighths) {
        bytes[at..at + 64].fill(0x55);
    }
    let answer = calibrate_bytes(&bytes, folder.path());
    assert!([2, 3, 4].contains(&answer.code), "{answer:#?}");
    assert!(answer.stderr.contains("damaged"), "{answer:#?}");
}

fn replayed(recording: &Path, save: &Path) -> Answer {
    answer(program().arg("replay").arg(recording).arg("--save").arg(save))
}

#[test]
fn replay_writes_a_file_for_the_viewer() {
    /// First bytes of Rerun's files.
    const MAGIC: &[u8] = b"RRF2";
    let run = shared_run();
    let folder = temp();
    let save = folder.path().join("x.rrd");
    replayed(&run.file("run.mcap"), &save).expect("replay", 0, &["x.rrd"]);
    let written = fs::read(&save).expect("written");
    assert!(written.starts_with(MAGIC) && written.len() > 100_000, "{} bytes", written.len());
    assert!(fs::metadata(run.file("run.rrd")).expect("made by the run").len() > 100_000);

    // The recording is cut, and has no truth next to it.
    let cut: PathBuf = folder.path().join("cut.mcap");
    let bytes = run.bytes("run.mcap");
    fs::write(&cut, &bytes[..bytes.len() / 2]).expect("written");
    let answer = answer(program().arg("replay").arg(&cut).arg("--robot").arg(robot_folder()).arg("--save").arg(&save));
    answer.expect("cut", 3, &["cut.mcap", "cut"]);
    assert!(fs::read(&save).expect("written").starts_with(MAGIC));
}

/// Files next to a recording are shown with it; none of them is replaced by the replay.
#[test]
fn replay_overwrites_no_file_that_it_reads() {
    let folder = temp();
    let names = ["run.mcap", "calibration.toml", "truth.mcap"];
    for name in names {
        fs::copy(shared_run().file(name), folder.path().join(name)).expect("copied");
    }
    let recording = folder.path().join("run.mcap");
    for name in names {
        replayed(&recording, &folder.path().join(name)).expect(name, 2, &[name, "[file_format]"]);
        let kept = fs::read(folder.path().join(name)).expect("it is there");
        assert!(kept == shared_run().bytes(name), "{name}");
    }
    let renamed = folder.path().join("run.rrd");
    fs::copy(&recording, &renamed).expect("copied");
    replayed(&renamed, &renamed).expect("itself", 2, &["run.rrd", "[file_exists]"]);
    assert!(fs::read(&renamed).expect("it is there") == shared_run().bytes("run.mcap"));
}

#[test]
fn replay_of_what_cannot_be_shown_says_why() {
    let folder = temp();
    let save = folder.path().join("x.rrd");
    let bare = folder.path().join("bare.mcap");
    armcal::log::strip(shared_run().file("run.mcap"), &bare).expect("stripped");
    let answer = replayed(&bare, &save);
    assert!([1, 2].contains(&answer.code) && answer.stderr.contains("bare.mcap"), "{answer:#?}");
    assert!(answer.stderr.contains("--robot"), "{answer:#?}");
    replayed(&folder.path().join("absent.mcap"), &save).expect("absent", 2, &["absent.mcap"]);
    let answer = replayed(&shared_run().file("run.mcap"), &folder.path().join("no/such/x.rrd"));
    assert!([1, 2].contains(&answer.code) && answer.stderr.contains("x.rrd"), "{answer:#?}");
}

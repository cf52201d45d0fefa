//! The output of `inspect` for recordings: complete, broken and of other programs.

use std::fs;
use std::path::Path;

use armcal::log::{RecordingHeader, RecordingWriter, RosMessage, ros};
use armcal::report::inspection::{State, inspect as look};
use armcal::stats::stream_rng;
use armcal::time::SIMULATION_EPOCH;
use rand::RngExt;

use crate::support::texts::Texts;
use crate::support::{Answer, answer, calibrate, edit, program, robot_copy, robot_folder, root, temp, titan};

fn sample() -> std::path::PathBuf {
    root().join("recordings/sample/run.mcap")
}

fn inspect(recording: &Path, more: &[&str]) -> Answer {
    answer(program().arg("inspect").arg(recording).args(more))
}

fn inspect_bytes(bytes: &[u8], folder: &Path) -> Answer {
    let path = folder.join("given.mcap");
    fs::write(&path, bytes).expect("written");
    inspect(&path, &[])
}

#[test]
fn the_sample_is_described() {
    let _texts = Texts::of("the_sample_is_described");
    let words = [
        "state        whole",
        "/joint_sensors",
        "sensor_msgs/msg/JointState",
        "shoulder_yaw, shoulder_pitch",
        "water",
        "robot.toml (application/toml)",
        "determined   shoulder_yaw gain, shoulder_yaw offset",
    ];
    inspect(&sample(), &[]).expect("sample", 0, &words);
    let told = inspect(&sample(), &["--json"]);
    assert_eq!(told.code, 0);
    let json: serde_json::Value = serde_json::from_str(&told.stdout).expect("JSON");
    assert_eq!(json["completeness"]["state"], "whole");
    assert_eq!(json["arm"]["views_fit"], 14);
    assert_eq!(json["observable"]["views"], 14);
    let by_topic: u64 =
        json["topics"].as_array().expect("topics").iter().map(|t| t["messages"].as_u64().unwrap()).sum();
    assert_eq!(json["messages"].as_u64(), Some(by_topic));
    let sensors = json["topics"].as_array().expect("topics").iter().find(|t| t["topic"] == "/joint_sensors");
    let rate_hz = sensors.expect("sensors")["rate_hz"].as_f64().expect("a rate");
    assert!((rate_hz - 100.0).abs() < 0.5, "{rate_hz}");
}

/// Readings of another arm have no tracking error by this one's joints, and no replay by its drawing.
#[test]
fn a_recording_of_another_robot_is_neither_compared_nor_drawn() {
    let other = root().join("robots/kraft-predator");
    let told = inspect(&sample(), &["--json", "--robot", other.to_str().expect("UTF-8")]);
    let json: serde_json::Value = serde_json::from_str(&told.stdout).expect("JSON");
    assert!(json["tracking_error"].is_null(), "{json:#}");
    let own = inspect(&sample(), &["--json"]);
    let json: serde_json::Value = serde_json::from_str(&own.stdout).expect("JSON");
    assert!(json["tracking_error"].is_object(), "its own robot was driven");
    let folder = temp();
    let mut replay = program();
    replay.arg("replay").arg(sample()).arg("--robot").arg(&other).arg("--save").arg(folder.path().join("a.rrd"));
    answer(&mut replay).expect("replay", 2, &["[joints_mismatch]", "run.mcap"]);
}

/// The parameters in the output are those that the estimator then estimates.
#[test]
fn the_parameters_named_are_those_that_calibrate_estimates() {
    let inspection = look(&sample(), Some(&titan())).expect("it reads");
    let file = root().join("recordings/sample/calibration.toml");
    let calibration = armcal::calib::Calibration::read(&file).expect("it reads");
    assert_eq!(inspection.observable.expect("a robot").parameters, calibration.covariance.parameters);
}

#[test]
fn a_robot_that_does_not_fit_is_told_apart() {
    let folder = temp();
    let robot = robot_copy(folder.path());
    let file = robot.join("robot.toml");
    edit(&file, "joint = \"wrist_yaw\"", "joint = \"wrist_sway\"");
    edit(&robot.join("titan4.urdf"), "joint name=\"wrist_yaw\"", "joint name=\"wrist_sway\"");
    let robot = robot.to_str().expect("UTF-8");
    inspect(&sample(), &["--robot", robot]).expect("other joints", 0, &["missing", "wrist_sway", "wrist_yaw"]);
    inspect(&sample(), &["--robot", "no/such"]).expect("no robot", 2, &["no/such"]);
}

#[test]
fn what_is_no_recording_is_named_with_what_to_do() {
    let _texts = Texts::of("what_is_no_recording_is_named_with_what_to_do");
    let folder = temp();
    let cases: [(&[u8], &[&str]); 12] = [
        (b"", &["empty"]),
        (b"\x89MCAP0\r", &["first 7 bytes"]),
        (b"#ROSBAG V2.0\n\x45\0\0\0", &["a ROS 1 bag", "convert"]),
        (b"SQLite format 3\0\x10\0\x01\x01", &["not a ROS 2 bag"]),
        (b"RRF2\0\0\0\0\x04", &["Rerun"]),
        (b"\x1f\x8b\x08\0\0\0", &["gzip", "unpack"]),
        (b"time,joint1,joint2\n0.0,1,2\n", &["CSV"]),
        (b"{\"a\": [1, 2]}", &["JSON"]),
        (b"version = 1\nname = \"titan4\"\n", &["a text"]),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\n", &[]),
        (&[0; 5000], &["zeros"]),
        (&[7, 1, 200, 3, 255], &["07 01 c8"]),
    ];
    for (bytes, words) in cases {
        let said = inspect_bytes(bytes, folder.path());
        said.expect(&String::from_utf8_lossy(&bytes[..bytes.len().min(9)]), 2, words);
        assert!(said.stderr.contains("given.mcap") && said.stderr.lines().count() == 1, "{said:#?}");
    }
    let parent = sample();
    inspect(parent.parent().expect("a folder"), &[]).expect("a folder", 2, &["folder"]);
    inspect(&folder.path().join("absent.mcap"), &[]).expect("absent", 2, &["absent.mcap"]);
}

/// Topics of other arms are described with their possible uses.
#[test]
fn foreign_recordings_come_with_hints() {
    let _texts = Texts::of("foreign_recordings_come_with_hints");
    let folder = temp();
    let path = folder.path().join("foreign.mcap");
    let mut writer = RecordingWriter::create(&path, RecordingHeader::new(Vec::new())).expect("a file");
    for n in 0..5 {
        let now = SIMULATION_EPOCH.plus_s(f64::from(n) * 0.5);
        let name: Vec<String> = (1..=7).map(|joint| format!("fr3_joint{joint}")).collect();
        let joints = ros::JointState { name, position: vec![-2.5; 7], ..Default::default() };
        writer.write_ros("/franka/joints", &ros::JointState::SCHEMA, now, &joints).expect("written");
        let transform = ros::TransformStamped { child_frame_id: "board".into(), ..Default::default() };
        let tf = ros::TfMessage { transforms: vec![transform] };
        writer.write_ros("/tf", &ros::TfMessage::SCHEMA, now, &tf).expect("written");
        let info = ros::CameraInfo::default();
        writer.write_ros("/cam/info\u{1b}[31m", &ros::CameraInfo::SCHEMA, now, &info).expect("written");
    }
    writer.finish().expect("finished");
    let told = inspect(&path, &[]);
    let words = ["/franka/joints", "fr3_joint1", "radians", "board", "2.00"];
    told.expect("foreign", 0, &words);
    assert!(!told.stdout.contains('\u{1b}'), "names of a file must not steer the terminal");
}

/// A copy with intact chunks loses no information, and a broken one is always reported as broken.
#[test]
fn cut_at_every_percent() {
    let _texts = Texts::of("cut_at_every_percent");
    let bytes = fs::read(sample()).expect("the sample");
    let folder = temp();
    let path = folder.path().join("cut.mcap");
    let mut before = 0;
    for percent in 0..100 {
        let end = (bytes.len() * percent / 100).max(8);
        fs::write(&path, &bytes[..end]).expect("written");
        let found = look(&path, None).expect("it reads");
        assert_eq!(found.completeness.state, State::Cut, "{percent} %");
        assert!(found.messages >= before, "{percent} %: {} after {before}", found.messages);
        before = found.messages;
    }
    let cut = inspect(&path, &[]);
    cut.expect("99 %", 3, &["cut", " 14 "]);
}

fn expect_flipped_bits_to_be_told_of(rounds: u32) {
    let bytes = fs::read(sample()).expect("the sample");
    let whole = look(&sample(), None).expect("it reads");
    let folder = temp();
    let path = folder.path().join("flipped.mcap");
    let mut rng = stream_rng(1, "inspect_flips");
    let mut told = 0;
    for round in 0..rounds {
        let mut damaged = bytes.clone();
        let at = rng.random_range(8..bytes.len());
        damaged[at] ^= 1 << rng.random_range(0..8);
        fs::write(&path, &damaged).expect("written");
        let found = look(&path, None).expect("it reads");
        told += u32::from(found.completeness.state != State::Whole);
        if found.completeness.state == State::Whole {
            assert_eq!((found.messages, &found.arm), (whole.messages, &whole.arm), "round {round}, byte {at}");
        }
    }
    eprintln!("{told} of {rounds} told of");
    // The checksum of all data covers indexes and attachments, too, which no message depends on.
    assert!(told * 30 > rounds * 29, "{told}");
}

#[test]
fn flipped_bits_are_told_of_where_they_matter() {
    expect_flipped_bits_to_be_told_of(60);
}

#[test]
#[ignore = "second tier: 300 recordings with a flipped bit, 5 s"]
fn three_hundred_flipped_bits_are_told_of_where_they_matter() {
    expect_flipped_bits_to_be_told_of(300);
}

/// One change of the kinds that disks, copies and people cause.
fn mutate(bytes: &mut Vec<u8>, rng: &mut impl RngExt) {
    let n = bytes.len();
    let at = rng.random_range(0..n);
    let len = rng.random_range(1..=(n - at).min(200_000));
    match rng.random_range(0..8) {
        0 => bytes[at] ^= 1 << rng.random_range(0..8),
        1 => bytes[at..at + len.min(64)].iter_mut().for_each(|byte| *byte = rng.random()),
        2 => bytes.truncate(at.max(8)),
        3 => bytes[at..at + len].fill(0),
        4 => drop(bytes.drain(at..at + len)),
        5 => {
            let twice = bytes[at..at + len].to_vec();
            bytes.splice(at..at, twice);
        }
        6 => {
            let huge = rng.random::<u64>() >> rng.random_range(0..60);
            let at = at.min(n - 8);
            bytes[at..at + 8].copy_from_slice(&huge.to_le_bytes());
        }
        // Heads of records, which have the lengths.
        _ => {
            let heads = records(&bytes.clone());
            if let Some((at, _, _)) = heads.get(rng.random_range(0..heads.len().max(1))) {
                bytes[at + rng.random_range(0..9)] = rng.random();
            }
        }
    }
}

/// The variable `ARMCAL_MUTATIONS=5000` makes more of them.
#[test]
fn mutated_recordings_never_panic_and_never_pass_for_whole() {
    let rounds: u32 = std::env::var("ARMCAL_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(60);
    let bytes = fs::read(sample()).expect("the sample");
    let whole = look(&sample(), None).expect("it reads");
    let robot = titan();
    let folder = temp();
    let path = folder.path().join("mutated.mcap");
    let mut rng = stream_rng(1, "mutations");
    let mut states = [0; 4];
    for round in 0..rounds {
        let mut mutated = bytes.clone();
        for _ in 0..rng.random_range(1..4) {
            mutate(&mut mutated, &mut rng);
        }
        fs::write(&path, &mutated).expect("written");
        // The robot costs a second pass, so only some rounds have it.
        let Ok(found) = look(&path, (round % 10 == 0).then_some(&robot)) else {
            states[3] += 1;
            assert!(mutated[..8] != bytes[..8], "round {round}: only what does not begin like one is no recording");
            continue;
        };
        states[found.completeness.state as usize] += 1;
        if found.completeness.state == State::Whole {
            assert_eq!((found.messages, &found.arm), (whole.messages, &whole.arm), "round {round}");
        }
    }
    eprintln!(
        "{rounds} rounds: {} whole, {} cut, {} damaged, {} no recording",
        states[0], states[1], states[2], states[3]
    );
    assert!(states[1] > 0 && states[2] > 0, "{states:?}");
}

/// Begin of each record in a finished file, with opcode and length.
fn records(bytes: &[u8]) -> Vec<(usize, u8, usize)> {
    let mut at = 8;
    let mut records = Vec::new();
    while at < bytes.len().saturating_sub(17) {
        let len = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("8 bytes"));
        let len = usize::try_from(len).unwrap_or(usize::MAX).saturating_add(9);
        records.push((at, bytes[at], len));
        at = at.saturating_add(len);
    }
    records
}

#[test]
fn wrong_structure_is_survived() {
    let _texts = Texts::of("wrong_structure_is_survived");
    let bytes = fs::read(sample()).expect("the sample");
    let folder = temp();
    let whole = look(&sample(), None).expect("it reads");
    let all = records(&bytes);
    let attachment = all.iter().find(|(_, opcode, _)| *opcode == 9).expect("an attachment");
    let chunk = *all.iter().filter(|(_, opcode, _)| *opcode == 6).nth(1).expect("a chunk");
    let check = |what: &str, bytes: &[u8], code: i32, words: &[&str]| {
        let said = inspect_bytes(bytes, folder.path());
        said.expect(what, code, words);
        said
    };
    check("attachment", &bytes[..attachment.0 + 100], 3, &["cut", " 14 "]);
    let mut zeros = bytes[..chunk.0].to_vec();
    zeros.resize(bytes.len(), 0);
    check("zeros", &zeros, 3, &["cut"]);
    let twice = [&bytes[..chunk.0 + chunk.2], &bytes[chunk.0..]].concat();
    let said = check("twice", &twice, 3, &["damaged"]);
    assert!(!said.stdout.contains("backwards"), "{said:#?}");
    // Lengths of three records: the chunk, the attachment, and a schema at the end.
    for (at, _, _) in [chunk, *attachment, all[all.len() - 3]] {
        for len in [u64::MAX, u64::MAX / 2, 1 << 40, bytes.len() as u64, 0] {
            let mut wrong = bytes.clone();
            wrong[at + 1..at + 9].copy_from_slice(&len.to_le_bytes());
            let path = folder.path().join("given.mcap");
            fs::write(&path, &wrong).expect("written");
            let found = look(&path, None).expect("it reads");
            assert!(found.messages <= whole.messages);
            assert_ne!(found.completeness.state, State::Whole, "byte {at}, length {len}");
        }
    }
    // A summary that is said to begin at any offset.
    for start in [0, 8, 9, u64::MAX, bytes.len() as u64] {
        let mut wrong = bytes.clone();
        let at = bytes.len() - 28;
        wrong[at..at + 8].copy_from_slice(&start.to_le_bytes());
        let path = folder.path().join("given.mcap");
        fs::write(&path, &wrong).expect("written");
        assert_eq!(look(&path, None).expect("it reads").messages, whole.messages, "summary at {start}");
    }
}

/// A cut recording with enough views calibrates, as `inspect` predicts.
#[test]
fn inspect_says_beforehand_whether_calibrate_will_work() {
    let bytes = fs::read(sample()).expect("the sample");
    let folder = temp();
    let path = folder.path().join("cut.mcap");
    let mut both = [0, 0];
    for percent in [20, 45, 60, 75, 90] {
        fs::write(&path, &bytes[..bytes.len() * percent / 100]).expect("written");
        let determined = look(&path, Some(&titan())).expect("it reads").observable.expect("a robot");
        let code = calibrate(&path, &robot_folder(), &folder.path().join("out")).code;
        let is_enough = determined.missing.is_empty();
        both[usize::from(is_enough)] += 1;
        assert_eq!(is_enough, code == 3, "{percent} %: {determined:?}, exit code {code}");
    }
    assert!(both[0] > 0 && both[1] > 0, "{both:?}");
}

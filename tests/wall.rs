//! Separation from the truth: the estimator gets a recording and a robot folder, and no part of the truth comes with
//! them.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use armcal::calib::Calibration;
use armcal::log::{RecordingHeader, RecordingWriter, for_each_raw, read_attachments, read_recording, strip, topics};
use armcal::sim::truth::read_truth;
use armcal::streams::{JointCounts, Message, Sink};

use crate::support::{
    SHARED_PUMP_FLOW_L_MIN, SHARED_SEED, calibrate, edit, files_below, read, robot_copy, robot_folder, root,
    shared_run, temp,
};

/// calibration.toml of a recording, made by the program.
#[track_caller]
fn calibration_of(recording: &Path, robot: &Path) -> String {
    let out = temp();
    calibrate(recording, robot, out.path()).expect("calibrate", 0, &["ACCEPTED"]);
    read(&out.path().join("calibration.toml"))
}

#[test]
fn a_recording_and_a_robot_are_all_that_calibration_takes() {
    let run = shared_run();
    let expected = read(&run.file("calibration.toml"));
    assert!(calibration_of(&run.file("run.mcap"), &robot_folder()) == expected);

    // The copy is in its own folder, with no other files.
    let folder = temp();
    let alone = folder.path().join("alone.mcap");
    fs::copy(run.file("run.mcap"), &alone).expect("copied");
    assert!(calibration_of(&alone, &robot_folder()) == expected, "without the truth");
    fs::write(folder.path().join("truth.mcap"), "no truth at all").expect("written");
    assert!(calibration_of(&alone, &robot_folder()) == expected, "beside a garbled truth");
}

#[test]
fn attachments_and_metadata_do_not_matter() {
    let run = shared_run();
    let folder = temp();
    let bare = folder.path().join("bare.mcap");
    strip(run.file("run.mcap"), &bare).expect("stripped");
    assert!(read_attachments(&bare).expect("it reads").is_empty());
    assert!(calibration_of(&bare, &robot_folder()) == read(&run.file("calibration.toml")));
}

/// The calibration does not use the viewers' topics: without them it is the same, byte for byte.
#[test]
fn topics_for_viewers_do_not_matter() {
    let run = shared_run();
    let mut found = BTreeMap::new();
    for_each_raw(run.file("run.mcap"), |message| *found.entry(message.channel.topic.clone()).or_insert(0) += 1)
        .expect("it reads");
    let n_of = |topic: &str| found.get(topic).copied().unwrap_or(0);
    let mut without_images = topics::VIEWER_TOPICS.iter().filter(|topic| **topic != topics::IMAGE_MARKS);
    assert!(without_images.all(|topic| n_of(topic) > 0), "{found:?}");
    assert!(n_of(topics::TF) * 5 < n_of(topics::JOINT_STATES) * 2, "10 Hz of 25 at most: {found:?}");

    let recording = read_recording(run.file("run.mcap")).expect("it reads");
    let folder = temp();
    let bare = folder.path().join("run.mcap");
    let mut writer =
        RecordingWriter::create(&bare, RecordingHeader::new(recording.joint_names.clone())).expect("a file");
    for (log_time, message) in &recording.messages {
        writer.record(*log_time, message).expect("recorded");
    }
    writer.finish().expect("finished");
    assert!(calibration_of(&bare, &robot_folder()) == read(&run.file("calibration.toml")));
    let (with, without) = (fs::metadata(run.file("run.mcap")).expect("a file"), fs::metadata(&bare).expect("a file"));
    assert!(with.len() * 4 < without.len() * 5, "{} bytes, {} without", with.len(), without.len());
}

/// The words are twice as fine, in recording and datasheet.
#[test]
fn counts_twice_as_fine_halve_the_gains_and_change_nothing_else() {
    let run = shared_run();
    let recording = read_recording(run.file("run.mcap")).expect("it reads");
    let folder = temp();
    let path = folder.path().join("doubled.mcap");
    let header = RecordingHeader::new(recording.joint_names.clone());
    let mut writer = RecordingWriter::create(&path, header).expect("a file");
    let double = |counts: &mut JointCounts| counts.iter_mut().for_each(|value| *value *= 2.0);
    for (log_time, mut message) in recording.messages {
        match &mut message {
            Message::JointSensors(sample) => double(&mut sample.counts),
            Message::JointCommand(command) => double(&mut command.counts),
            _ => {}
        }
        writer.record(log_time, &message).expect("recorded");
    }
    writer.finish().expect("finished");

    let robot = robot_copy(folder.path());
    let fine = ["offset_counts", "scale_counts_per_deg", "wrap_counts", "noise_std_counts"];
    let lines: Vec<String> = read(&robot.join("robot.toml"))
        .lines()
        .map(|line| match line.split_once(" = ") {
            Some((key, value)) if fine.contains(&key) => {
                format!("{key} = {:?}", 2.0 * value.parse::<f64>().expect("a number"))
            }
            _ => line.to_owned(),
        })
        .collect();
    crate::support::write(&robot.join("robot.toml"), &lines.join("\n"));

    let out = temp();
    calibrate(&path, &robot, out.path()).expect("doubled", 0, &[]);
    let doubled = Calibration::read(&out.path().join("calibration.toml")).expect("it reads");
    let mut expected = Calibration::read(&run.file("calibration.toml")).expect("it reads");
    assert_ne!(doubled.messages_hash, expected.messages_hash);
    expected.messages_hash.clone_from(&doubled.messages_hash);
    assert_eq!(doubled.covariance_hash, expected.covariance_hash);
    let doubled_of = |value: Option<f64>| value.map(|value| 2.0 * value);
    for joint in &mut expected.joint {
        (joint.offset_counts, joint.counts_per_rad) =
            (doubled_of(joint.offset_counts), doubled_of(joint.counts_per_rad));
        joint.gain_rad_per_count *= 0.5;
        joint.gain_std_rad_per_count *= 0.5;
    }
    // Halving is exact in binary, so all else is not only close but equal.
    assert_eq!(doubled, expected);
}

/// All contents of a recording that a program could read: messages, types, channels, attachments, metadata, headers.
pub fn all_contents(path: &Path) -> Vec<u8> {
    let mut contents = Vec::new();
    for_each_raw(path, |message| {
        contents.extend_from_slice(message.data);
        contents.extend(format!("{:?}", message.channel).bytes());
    })
    .expect("it reads");
    for (name, bytes) in read_attachments(path).expect("it reads") {
        contents.extend(name.bytes());
        contents.extend(bytes);
    }
    let file = fs::read(path).expect("a file");
    for record in mcap::read::LinearReader::new(&file).expect("an MCAP file") {
        match record.expect("a whole record") {
            mcap::records::Record::Metadata(metadata) => contents.extend(format!("{metadata:?}").bytes()),
            mcap::records::Record::Header(header) => contents.extend(format!("{header:?}").bytes()),
            _ => {}
        }
    }
    contents
}

pub fn find(contents: &[u8], needle: &[u8]) -> bool {
    memchr::memmem::find(contents, needle).is_some()
}

#[test]
fn the_recording_holds_neither_seed_nor_world() {
    let run = shared_run();
    let contents = all_contents(&run.file("run.mcap"));
    let lower = contents.to_ascii_lowercase();
    // The search in the file is case-sensitive: two megabytes of compressed chunks hold a word of four letters in any
    // case with a probability of 1/100.
    let file = fs::read(run.file("run.mcap")).expect("a file");
    for word in ["seed", "gain_error", "as_built", "[world", "backlash", "harmonic", "drift_rad", "miss_probability"] {
        assert!(!find(&lower, word.as_bytes()), "the recording holds `{word}`");
        assert!(!find(&file, word.as_bytes()), "the recording's file holds `{word}`");
    }
    for text in [SHARED_SEED.to_string(), format!("{SHARED_SEED:x}"), SHARED_PUMP_FLOW_L_MIN.to_string()] {
        assert!(!find(&contents, text.as_bytes()), "the recording holds `{text}`");
    }
    assert!(!find(&contents, &SHARED_SEED.to_le_bytes()) && !find(&contents, &SHARED_SEED.to_be_bytes()));

    // The search is for the numbers themselves. It finds them in the truth, which shows that it works.
    let truth = read_truth(run.file("truth.mcap")).expect("it reads");
    assert_eq!(truth.header.seed, SHARED_SEED);
    let truth_contents = all_contents(&run.file("truth.mcap"));
    assert!(find(&truth_contents, SHARED_SEED.to_string().as_bytes()));
    for joint in &truth.header.as_built.joints {
        for value in [joint.gain_error, joint.offset_error_rad, joint.harmonics[0].amplitude_rad] {
            assert!(find(&truth_contents, value.to_string().as_bytes()) || find(&truth_contents, &value.to_le_bytes()));
            assert!(!find(&contents, &value.to_le_bytes()) && !find(&contents, value.to_string().as_bytes()));
        }
    }
    for state in truth.states.iter().step_by(997) {
        assert!(!find(&contents, &state.angles[0].to_le_bytes()), "a true angle at {:?}", state.stamp);
    }
}

#[test]
fn attached_drawings_are_the_files_that_belief_may_read() {
    let run = shared_run();
    let attached: BTreeMap<String, Vec<u8>> =
        read_attachments(run.file("run.mcap")).expect("it reads").into_iter().collect();
    let names: Vec<&str> = attached.keys().map(String::as_str).collect();
    assert_eq!(names, ["robot.toml", "scene.toml", "titan4.urdf", "vehicle.toml"]);
    let robot_toml = fs::read(robot_folder().join("robot.toml")).expect("a file");
    assert!(attached["robot.toml"] == robot_toml);
}

/// The compiler lets a crate name only its dependencies.
#[test]
fn belief_does_not_depend_on_the_simulator_nor_truth_on_belief() {
    for (member, allowed) in [
        ("core", &["armcal-libm"][..]),
        ("detect", &["armcal-core"]),
        ("belief", &["armcal-core"]),
        ("paper", &["armcal-core", "armcal-belief", "armcal-charts"]),
        ("sim", &["armcal-core", "armcal-detect"]),
        ("replay", &["armcal-core", "armcal-belief"]),
    ] {
        let manifest: toml::Table = read(&root().join("src").join(member).join("Cargo.toml")).parse().expect("TOML");
        let tables = ["dependencies", "dev-dependencies", "build-dependencies"].map(|name| manifest.get(name));
        for name in tables.into_iter().flatten().flat_map(|table| table.as_table().expect("a table").keys()) {
            let is_allowed = !name.starts_with("armcal") || allowed.contains(&name.as_str());
            assert!(is_allowed, "{member} depends on {name}");
        }
    }
}

/// A change of the nominal model does change the result, so the tests above compare something.
#[test]
fn the_robot_folder_does_matter() {
    let run = shared_run();
    let folder = temp();
    let robot = robot_copy(folder.path());
    edit(&robot.join("robot.toml"), "position_m = [-0.4785, 0.45, -0.4]", "position_m = [-0.4785, 0.46, -0.4]");
    let out = temp();
    let answer = calibrate(&run.file("run.mcap"), &robot, out.path());
    assert!([0, 4].contains(&answer.code), "{answer:?}");
    assert!(read(&out.path().join("calibration.toml")) != read(&run.file("calibration.toml")));
}

/// Only the crate `live` reaches an arm, and only `drive`, `discover` and `serve` use it. `run` and its dependencies
/// have no socket except the replay's, to a viewer.
#[test]
fn only_drive_discover_and_serve_reach_an_arm() {
    let src = root().join("src");
    let knows =
        ["cli/drive/", "cli/discover", "cli/serve/", "cli/check.rs", "cli/exit.rs", "recorded_images/live.rs", "live/"];
    let sockets = ["std::net", "TcpStream", "UdpSocket"];
    for file in files_below(&src, "rs") {
        let path = file.strip_prefix(&src).expect("below").to_string_lossy().into_owned();
        let (text, is_allowed) = (read(&file), |ways: &[&str]| ways.iter().any(|way| path.starts_with(way)));
        assert!(is_allowed(&knows) || !text.contains("armcal_live"), "{path} knows live arms");
        let is_free = is_allowed(&["cli/discover.rs", "live/", "replay/tests/"]);
        assert!(is_free || !sockets.iter().any(|socket| text.contains(socket)), "{path} opens a socket");
    }
    // No other crate depends on network libraries.
    for manifest in ["", "src/core", "src/belief", "src/paper", "src/detect", "src/sim", "src/lab"] {
        let file = root().join(manifest).join("Cargo.toml");
        let table: toml::Table = read(&file).parse().expect("TOML");
        let dependencies = table["dependencies"].as_table().expect("a table");
        let ways = ["mio", "rustdds", "ros2-client", "tungstenite", "re_grpc_client"];
        assert!(ways.iter().all(|way| !dependencies.contains_key(*way)), "{}", file.display());
    }
}

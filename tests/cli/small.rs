//! The short forms of `export`.

use std::io::Write;
use std::path::Path;
use std::process::Stdio;

use armcal::calib::{Calibration, CompactCalibration, ReferenceTable, TermsTable};
use armcal::stats::stream_rng;
use armcal::streams::JointAngles;
use rand::RngExt;

use crate::support::texts::Texts;
use crate::support::{Answer, answer, program, read, robot_folder, root, temp, titan, write};

fn sample() -> std::path::PathBuf {
    root().join("recordings/sample/calibration.toml")
}

fn export(file: &str, more: &[&str]) -> Answer {
    answer(program().arg("export").arg(file).args(more))
}

fn export_stdin(text: &str, more: &[&str]) -> (i32, String, String) {
    let mut child = program()
        .args(["export", "-"])
        .args(more)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("started");
    child.stdin.take().expect("a pipe").write_all(text.as_bytes()).expect("sent");
    let output = child.wait_with_output().expect("ended");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code().expect("a code"), text(output.stdout), text(output.stderr))
}

/// Compact line of a recording that is calibrated into `out`, accepted or refused.
fn compact_of(recording: &Path, out: &Path) -> Answer {
    answer(
        program()
            .arg("calibrate")
            .arg(recording)
            .arg("--robot")
            .arg(robot_folder())
            .arg("--out")
            .arg(out)
            .args(["--method", "minimum_distance"]),
    );
    let file = out.join("calibration.toml");
    export(file.to_str().expect("UTF-8"), &["--as", "compact", "--refused"])
}

/// The recording is calibrated, and the compact line gives the same tool positions.
#[test]
fn the_compact_line_is_short_and_moves_the_tool_no_less_than_the_full_calibration() {
    let folder = temp();
    let recording = root().join("recordings/sample/run.mcap");
    let told = compact_of(&recording, folder.path());
    told.expect("compact", 0, &["armcal1 titan4 minimum_distance ok "]);
    assert!(told.stdout.len() < 512 && told.stdout.lines().count() == 1, "{} bytes", told.stdout.len());
    let full = Calibration::read(&folder.path().join("calibration.toml")).expect("written as ever");
    let compact = CompactCalibration::from_text(&told.stdout).expect("it reads");

    let robot = titan();
    let (exact, rounded) = (full.sensors(&robot).expect("fits"), compact.sensors(&robot).expect("fits"));
    let tool_m = |angles: &JointAngles| robot.chain.link_poses(angles).frame(&robot.tool.mount).translation.vector;
    let mut rng = stream_rng(1, "compact");
    let mut worst_m: f64 = 0.0;
    for _ in 0..2000 {
        let angles = JointAngles::from_fn(6, |j| robot.sensors[j].center_rad + rng.random_range(-3.1..3.1));
        let counts = exact.counts(&angles);
        worst_m = worst_m.max((tool_m(&exact.angles(&counts)) - tool_m(&rounded.angles(&counts))).norm());
    }
    eprintln!("{} bytes, the tool is off by {:.2e} m at most", told.stdout.trim_end().len(), worst_m);
    assert!(worst_m < 1e-4 && worst_m > 0.0, "{worst_m}");
}

/// The compact line of a refused calibration has the refusal and its code.
#[test]
fn a_refused_calibration_says_so_in_the_compact_line() {
    let folder = temp();
    let bytes = std::fs::read(root().join("recordings/sample/run.mcap")).expect("the sample");
    let cut = folder.path().join("cut.mcap");
    let mut refused = 0;
    for percent in [45, 55, 65] {
        std::fs::write(&cut, &bytes[..bytes.len() * percent / 100]).expect("written");
        let told = compact_of(&cut, &folder.path().join(percent.to_string()));
        if told.stdout.contains(" no:") {
            refused += 1;
            let why = ["too_few_", "no_better"].map(|why| format!("armcal1 titan4 minimum_distance no:{why}"));
            assert!(why.iter().any(|why| told.stdout.starts_with(why)), "{told:#?}");
            assert!(told.stdout.len() < 512);
        }
    }
    assert!(refused > 0, "no cut gave a refusal");
}

#[test]
fn every_form_comes_from_calibration_toml() {
    let file = sample();
    let file = file.to_str().expect("UTF-8");
    let yaml = export(file, &["--as", "yaml"]);
    yaml.expect("yaml", 0, &["robot: titan4", "gain_rad_per_count: ", "name: shoulder_yaw", "status: accepted"]);
    let from_yaml: Calibration = serde_saphyr::from_str(&yaml.stdout).expect("YAML");
    let calibration = Calibration::read(&sample()).expect("it reads");
    assert_eq!(from_yaml, calibration, "every digit is there");
    let toml = export(file, &["--as", "toml"]);
    assert_eq!((toml.code, toml.stdout), (0, read(&sample())));
    let compact = export(file, &["--as", "compact"]);
    assert_eq!(compact.stdout.trim_end(), CompactCalibration::of(&calibration).unwrap().to_text().unwrap());
    for form in ["sdf", "ros", "xml"] {
        export(file, &["--as", form]).expect(form, 2, &["yaml", "toml", "compact"]);
    }
    let other = root().join("robots/titan4");
    export(file, &["--as", "yaml", "--robot", other.to_str().expect("UTF-8")]).expect("with its robot", 0, &[]);
}

#[test]
fn the_compact_line_becomes_yaml_and_toml() {
    let file = sample();
    let line = export(file.to_str().expect("UTF-8"), &["--as", "compact"]).stdout;
    let (code, yaml, _) = export_stdin(&line, &["--as", "yaml"]);
    assert_eq!(code, 0);
    let at_s = Calibration::read(&file).expect("it reads").valid.time_nanos / 1_000_000_000;
    let time = format!("time_s: {at_s}");
    for key in ["format: armcal1", "robot: titan4", "gain_correction: ", "offset_std_rad: ", &time] {
        assert!(yaml.contains(key), "no `{key}` in {yaml}");
    }
    let robot = robot_folder();
    let (code, toml, _) = export_stdin(&line, &["--as", "toml", "--robot", robot.to_str().expect("UTF-8")]);
    assert_eq!(code, 0);
    let table: toml::Table = toml::from_str(&toml).expect("TOML");
    let calibration = Calibration::read(&sample()).expect("it reads");
    let joints = table["joint_of_robot"].as_array().expect("joints");
    assert_eq!(joints.len(), 6);
    for (joint, exact) in joints.iter().zip(&calibration.joint) {
        assert_eq!(joint["name"].as_str(), Some(exact.name.as_str()));
        let gain = joint["gain_rad_per_count"].as_float().expect("a number");
        assert!((gain / exact.gain_rad_per_count - 1.0).abs() < 1e-7);
    }
    let (code, again, _) = export_stdin(&line, &["--as", "compact"]);
    assert_eq!((code, again), (0, line));
}

#[test]
fn what_is_damaged_or_foreign_is_refused_with_2() {
    let _texts = Texts::of("what_is_damaged_or_foreign_is_refused_with_2");
    let file = sample();
    let line = export(file.to_str().expect("UTF-8"), &["--as", "compact"]).stdout;
    let (code, stdout, stderr) = export_stdin(&line.replacen("-2", "-3", 1), &["--as", "yaml"]);
    assert!(code == 2 && stdout.is_empty() && stderr.contains("checksum"), "{stderr}");
    for (text, word) in
        [("", "neither"), ("armcal9 x", "armcal9"), ("name = \"x\"\n", "neither"), ("[[joint]]\n", "stdin")]
    {
        let (code, stdout, stderr) = export_stdin(text, &["--as", "toml"]);
        assert!(code == 2 && stdout.is_empty() && stderr.contains(word), "{text}: {code}: {stderr}");
    }
    let folder = temp();
    let binary = folder.path().join("x");
    std::fs::write(&binary, [0xff, 0xfe, 0x00]).expect("written");
    export(binary.to_str().expect("UTF-8"), &["--as", "yaml"]).expect("binary", 2, &[]);
    export("no/such", &["--as", "yaml"]).expect("absent", 2, &["no/such"]);
    write(&binary, &line);
    let other = crate::support::robot_copy(folder.path());
    crate::support::edit(&other.join("robot.toml"), "name = \"titan4\"", "name = \"titan5\"");
    let other = other.to_str().expect("UTF-8");
    export(binary.to_str().expect("UTF-8"), &["--as", "toml", "--robot", other]).expect("other robot", 2, &["titan5"]);
}

/// A full disk or a reader that went away is no crash.
#[cfg(target_os = "linux")]
#[test]
fn stdout_that_takes_nothing_is_an_error_without_a_panic() {
    let full = std::fs::File::options().write(true).open("/dev/full").expect("/dev/full");
    let output =
        program().arg("export").arg(sample()).args(["--as", "yaml"]).stdout(full).output().expect("the program starts");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && stderr.contains("stdout"), "{output:?}");
}

/// The sample's calibration with a bent, warm sensor.
fn with_terms(folder: &std::path::Path) -> std::path::PathBuf {
    let mut calibration = Calibration::read(&sample()).expect("it reads");
    let mut nonlinearity_rad = vec![0.0; armcal::sensor::N_SHAPE];
    (nonlinearity_rad[1], nonlinearity_rad[4]) = (3e-3, -1e-3);
    calibration.joint[2].terms = Some(TermsTable {
        half_range_rad: titan().sensors[2].half_range_rad,
        nonlinearity_rad: Some(nonlinearity_rad),
        offset_rad_per_k: Some(2e-4),
        ..TermsTable::default()
    });
    calibration.reference = Some(ReferenceTable { oil_c: Some(20.0), pressure_pa: None, time_nanos: None });
    let file = folder.join("bent.toml");
    write(&file, &calibration.to_toml());
    file
}

/// A sensor that is not a straight line is exported as a table, both in YAML and from the compact line.
#[test]
fn terms_are_exported_as_tables_and_never_dropped() {
    let folder = temp();
    let file = with_terms(folder.path());
    let file = file.to_str().expect("UTF-8");
    let yaml = export(file, &["--as", "yaml"]);
    yaml.expect("yaml", 0, &["lookup:", "joint: forearm_pitch", "travel_counts:", "correction_rad:", "oil_c: 20"]);
    let robot = robot_folder();
    let robot = robot.to_str().expect("UTF-8");
    export(file, &["--as", "toml", "--robot", robot]).expect("toml", 0, &["[joint.terms]", "[reference]"]);
    let line = export(file, &["--as", "compact"]);
    line.expect("compact", 0, &["armcal2 titan4 "]);
    assert!(line.stdout.len() < 512 && line.stdout.lines().count() == 1, "{}", line.stdout);
    let (code, told, _) = export_stdin(&line.stdout, &["--as", "yaml", "--robot", robot]);
    assert_eq!(code, 0);
    for key in ["format: armcal2", "nonlinearity_rad:", "offset_rad_per_k: 0.0002", "lookup:", "joint: forearm_pitch"] {
        assert!(told.contains(key), "no `{key}` in {told}");
    }
    let (code, toml, _) = export_stdin(&line.stdout, &["--as", "toml", "--robot", robot]);
    let table: toml::Table = toml::from_str(&toml).expect("TOML");
    assert_eq!((code, table["lookup"].as_array().map(Vec::len)), (0, Some(1)));
    // Without terms there is no table.
    let sample = sample();
    let straight = export(sample.to_str().expect("UTF-8"), &["--as", "yaml"]).stdout;
    assert!(!straight.contains("lookup"), "{straight}");
}

#[test]
fn a_routine_without_its_vehicle_is_told_what_to_name() {
    let _texts = Texts::of("a_routine_without_its_vehicle_is_told_what_to_name");
    let folder = temp();
    let routine = folder.path().join("routine.toml");
    let text = read(&root().join("routines/titan4-quickstart.toml"));
    let kept = text.lines().filter(|line| !line.starts_with("vehicle =")).collect::<Vec<_>>().join("\n");
    write(&routine, &kept);
    let told = answer(program().arg("check").arg(&routine));
    told.expect("check", 2, &["routine.toml", "fixed-base.toml"]);
}

#[test]
fn check_says_what_a_calibration_is_valid_for() {
    let _texts = Texts::of("check_says_what_a_calibration_is_valid_for");
    let told = answer(program().arg("check").arg(sample()));
    told.expect("check", 0, &[" rad, ", "h about 20"]);
    assert!(!told.stdout.contains("wrist_rotate"), "nothing was estimated of it: {}", told.stdout);
}

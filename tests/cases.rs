//! Recordings, maps and tables as users bring them, each with the answer that helps: folders of `tests/cases`.

use std::path::{Path, PathBuf};

use armcal::robot::load;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Answer, answer, edit, program, read, root, temp};

/// A copy of a case's folder.
struct Case {
    folder: TempDir,
}

impl Case {
    fn new(name: &str) -> Self {
        let case = Self { folder: temp() };
        copy(&root().join("tests/cases").join(name), case.folder.path());
        case
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn calibrate(&self, recording: &str, task: &str) -> Answer {
        let mut command = program();
        command.arg("calibrate").arg(self.file(recording)).arg("--robot").arg(self.file("robot"));
        command.arg("--input").arg(self.file("input.toml")).arg("--tag-map").arg(self.file("tags.toml"));
        if !task.is_empty() {
            command.arg("--task").arg(self.file(task));
        }
        answer(command.arg("--out").arg(self.file("out")))
    }

    fn new_robot(&self, urdf: &str, options: &[&str]) -> Answer {
        let mut command = program();
        answer(command.arg("new-robot").arg(self.file(urdf)).args(options).arg("--out").arg(self.file("made")))
    }

    fn summary(&self) -> Value {
        serde_json::from_str(&read(&self.file("out/summary.json"))).expect("summary.json reads")
    }

    /// First code of a refusal, and the figures behind it.
    fn refused(&self, task: &str) -> Value {
        self.calibrate("run.mcap", task).expect("refused", 4, &[]);
        self.summary()["refusals"][0].clone()
    }

    fn accepted(&self) {
        self.calibrate("run.mcap", "task.toml").expect("accepted after the advice", 0, &[]);
    }
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("made");
    for entry in std::fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let there = to.join(entry.file_name());
        if entry.file_type().expect("a type").is_dir() {
            copy(&entry.path(), &there);
        } else {
            std::fs::copy(entry.path(), there).expect("copied");
        }
    }
}

#[test]
fn the_baseline_of_a_laser_tracker_is_plain_least_squares() {
    let case = Case::new("laser_tracker_baseline");
    case.calibrate("offset.csv", "").expect("accepted", 0, &[]);
    let held_out = &case.summary()["held_out"];
    let baseline_m = held_out["baseline"]["rms_m"].as_f64().expect("a figure");
    assert!(baseline_m < 0.0036, "{held_out}");
}

#[test]
fn zeros_of_another_convention_are_named_with_both_explanations() {
    let case = Case::new("zero_convention_90deg");
    let refused = case.refused("task.toml");
    assert_eq!(refused["code"], "joint_zeros", "{refused}");
    let zeros = refused["found"]["joints"].as_array().expect("joints");
    let names: Vec<&str> = zeros.iter().filter_map(|zero| zero["joint"].as_str()).collect();
    assert_eq!(names, ["lift", "elbow"]);
    let codes: Vec<Value> = case.summary()["refusals"].as_array().expect("all").clone();
    assert!(codes.iter().any(|refusal| refusal["code"] == "repair_too_large"), "the links are the other explanation");
}

#[test]
fn one_joint_in_degrees_is_named_with_its_unit() {
    let refused = Case::new("one_joint_in_degrees").refused("task.toml");
    assert_eq!((&refused["code"], &refused["joint"]), (&"sensor_unit".into(), &"j6".into()), "{refused}");
}

/// The readings are stated as angles: the line of robot.toml does not affect them, that of the input map does.
#[test]
fn one_joint_in_degrees_among_stated_angles_is_put_right_by_the_advice() {
    let case = Case::new("one_joint_in_degrees");
    edit(&case.file("input.toml"), "[joint_sensors]\n", "[joint_sensors]\nunit = \"rad\"\n");
    let refused = case.refused("task.toml");
    assert_eq!((&refused["code"], &refused["joint"]), (&"sensor_unit".into(), &"j6".into()), "{refused}");
    let text = refused["text"].as_str().expect("text");
    let line = text.rsplit("input map: ").next().expect("a line");
    edit(&case.file("input.toml"), "[joint_sensors]\n", &format!("[joint_sensors]\n{line}\n"));
    case.accepted();
}

#[test]
fn exchanged_readings_are_named_and_the_advice_works() {
    let case = Case::new("joint_names_swapped");
    let refused = case.refused("task.toml");
    assert_eq!(refused["code"], "joints_exchanged", "{refused}");
    let text = refused["text"].as_str().expect("text");
    let line = text.rsplit("input map: ").next().expect("a line");
    edit(&case.file("input.toml"), "[joint_sensors]\n", &format!("[joint_sensors]\n{line}\n"));
    case.accepted();
}

#[test]
fn tags_that_are_turned_alike_are_named_and_the_advice_works() {
    let case = Case::new("tag_frame_z_into_tag");
    let refused = case.refused("task.toml");
    assert_eq!(refused["code"], "input_tag_frames", "{refused}");
    let turn = refused["input"]["tag_frames"].as_array().expect("a quaternion");
    let turn: Vec<f64> = turn.iter().filter_map(Value::as_f64).collect();
    let turn = quaternion(&turn);
    let path = case.file("tags.toml");
    let mut map: toml::Table = toml::from_str(&read(&path)).expect("TOML");
    for tag in map["tag"].as_array_mut().expect("tags") {
        let was: Vec<f64> =
            tag["quaternion_wxyz"].as_array().expect("four").iter().filter_map(toml::Value::as_float).collect();
        let turned = quaternion(&was) * turn;
        tag["quaternion_wxyz"] = toml::Value::try_from([turned.w, turned.i, turned.j, turned.k]).expect("numbers");
    }
    std::fs::write(&path, map.to_string()).expect("written");
    case.accepted();
}

fn quaternion(wxyz: &[f64]) -> nalgebra::Quaternion<f64> {
    nalgebra::Quaternion::new(wxyz[0], wxyz[1], wxyz[2], wxyz[3])
}

#[test]
fn a_lens_of_air_in_water_is_named_with_the_focal_length() {
    let case = Case::new("air_lens_in_water");
    let refused = case.refused("task.toml");
    assert_eq!(refused["code"], "lens_contradicted", "{refused}");
    let ratio = refused["ratio"].as_f64().expect("a ratio");
    assert!((ratio / 1.333 - 1.0).abs() < 0.002, "{ratio}");
    // Held-out views are judged by the estimated lens.
    let held_out_m = case.summary()["held_out"]["rms_m"].as_f64().expect("a figure");
    assert!(held_out_m < 0.003, "{held_out_m}");
}

/// A camera file with another lens model makes no map of a grid: it is refused, or the lens is estimated.
#[test]
fn a_tag_map_by_the_wrong_lens_model_is_not_given_out() {
    let case = Case::new("tagmap_wrong_lens_model");
    for (lens, is_wrong) in [("cam-pinhole-equi.yaml", true), ("cam-pinhole-radtan.yaml", false)] {
        let mut command = program();
        command.arg("tagmap").arg(case.file("grid.mcap")).arg("--camera").arg(case.file(lens));
        command.arg("--tags").arg(case.file("grid.yaml")).args(["--topic", "/cam0/detections", "--mode", "unknown"]);
        let said = answer(command.arg("--out").arg(case.file(&format!("{lens}.toml"))));
        let is_refused = said.stderr.contains("[input_lens_model]");
        said.expect(lens, if is_refused { 4 } else { 0 }, &[]);
        assert!(!said.stderr.contains("[corners_noisy]"), "{lens}: {}", said.stderr);
        assert_eq!(is_refused || said.stderr.contains("[lens]"), is_wrong, "{lens}: {}", said.stderr);
    }
}

#[test]
fn targets_out_of_reach_refuse_by_their_numbers() {
    let case = Case::new("targets_out_of_reach");
    for (task, numbers) in [("task.toml", vec![1, 2]), ("half.toml", vec![2])] {
        let refused = case.refused(task);
        assert_eq!(
            (&refused["code"], &refused["targets"]),
            (&"targets_not_judged".into(), &numbers.into()),
            "{refused}"
        );
    }
}

#[test]
fn poses_of_a_task_in_degrees_are_named_before_anything_is_calibrated() {
    let case = Case::new("targets_out_of_reach");
    case.calibrate("run.mcap", "poses-in-degrees.toml").expect("refused", 2, &["poses_rad[0]", "[joint_limit]"]);
}

/// Elements that calibration does not need are skipped, and the warning names their link or joint.
#[test]
fn urdfs_of_makers_become_robot_folders() {
    for (case, urdf, named) in [
        ("tiny_mass", "tinymass", &["`tool`", "[urdf_skipped]"][..]),
        ("urdf_strictness", "zerobox", &["`base_link`", "[urdf_skipped]"][..]),
        ("urdf_strictness", "twomat", &["`base_link`", "[urdf_skipped]"][..]),
        ("urdf_strictness", "novel", &["`j2`", "[urdf_skipped]"]),
        ("urdf_strictness", "biglimit", &[]),
        ("urdf_strictness", "noaxisxyz", &[]),
    ] {
        let case = Case::new(case);
        case.new_robot(&format!("{urdf}.urdf"), &[]).expect(urdf, 0, named);
        let robot = load(&case.file("made")).expect("it reads");
        assert_eq!(robot.joint_names(), ["j1", "j2", "j3", "j4", "j5", "j6"], "{urdf}");
    }
}

#[test]
fn a_mimic_in_the_chain_is_refused_by_name_with_and_without_options() {
    let case = Case::new("mimic_in_chain");
    for options in [vec![], vec!["--base", "base_link", "--tip", "tool"]] {
        case.new_robot("mimic.urdf", &options).expect("refused", 2, &["`j5b`", "(mimic)"]);
    }
}

#[test]
fn two_clocks_are_named_with_their_difference_and_the_advice_works() {
    let case = Case::new("camera_boot_clock");
    case.calibrate("run.mcap", "task.toml").expect(
        "refused",
        2,
        &["/detections", "/joint_states", "1699995000.000", "log_time", "[clocks_differ]"],
    );
    let map = case.file("input.toml");
    std::fs::write(&map, format!("stamps = \"log_time\"\n{}", read(&map))).expect("written");
    case.accepted();
}

#[test]
fn messages_without_positions_are_skipped_counted_and_said() {
    let case = Case::new("velocity_only_messages");
    case.calibrate("run.mcap", "task.toml").expect("accepted", 0, &[" 40 ", "[messages_rejected]"]);
}

#[test]
fn a_proposed_map_has_the_camera_info_that_the_recording_has() {
    let case = Case::new("proposal_without_lens");
    let mut command = program();
    command.arg("inspect").arg(case.file("run.mcap")).arg("--robot").arg(case.file("robot"));
    answer(command.arg("--write-input").arg(case.file("input.toml"))).expect("proposed", 0, &[]);
    assert!(read(&case.file("input.toml")).contains("camera_info"));
    case.accepted();
}

#[test]
fn detections_of_another_package_are_read_by_their_whole_type_name() {
    Case::new("isaac_detections").accepted();
}

#[test]
fn a_ros_1_bag_is_refused_with_its_conversion_and_tables_are_named() {
    let case = Case::new("ros1_and_tables");
    let inspect = |name: &str| answer(program().arg("inspect").arg(case.file(name)));
    inspect("run.bag").expect("refused", 2, &["rosbags-convert", "[recording_format]"]);
    for (name, found) in [("ros1.mcap", "rosbags"), ("joints.yaml", "`joint_values`"), ("samples.yaml", "`samples`")] {
        inspect(name).expect(name, 0, &[found]);
    }
}

#[test]
fn a_joint_twice_in_a_message_is_refused_with_both_values() {
    let case = Case::new("duplicate_joint_name");
    case.calibrate("run.mcap", "task.toml").expect("refused", 2, &["`j3`", "1.294821", "[message_invalid]"]);
}

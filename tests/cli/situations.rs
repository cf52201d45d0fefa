//! Valid files with impossible requests: refused before anything moves, with the place of the error.

use std::path::{Path, PathBuf};

use armcal::log::read_recording;
use armcal::streams::Message;

use crate::support::texts::Texts;
use crate::support::{
    Answer, ShortRoutine, answer, calibrate, edit, program, read, robot_copy, run, shared_run, temp, vehicle_file,
    write,
};

fn run_short(routine: &ShortRoutine, folder: &Path) -> Answer {
    run(&routine.write(folder), &folder.join("out"))
}

/// Nothing moved, so no file is worth keeping: neither results nor part of a recording are in the folder.
#[track_caller]
fn assert_nothing_left(folder: &Path) {
    let left: Vec<_> = std::fs::read_dir(folder.join("out")).into_iter().flatten().flatten().collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn a_target_out_of_reach_is_named_with_its_place() {
    let _texts = Texts::of("a_target_out_of_reach_is_named_with_its_place");
    let folder = temp();
    let mut routine = ShortRoutine::default();
    routine.targets_m[2] = [2.5, 0.0, 0.0];
    run_short(&routine, folder.path()).expect("far", 2, &["target 3", "2.500"]);
    assert_nothing_left(folder.path());
}

#[test]
fn a_target_within_the_vehicle_is_named_with_what_is_in_the_way() {
    let folder = temp();
    let mut routine = ShortRoutine::default();
    // The target lies on the face of the starboard toe plate.
    routine.targets_m[1] = [1.34, -0.1, -0.99];
    run_short(&routine, folder.path()).expect("inside", 2, &["target 2", "clearance", "toe_plate_starboard"]);
    assert_nothing_left(folder.path());
}

#[test]
fn a_start_in_collision_is_refused_and_names_the_obstacle() {
    let _texts = Texts::of("a_start_in_collision_is_refused_and_names_the_obstacle");
    let folder = temp();
    // The box is around the forearm of the stowed arm: the vehicle frame's origin is 1.7 m behind the base.
    let tail =
        "[[obstacle]]\nname = \"crate\"\nshape = \"box\"\nsize_m = [1.2, 1.2, 1.2]\nposition_m = [2.3, -0.6, 0.6]\n";
    let routine = ShortRoutine { tail: tail.to_owned(), ..ShortRoutine::default() };
    run_short(&routine, folder.path()).expect("in collision", 2, &["crate"]);
    assert_nothing_left(folder.path());
}

#[test]
fn more_tags_than_there_are_cannot_be_seen() {
    let _texts = Texts::of("more_tags_than_there_are_cannot_be_seen");
    let folder = temp();
    let routine = ShortRoutine { min_tags: 9, ..ShortRoutine::default() };
    run_short(&routine, folder.path()).expect("9 tags", 2, &[]);
    assert_nothing_left(folder.path());
}

#[test]
fn tags_that_face_away_leave_no_pose() {
    let _texts = Texts::of("tags_that_face_away_leave_no_pose");
    let folder = temp();
    let robot = robot_copy(folder.path());
    let file = robot.join("robot.toml");
    let turned = |line: &str| -> String {
        let Some(numbers) = line.strip_prefix("quaternion_wxyz = [").and_then(|rest| rest.strip_suffix(']')) else {
            return format!("{line}\n");
        };
        let q: Vec<f64> = numbers.split(", ").map(|n| n.parse().expect("a number")).collect();
        // Half a turn about the tag's own y.
        format!("quaternion_wxyz = [{:?}, {:?}, {:?}, {:?}]\n", -q[2], -q[3], q[0], q[1])
    };
    write(&file, &read(&file).lines().map(turned).collect::<String>());
    let routine = ShortRoutine { robot, ..ShortRoutine::default() };
    run_short(&routine, folder.path()).expect("turned tags", 2, &[]);
    assert_nothing_left(folder.path());
}

#[test]
fn a_robot_without_tags_is_refused() {
    let _texts = Texts::of("a_robot_without_tags_is_refused");
    let folder = temp();
    let robot = robot_copy(folder.path());
    let file = robot.join("robot.toml");
    let text = read(&file);
    write(&file, &text[..text.find("[[tag]]").expect("tags")]);
    let routine = ShortRoutine { robot, ..ShortRoutine::default() };
    run_short(&routine, folder.path()).expect("no tags", 2, &[]);
}

/// A number that causes overflow is wrong input, not a crash.
#[test]
fn absurd_lengths_are_refused() {
    let folder = temp();
    let robot = robot_copy(folder.path());
    edit(
        &robot.join("titan4.urdf"),
        "<origin xyz=\"-0.17691 0.83228 0\" rpy=\"1.5708",
        "<origin xyz=\"1e300 0 0\" rpy=\"1.5708",
    );
    run_short(&ShortRoutine { robot, ..ShortRoutine::default() }, folder.path()).expect("URDF", 2, &["titan4.urdf"]);
    let robot = robot_copy(folder.path());
    edit(&robot.join("titan4.urdf"), "effort=\"1600\"", "effort=\"1e300\"");
    run_short(&ShortRoutine { robot, ..ShortRoutine::default() }, folder.path()).expect("effort", 2, &["effort"]);
    let vehicle = folder.path().join("vehicle.toml");
    write(&vehicle, &read(&vehicle_file()));
    edit(&vehicle, "position_m = [1.7, -0.6, 0.1]", "position_m = [1e300, -0.6, 0.1]");
    run_short(&ShortRoutine { vehicle, ..ShortRoutine::default() }, folder.path()).expect(
        "mount",
        2,
        &["vehicle.toml"],
    );
}

/// A datasheet without any uncertainty leaves no parameter to calibrate.
#[test]
fn sensors_that_cannot_be_wrong_leave_nothing_to_fit() {
    let _texts = Texts::of("sensors_that_cannot_be_wrong_leave_nothing_to_fit");
    let folder = temp();
    let robot = robot_copy(folder.path());
    let file = robot.join("robot.toml");
    let exact = read(&file)
        .replace("gain_std = 0.03", "gain_std = 0.0")
        .replace("offset_std_rad = 0.05", "offset_std_rad = 0.0");
    write(&file, &exact);
    let recording = shared_run().file("run.mcap");
    calibrate(&recording, &robot, &folder.path().join("out")).expect("exact sensors", 2, &["robot.toml"]);
}

/// An arm that never comes to rest is distinguished from a recording without marks.
#[test]
fn an_arm_that_never_settles_leaves_nothing_to_calibrate() {
    let _texts = Texts::of("an_arm_that_never_settles_leaves_nothing_to_calibrate");
    let folder = temp();
    let tail = "[world.joint_sensors]\nnoise_rms_counts = 500.0\n".to_owned();
    let mut routine = ShortRoutine { poses: 3, held_out: 3, tail, ..ShortRoutine::default() };
    routine.targets_m.truncate(1);
    let answer = run_short(&routine, folder.path());
    assert_eq!(answer.code, 1, "{answer:#?}");
    // Sixteen poses might be tried; after six consecutive failures the run ends.
    assert!(answer.stderr.contains("run-cut-1.mcap"), "{answer:#?}");
    assert!(!folder.path().join("out/calibration.toml").exists());
    let kept = read_recording(folder.path().join("out/run-cut-1.mcap")).expect("the kept recording reads");
    let said = kept.messages.iter().filter(|(_, m)| matches!(m, Message::Log(line) if line.text.contains("settle")));
    assert_eq!(said.count(), 6, "each pose is given up aloud");
}

/// A Titan with a seventh joint: a roll of the forearm about the upper arm, in a link so short that the two meet.
fn seven_joints(folder: &Path, allowed_pairs: &str) -> PathBuf {
    let robot = robot_copy(folder);
    edit(
        &robot.join("titan4.urdf"),
        "<parent link=\"upperarm_link\"/><child link=\"forearm_link\"/>",
        "<parent link=\"roll_link\"/><child link=\"forearm_link\"/>",
    );
    let elbow = "<origin xyz=\"-0.17691 0.83228 0\" rpy=\"1.5708";
    edit(&robot.join("titan4.urdf"), elbow, "<origin xyz=\"0 0.02 0\" rpy=\"1.5708");
    let roll = "<link name=\"roll_link\"><inertial><mass value=\"4\"/><inertia ixx=\"0.02\" ixy=\"0\" ixz=\"0\" \
                iyy=\"0.02\" iyz=\"0\" izz=\"0.02\"/></inertial></link>\n\
                <joint name=\"upperarm_roll\" type=\"continuous\"><parent link=\"upperarm_link\"/>\
                <child link=\"roll_link\"/><origin xyz=\"-0.17691 0.81228 0\" rpy=\"0 0 0\"/><axis xyz=\"0 1 0\"/>\
                <limit effort=\"900\" velocity=\"0.6\"/></joint>\n</robot>";
    edit(&robot.join("titan4.urdf"), "</robot>", roll);
    let file = robot.join("robot.toml");
    edit(&file, "stowed_rad = [-1.32, -0.32, -0.36,", "stowed_rad = [-1.32, -0.32, 0.0, -0.36,");
    let text = read(&file);
    let sensor = text.find("[[joint_sensor]]\njoint = \"forearm_pitch\"").expect("a sensor");
    let next = text[sensor..].find("[[joint_sensor]]\njoint = \"wrist_pitch\"").expect("another") + sensor;
    let roll = text[sensor..next].replace("forearm_pitch", "upperarm_roll");
    let (before, after) = text.split_at(sensor);
    write(&file, &format!("{allowed_pairs}\n{before}{roll}{after}"));
    robot
}

/// A continuous middle joint, and adjacent links of which one pair touches by design.
#[test]
fn a_short_roll_link_needs_its_neighbours_allowed() {
    let folder = temp();
    let check = |robot: &Path| answer(program().arg("check").arg(robot));
    let words = ["robot.toml", "upperarm_link", "forearm_link", "allowed_pairs"];
    let refused = seven_joints(folder.path(), "");
    check(&refused).expect("touching", 2, &words);
    let routine = ShortRoutine { robot: refused, ..ShortRoutine::default() };
    run_short(&routine, folder.path()).expect("touching", 2, &words[1..]);
    assert_nothing_left(folder.path());
    let robot = seven_joints(folder.path(), "allowed_pairs = [[\"upperarm_link\", \"forearm_link\"]]");
    check(&robot).expect("allowed", 0, &["7 joints"]);
    let mut routine = ShortRoutine { robot, poses: 6, held_out: 0, ..ShortRoutine::default() };
    routine.targets_m.truncate(1);
    let ran = run_short(&routine, folder.path());
    assert!(ran.stdout.contains("contacts     0"), "{ran:#?}");
}

//! Wrong input files: exit code 2 and a message that names the file and the place of the error.

use std::path::{Path, PathBuf};

use crate::support::texts::Texts;
use crate::support::{
    Answer, ShortRoutine, answer, edit, program, robot_copy, robot_folder, run, temp, vehicle_file, write,
};

fn check(file: &Path) -> Answer {
    answer(program().arg("check").arg(file))
}

/// A routine with all files that it names in one folder, for a test to falsify.
struct Kit {
    folder: tempfile::TempDir,
    robot: PathBuf,
    vehicle: PathBuf,
    routine: PathBuf,
}

impl Kit {
    fn new() -> Self {
        let folder = temp();
        let robot = robot_copy(folder.path());
        let vehicle = folder.path().join("vehicle.toml");
        std::fs::copy(vehicle_file(), &vehicle).expect("copied");
        let routine = ShortRoutine { robot: robot.clone(), vehicle: vehicle.clone(), ..ShortRoutine::default() };
        let routine = routine.write(folder.path());
        Self { folder, robot, vehicle, routine }
    }

    fn run(&self) -> Answer {
        run(&self.routine, &self.folder.path().join("out"))
    }

    /// Both `run` and `check` refuse, in the same words.
    #[track_caller]
    fn expect_refused(&self, what: &str, words: &[&str]) {
        self.run().expect(what, 2, words);
        check(&self.routine).expect(what, 2, words);
        assert!(!self.folder.path().join("out/calibration.toml").exists(), "{what}: left a result");
    }
}

/// Text to replace in a file, its replacement, and the words that the message must have.
type Spoilt<'a> = (&'a str, &'a str, &'a [&'a str]);

const ROUTINE: &[Spoilt] = &[
    ("poses = 12", "poses = 12\nposess = 3", &["short.toml", "posess"]),
    ("poses = 12", "poses = 2", &["short.toml", "capture.poses", "3 .. 1000"]),
    ("poses = 12", "poses = -1", &["short.toml", "poses"]),
    ("held_out = 4", "held_out = 2000", &["short.toml", "capture.held_out"]),
    ("min_tags = 3", "min_tags = 0", &["short.toml", "capture.min_tags"]),
    ("dwell_s = 0.6", "dwell_s = nan", &["short.toml", "capture.dwell_s", "NaN"]),
    ("dwell_s = 0.6", "dwell_s = inf", &["short.toml", "capture.dwell_s", "inf"]),
    ("dwell_s = 0.6", "clearance_m = -0.1", &["short.toml", "capture.clearance_m"]),
    ("tolerance_m = 0.03", "tolerance_m = 0.0", &["short.toml", "task.tolerance_m"]),
    ("tolerance_m = 0.03", "tolerance_m = \"small\"", &["short.toml", "tolerance_m"]),
    ("[[0.5, 1.62, 0.323]", "[[0.5, nan, 0.323]", &["short.toml", "task.targets_m[0]", "NaN"]),
    ("[[0.5, 1.62, 0.323]", "[[0.5, 1.62]", &["short.toml", "targets_m"]),
    ("seed = 1", "seed = -1", &["short.toml", "seed"]),
    ("seed = 1", "seed = 1\nmethod = \"best\"", &["short.toml", "method", "best", "minimum_distance"]),
    ("name = \"short\"", "name = \"../short\"", &["short.toml", "name"]),
    ("version = 1", "version = 2", &["short.toml", "version"]),
    ("version = 1", "version = 1 1", &["short.toml", "line 1"]),
];

const WORLD: &[(&str, &[&str])] = &[
    ("[world.camera]\nrate = 5.0", &["short.toml", "world.camera", "rate"]),
    ("[world.camera]\nmode = \"rendered\"\nport = \"flat\"", &["short.toml", "world.camera.port"]),
    ("[camera]\nmode = \"rendered\"\n[world.camera]\nmode = \"geometric\"", &["short.toml", "camera.mode"]),
    ("[camera]\nmode = \"painted\"", &["short.toml", "camera.mode"]),
    ("[world.image]\nblur_px = -1.0", &["short.toml", "world.image.blur_px", "0 .. 10"]),
    ("[world.weather]\nwind = 5.0", &["short.toml", "world.weather"]),
    ("[world.clock]\ncamera_jitter_s = nan", &["short.toml", "world.clock.camera_jitter_s", "NaN"]),
    ("[world.camera]\nmiss_probability = 1.5", &["short.toml", "world.camera.miss_probability", "0 .. 1"]),
    ("[world.physics]\nstep_s = 0.003", &["short.toml", "world.physics.step_s"]),
    (
        "[world.hydraulics]\nbulk_modulus_pa = 1e11\n[world.physics]\nstep_s = 0.005",
        &["short.toml", "world.physics.step_s"],
    ),
    ("[world.vehicle]\nmotion = \"adrift\"", &["short.toml", "world.vehicle", "adrift", "free"]),
    ("[world.vehicle]\nmotion = \"recorded\"", &["short.toml", "world.vehicle.motion_file"]),
    ("[world.vehicle]\nmotion_file = \"dive.csv\"", &["short.toml", "world.vehicle.motion_file"]),
    ("[world.vehicle]\nmotion = \"recorded\"\nmotion_file = \"none.csv\"", &["none.csv"]),
    ("[world.water]\ncurrent_m_s = [0.0, nan, 0.0]", &["short.toml", "world.water.current_m_s[1]", "NaN"]),
    ("[world]\nseed = 3", &["short.toml", "world.seed"]),
    (
        "[[obstacle]]\nname = \"a\"\nshape = \"cone\"\nposition_m = [0.0, 0.0, 0.0]",
        &["short.toml", "obstacle `a`", "cone"],
    ),
    ("[[obstacle]]\nname = \"a\"\nshape = \"sphere\"\nposition_m = [0.0, 0.0, 0.0]", &["obstacle `a`", "radius_m"]),
];

const ROBOT: &[Spoilt] = &[
    ("[tool]", "[tool]\nlength_m = 1.0", &["robot.toml", "length_m"]),
    ("offset_counts = 3792.0", "offset_counts = nan", &["robot.toml", "shoulder_pitch", "offset_counts", "NaN"]),
    ("scale_counts_per_deg = 52.0", "scale_counts_per_deg = 0.0", &["robot.toml", "forearm_pitch", "scale_counts"]),
    ("gain_bound = 0.05", "gain_bound = 5.0", &["robot.toml", "shoulder_yaw", "gain_bound", "0 .. 0.5"]),
    ("joint = \"wrist_yaw\"", "joint = \"wrist_jaw\"", &["robot.toml", "joint_sensor", "wrist_jaw"]),
    ("kind = \"potentiometer\"", "kind = \"gyro\"", &["robot.toml", "kind", "gyro"]),
    ("model = \"equidistant\"", "model = \"mei\"", &["robot.toml", "camera.model", "mei", "pinhole"]),
    ("model = \"equidistant\"", "model = \"pinhole\"", &["robot.toml", "camera.max_view_angle_rad", "pinhole"]),
    ("distortion = [0.02268", "distortion = [-5.0", &["robot.toml", "camera.distortion"]),
    ("size_m = 0.15", "size_m = inf", &["robot.toml", "tag 0", "size_m"]),
    ("quaternion_wxyz = [0.5, 0.5, 0.5, 0.5]", "quaternion_wxyz = [0.0, 0.0, 0.0, 0.0]", &["robot.toml", "tag 0"]),
    ("id = 1\n", "id = 0\n", &["robot.toml", "tag 0", "twice"]),
    ("base_tag = 0", "base_tag = 70", &["robot.toml", "base_tag", "70"]),
    ("base_tag = 0", "base_tag = 0\ntag_link = \"hand\"", &["robot.toml", "tag_link", "`hand`"]),
    ("base_tag = 0", "base_tag = 0\ntag_link = \"base_link\"", &["robot.toml", "tag_link"]),
    ("base_tag = 0", "base_tag = 0\ntag_link = \"manipulator_link\"", &["robot.toml", "tag_link"]),
    ("stowed_rad = [-1.32, ", "stowed_rad = [", &["robot.toml", "stowed_rad", "6"]),
    ("base_link = \"base_link\"", "base_link = \"bottom\"", &["titan4.urdf", "bottom"]),
    ("link = \"fisheye\"", "link = \"eye\"", &["titan4.urdf", "eye"]),
    ("opening_max_m = 0.1", "opening_max_m = 0.0", &["robot.toml", "gripper.opening_max_m", "0.001 .. 2"]),
    ("rest_opening_m = 0.022", "rest_opening_m = 0.2", &["robot.toml", "gripper.rest_opening_m", "0 .. 0.1"]),
    ("closing_time_s = 2.0", "closing_time_s = nan", &["robot.toml", "gripper.closing_time_s", "NaN"]),
    (
        "opens_along = [1.0, 0.0, 0.0]",
        "opens_along = [0.0, 0.0, 0.0]",
        &["robot.toml", "gripper.opens_along", "direction"],
    ),
    ("\"jaw_left_link\", ", "\"claw\", ", &["robot.toml", "gripper.jaws"]),
    ("\"jaw_left_link\", ", "\"fisheye\", ", &["robot.toml", "gripper.jaws"]),
    ("\"jaw_left_link\", ", "\"jaw_right_link\", ", &["robot.toml", "gripper.jaws", "twice"]),
    ("closing_time_s = 2.0", "closing_time_s = 2.0\nforce_n = 4.0", &["robot.toml", "force_n"]),
    ("urdf = \"titan4.urdf\"", "urdf = \"titan5.urdf\"", &["titan5.urdf"]),
];

const VEHICLE: &[Spoilt] = &[
    ("mass_kg = 4000.0", "mass_kg = 4000.0\nlength_m = 3.0", &["vehicle.toml", "length_m"]),
    ("mass_kg = 4000.0", "mass_kg = nan", &["vehicle.toml", "mass_kg", "NaN"]),
    ("mass_kg = 4000.0", "mass_kg = -4000.0", &["vehicle.toml", "mass_kg", "1 .. 10000000"]),
    (
        "inertia_kg_m2 = [1700.0,",
        "inertia_kg_m2 = [-1700.0,",
        &["vehicle.toml", "dynamics.inertia_kg_m2[0]", "0.1 .. 100000000"],
    ),
    ("thrust_max_n = [3200.0,", "thrust_max_n = [nan,", &["vehicle.toml", "dynamics.thrust_max_n[0]", "NaN"]),
    ("size_m = [2.6, 1.7, 0.5]", "size_m = [2.6, -1.7, 0.5]", &["vehicle.toml", "float_block", "size_m[1]"]),
    ("position_m = [1.7, -0.6, 0.1]", "position_m = [nan, -0.6, 0.1]", &["vehicle.toml", "mount"]),
    ("shape = \"box\"", "shape = \"hull\"", &["vehicle.toml", "float_block", "hull"]),
    ("half_angle_rad = 0.8", "half_angle_rad = 9.0", &["vehicle.toml", "light[0].half_angle_rad", "0.02 .. 3"]),
    ("flux_lm = 15000.0", "flux_lm = nan", &["vehicle.toml", "light[0].flux_lm", "NaN"]),
];

const URDF: &[Spoilt] = &[
    // The parent of the upper arm is the link that it carries.
    (
        "<parent link=\"trunk_link\"/><child link=\"upperarm_link\"/>",
        "<parent link=\"forearm_link\"/><child link=\"upperarm_link\"/>",
        &["titan4.urdf", "loop"],
    ),
    // One link is the child of two joints.
    ("<child link=\"fisheye\"/>", "<child link=\"trunk_link\"/>", &["titan4.urdf", "loop", "trunk_link"]),
    ("<parent link=\"trunk_link\"/>", "<parent link=\"trunk\"/>", &["titan4.urdf", "shoulder_pitch", "`trunk`"]),
    (
        "type=\"revolute\"",
        "type=\"prismatic\"",
        &["robot.toml", "`shoulder_yaw`: scale_counts_per_deg", "prismatic", "scale_counts_per_mm, offset_std_m"],
    ),
    ("type=\"revolute\"", "type=\"planar\"", &["titan4.urdf", "shoulder_yaw", "planar"]),
    ("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>", &["titan4.urdf", "shoulder_yaw", "axis"]),
    ("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 nan 0\"/>", &["titan4.urdf", "shoulder_yaw", "axis"]),
    (
        "<cylinder radius=\"0.075\" length=\"0.660874\"/>",
        "<mesh filename=\"a.stl\"/>",
        &["titan4.urdf", "upperarm_link", "a.stl"],
    ),
    ("<link name=\"fisheye\">", "<link name=\"fisheye\"", &["titan4.urdf"]),
];

#[test]
fn a_wrong_routine_is_refused_with_file_and_key() {
    for &(from, to, words) in ROUTINE {
        let kit = Kit::new();
        edit(&kit.routine, from, to);
        kit.expect_refused(to, words);
    }
}

#[test]
fn a_wrong_world_or_scene_is_refused_with_file_and_key() {
    let _texts = Texts::of("a_wrong_world_or_scene_is_refused_with_file_and_key");
    for &(tail, words) in WORLD {
        let kit = Kit::new();
        let text = crate::support::read(&kit.routine);
        write(&kit.routine, &format!("{text}{tail}\n"));
        kit.expect_refused(tail, words);
    }
}

/// For a motion with gaps, invalid numbers or jumps the message names the line.
#[test]
fn a_wrong_motion_is_refused_with_file_and_line() {
    const HEADER: &str = "time_s,x_m,y_m,z_m,roll_rad,pitch_rad,yaw_rad";
    let row = |time_s: &str, x_m: &str| format!("{time_s},{x_m},0,0,0,0,0\n");
    let still = |times: [&str; 5]| times.map(|time_s| row(time_s, "0")).concat();
    let cases = [
        (still(["0", "0.2", "1.6", "1.8", "2.0"]), ["line 4", "time_s"]),
        (still(["0", "0.2", "nan", "0.6", "0.8"]), ["line 4", "NaN"]),
        (still(["0", "0.4", "0.2", "0.6", "0.8"]), ["line 4", "time_s"]),
        (still(["0", "0.2", "0.4", "0.6", "0.8"]) + &row("1.0", "40"), ["line", "m/s2"]),
        (row("0", "0"), ["4", "samples"]),
    ];
    for (rows, words) in cases {
        let kit = Kit::new();
        write(&kit.folder.path().join("dive.csv"), &format!("{HEADER}\n{rows}"));
        let text = crate::support::read(&kit.routine);
        let tail = "[world.vehicle]\nmotion = \"recorded\"\nmotion_file = \"dive.csv\"\n";
        write(&kit.routine, &format!("{text}{tail}"));
        kit.expect_refused(&rows, &["dive.csv", words[0], words[1]]);
    }
}

#[test]
fn a_wrong_robot_is_refused_with_file_and_key() {
    let _texts = Texts::of("a_wrong_robot_is_refused_with_file_and_key");
    for &(from, to, words) in ROBOT {
        let kit = Kit::new();
        edit(&kit.robot.join("robot.toml"), from, to);
        kit.expect_refused(to, words);
        check(&kit.robot).expect(to, 2, words);
    }
}

#[test]
fn a_wrong_vehicle_is_refused_with_file_and_key() {
    for &(from, to, words) in VEHICLE {
        let kit = Kit::new();
        edit(&kit.vehicle, from, to);
        kit.expect_refused(to, words);
        check(&kit.vehicle).expect(to, 2, words);
    }
}

#[test]
fn a_wrong_urdf_is_refused_with_file_and_joint_or_link() {
    let _texts = Texts::of("a_wrong_urdf_is_refused_with_file_and_joint_or_link");
    for &(from, to, words) in URDF {
        let kit = Kit::new();
        edit(&kit.robot.join("titan4.urdf"), from, to);
        kit.expect_refused(to, words);
        check(&kit.robot).expect(to, 2, words);
    }
}

/// Values that only a run uses refuse the run, not the robot folder.
const URDF_OF_A_RUN: &[Spoilt] = &[
    ("lower=\"-3.6296\"", "lower=\"3.6296\"", &["titan4.urdf", "shoulder_yaw", "limit"]),
    ("mass value=\"18.709626\"", "mass value=\"nan\"", &["titan4.urdf", "forearm_link", "mass"]),
    ("mass value=\"18.709626\"", "mass value=\"-18.7\"", &["titan4.urdf", "forearm_link", "mass"]),
];

#[test]
fn a_urdf_that_calibrates_may_still_refuse_a_run() {
    let _texts = Texts::of("a_urdf_that_calibrates_may_still_refuse_a_run");
    for &(from, to, words) in URDF_OF_A_RUN {
        let kit = Kit::new();
        edit(&kit.robot.join("titan4.urdf"), from, to);
        kit.run().expect(to, 2, words);
        check(&kit.robot).expect(to, 0, words);
    }
}

/// A link without mass can be calibrated from a recording, but not simulated.
#[test]
fn a_link_without_mass_is_refused_by_the_simulation_alone() {
    let _texts = Texts::of("a_link_without_mass_is_refused_by_the_simulation_alone");
    let kit = Kit::new();
    edit(&kit.robot.join("titan4.urdf"), "mass value=\"18.709626\"", "mass value=\"0\"");
    kit.run().expect("zero mass", 2, &["forearm_link", "mass"]);
    check(&kit.robot).expect("zero mass", 0, &[]);
}

#[test]
fn a_joint_without_effort_is_refused_by_the_simulation() {
    let kit = Kit::new();
    edit(&kit.robot.join("titan4.urdf"), "effort=\"1600\"", "effort=\"0\"");
    kit.run().expect("no effort", 2, &["forearm_pitch", "effort"]);
}

#[test]
fn missing_files_are_named() {
    let kit = Kit::new();
    let absent = kit.folder.path().join("absent.toml");
    run(&absent, kit.folder.path()).expect("no routine", 2, &["absent.toml"]);
    check(&absent).expect("no routine", 2, &["absent.toml"]);
    for (key, path) in [("robot", &kit.robot), ("vehicle", &kit.vehicle)] {
        let kit = Kit::new();
        let other = kit.folder.path().join("nowhere");
        let text = crate::support::read(&kit.routine);
        let lines = text.lines().map(|line| {
            if line.starts_with(&format!("{key} = ")) { format!("{key} = {other:?}\n") } else { format!("{line}\n") }
        });
        write(&kit.routine, &lines.collect::<String>());
        kit.expect_refused(&format!("no {key} {}", path.display()), &["nowhere"]);
    }
}

#[test]
fn check_passes_good_files_and_says_what_they_are() {
    let _texts = Texts::of("check_passes_good_files_and_says_what_they_are");
    let run = crate::support::shared_run();
    let mut all = program();
    all.arg("check").arg(&run.routine).arg(robot_folder()).arg(robot_folder().join("robot.toml"));
    all.arg(vehicle_file()).arg(run.file("calibration.toml"));
    let words = ["`short`", "`titan4`", "`work-class-front`"];
    answer(&mut all).expect("good files", 0, &words);
}

/// An error in one file does not prevent the check of the others.
#[test]
fn check_looks_at_every_file() {
    let _texts = Texts::of("check_looks_at_every_file");
    let folder = temp();
    let [bad, other, broken] = ["bad.toml", "other.toml", "broken.toml"].map(|name| folder.path().join(name));
    write(&bad, "version = 1\n");
    write(&other, "not = [toml");
    std::fs::write(&broken, b"version = 1\nname = \"\xff\xfe\"\n").expect("written");
    let found = answer(program().arg("check").args([&bad, &other, &broken]).arg(vehicle_file()));
    found.expect("bad files", 2, &["bad.toml", "other.toml", "broken.toml", "ok: "]);
}

/// A folder of results is not a robot folder, and its other files are no TOML.
#[test]
fn check_names_the_file_of_a_result_that_it_reads() {
    let file = |name: &str| crate::support::shared_run().file(name);
    let folder = file("calibration.toml").parent().expect("a folder").to_owned();
    check(&folder).expect("a folder", 2, &["[file_kind]", "calibration.toml"]);
    for name in ["summary.json", "report.html"] {
        check(&file(name)).expect(name, 2, &["[file_kind]", name, "calibration.toml"]);
    }
}

#[test]
fn check_refuses_a_spoilt_calibration() {
    let _texts = Texts::of("check_refuses_a_spoilt_calibration");
    let folder = temp();
    let file = folder.path().join("calibration.toml");
    let covariance = folder.path().join("calibration.covariance.toml");
    let good = ["calibration.toml", "calibration.covariance.toml"]
        .map(|name| crate::support::read(&crate::support::shared_run().file(name)));
    let spoilt: [(&str, &str, &[&str]); 4] = [
        ("version = 1", "version = 9", &["calibration.toml", "version"]),
        ("offset_rad = ", "offset_rad = 99", &["calibration.toml", "shoulder_yaw", "offset_rad"]),
        ("status = ", "statuss = ", &["calibration.toml", "status"]),
        ("messages_hash = \"", "messages_hash = \"0", &["calibration.covariance.toml"]),
    ];
    for (from, to, words) in spoilt {
        write(&file, &good[0]);
        write(&covariance, &good[1]);
        edit(&file, from, to);
        check(&file).expect(to, 2, words);
    }
    write(&file, &good[0]);
    edit(&covariance, "lower_triangle = [", "lower_triangle = [[1.0], ");
    check(&file).expect("a row too many", 2, &["calibration.covariance.toml", "lower_triangle"]);
    std::fs::remove_file(&covariance).expect("removed");
    check(&file).expect("alone", 0, &[]);
}

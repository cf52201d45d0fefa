//! Link poses in the files of Universal Robots and Franka: the arm is that of the exported URDF, and errors name bad
//! files.

use std::path::Path;

use armcal::export::{LinkPoseForm, parse_link_poses};
use armcal::streams::JointAngles;

use super::{apart, arm_in, calibration_file, export, folder_with};
use crate::support::texts::Texts;
use crate::support::{Answer, answer, program, read, robot_folder, temp, write};

/// The Titan 4's links, and those of Universal Robots with a prefix.
const UR: [[&str; 2]; 6] = [
    ["trunk_link", "l_shoulder_link"],
    ["upperarm_link", "l_upper_arm_link"],
    ["forearm_link", "l_forearm_link"],
    ["wrist_pitch_link", "l_wrist_1_link"],
    ["wrist_yaw_link", "l_wrist_2_link"],
    ["manipulator_link", "l_wrist_3_link"],
];
/// The Titan 4's joints, and Franka's; two fixed ones are the seventh and the flange's.
const FRANKA: [[&str; 2]; 8] = [
    ["shoulder_yaw", "fr_joint1"],
    ["shoulder_pitch", "fr_joint2"],
    ["forearm_pitch", "fr_joint3"],
    ["wrist_pitch", "fr_joint4"],
    ["wrist_yaw", "fr_joint5"],
    ["wrist_rotate", "fr_joint6"],
    ["fisheye_mount", "fr_joint7"],
    ["jaw_left", "fr_joint8"],
];

/// The text with other names.
fn renamed(path: &Path, names: &[[&str; 2]]) -> String {
    names.iter().fold(read(path), |text, [from, to]| text.replace(&format!("\"{from}\""), &format!("\"{to}\"")))
}

/// Writes robot folder and calibration of a Titan 4 with other names.
fn arm_of(folder: &Path, names: &[[&str; 2]]) {
    write(&folder.join("robot.toml"), &renamed(&robot_folder().join("robot.toml"), names));
    write(&folder.join("titan4.urdf"), &renamed(&robot_folder().join("titan4.urdf"), names));
    write(&folder.join("calibration.toml"), &renamed(&calibration_file(), names));
}

fn new_robot(folder: &Path, out: &str, more: &[&str]) -> Answer {
    let mut command = program();
    command.current_dir(folder).args(["new-robot", "titan4.urdf", "--out", out, "--kinematics", "kinematics.yaml"]);
    answer(command.args(more))
}

#[test]
fn link_poses_of_manufacturers_give_the_arm_of_the_exported_urdf() {
    let angles = JointAngles::from_fn(6, |joint| 0.3 - 0.17 * joint as f64);
    let forms = [
        ("ur", LinkPoseForm::Ur, &UR[..], "l_wrist_3_link"),
        ("franka", LinkPoseForm::Franka, &FRANKA[..], "manipulator_link"),
    ];
    for (name, form, names, tip) in forms {
        let folder = temp();
        let folder = folder.path();
        arm_of(folder, names);
        let [written, urdf] = [name, "urdf"].map(|form| export(&folder.join("calibration.toml"), Some(folder), form));
        written.expect(name, 0, &["roll:"]);
        assert!(written.stderr.contains("mount"), "{}", written.stderr);
        assert_eq!(parse_link_poses(Path::new("k.yaml"), &written.stdout).expect("it reads").form, form);
        write(&folder.join("kinematics.yaml"), &written.stdout);
        new_robot(folder, "made", &["--tip", tip]).expect("new-robot", 0, &["6 joints"]);
        write(&folder.join("titan4.urdf"), &urdf.stdout);
        let [given, made] = [folder.to_owned(), folder.join("made")].map(|folder| arm_in(&folder));
        let last = |robot: &armcal::robot::Robot| *robot.chain.link_poses(&angles).link(6);
        let (off_m, off_rad) = apart(&last(&given), &last(&made));
        assert!(off_m < 1e-12 && off_rad < 1e-12, "{name}: {off_m} m, {off_rad} rad");
        let nominal = last(&crate::support::titan());
        assert!(apart(&nominal, &last(&made)).0 > 1e-4, "{name}: nothing was written in");
    }
}

#[test]
fn bad_link_poses_are_named_with_file_key_and_remedy() {
    let _texts = Texts::of("bad_link_poses_are_named_with_file_key_and_remedy");
    let folder = temp();
    let folder = folder.path();
    arm_of(folder, &UR);
    let good = export(&folder.join("calibration.toml"), Some(folder), "ur").stdout;
    let faults = [
        ("wrist_1:", "wrist1:"),
        ("    yaw: ", "    yam: "),
        ("    x: ", "    x: .nan # "),
        ("    x: ", "    x: 11.0 # "),
        ("    x: ", "    x: 0.9 # "),
        ("    roll: ", "    roll: 1 degree # "),
        ("  shoulder:", "  shoulder: {}\n  shoulder:"),
        ("kinematics:", "cam0:"),
    ];
    for (from, to) in faults {
        assert!(good.contains(from), "{from}");
        write(&folder.join("kinematics.yaml"), &good.replacen(from, to, 1));
        new_robot(folder, "bad", &[]).expect(to, 2, &["kinematics.yaml"]);
    }
    write(&folder.join("kinematics.yaml"), &good);
    folder_with(folder, &read(&robot_folder().join("titan4.urdf")), "titan4", "titan4");
    new_robot(folder, "bad", &[]).expect("another arm", 2, &["titan4.urdf", "shoulder_link"]);
    let other = export(&calibration_file(), Some(&robot_folder()), "franka");
    other.expect("another arm", 2, &["joint1"]);
}

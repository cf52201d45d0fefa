//! Malicious files: the program ends at once with one clear error and little memory.

use std::path::{Path, PathBuf};

use armcal::calib::Calibration;
use armcal::log::{RecordingHeader, RecordingWriter};

use crate::support::texts::Texts;
use crate::support::{
    Answer, ShortRoutine, answer, calibrate, edit, program, robot_copy, root, run, temp, titan, write,
};

/// Text deep enough to overflow the stack of a recursive parser.
fn deep_urdf() -> String {
    format!("<robot name=\"a\">{}{}</robot>", "<a>".repeat(15_000), "</a>".repeat(15_000))
}

fn deep_robot(folder: &Path) -> PathBuf {
    let robot = robot_copy(folder);
    write(&robot.join("titan4.urdf"), &deep_urdf());
    robot
}

fn check(file: &Path) -> Answer {
    answer(program().arg("check").arg(file))
}

#[test]
fn a_deep_urdf_is_refused_by_every_command_that_reads_a_robot() {
    let _texts = Texts::of("a_deep_urdf_is_refused_by_every_command_that_reads_a_robot");
    let folder = temp();
    let robot = deep_robot(folder.path());
    let sample = root().join("recordings/sample/run.mcap");
    let words = ["titan4.urdf", "line 1"];
    check(&robot).expect("check", 2, &words);
    calibrate(&sample, &robot, &folder.path().join("out")).expect("calibrate", 2, &words);
    answer(program().arg("inspect").arg(&sample).arg("--robot").arg(&robot)).expect("inspect", 2, &words);
    let rrd = folder.path().join("a.rrd");
    let mut replay = program();
    replay.arg("replay").arg(&sample).arg("--robot").arg(&robot).arg("--save").arg(&rrd);
    answer(&mut replay).expect("replay", 2, &words);
    let routine = ShortRoutine { robot, ..ShortRoutine::default() }.write(folder.path());
    run(&routine, &folder.path().join("run")).expect("run", 2, &words);
    answer(program().arg("plan").arg(&routine).arg("--out").arg(folder.path())).expect("plan", 2, &words);
}

/// `inspect` does without the attached robot; `replay` needs it.
#[test]
fn a_deep_urdf_attached_to_a_recording_is_refused() {
    let _texts = Texts::of("a_deep_urdf_attached_to_a_recording_is_refused");
    let folder = temp();
    let recording = folder.path().join("run.mcap");
    let header = RecordingHeader::new(titan().joint_names());
    let mut writer = RecordingWriter::create(&recording, header).expect("a file");
    let robot = std::fs::read(root().join("robots/titan4/robot.toml")).expect("the robot reads");
    writer.attach("robot.toml", "application/toml", &robot).expect("attached");
    writer.attach("titan4.urdf", "application/xml", deep_urdf().as_bytes()).expect("attached");
    writer.finish().expect("finished");
    answer(program().arg("inspect").arg(&recording)).expect("inspect", 0, &["whole", "titan4.urdf"]);
    let mut replay = program();
    replay.arg("replay").arg(&recording).arg("--save").arg(folder.path().join("a.rrd"));
    answer(&mut replay).expect("replay", 2, &["titan4.urdf"]);
}

/// All files that a routine names, in one folder; each is replaced in turn by an endless one.
#[test]
fn devices_and_pipes_in_place_of_files_are_refused_at_once() {
    let _texts = Texts::of("devices_and_pipes_in_place_of_files_are_refused_at_once");
    let folder = temp();
    let names = ["robot.toml", "titan4.urdf", "self_collision.toml"];
    for (name, make) in names.into_iter().flat_map(|name| NEVER_ENDING.map(|make| (name, make))) {
        let robot = robot_copy(folder.path());
        let file = robot.join(name);
        make(&file);
        check(&robot).expect(name, 2, &[name]);
        std::fs::remove_dir_all(&robot).expect("removed");
    }
    for make in NEVER_ENDING {
        let file = folder.path().join("any.toml");
        make(&file);
        let words = ["any.toml"];
        check(&file).expect("check", 2, &words);
        run(&file, &folder.path().join("out")).expect("run", 2, &words);
        answer(program().arg("export").arg(&file).args(["--as", "toml"])).expect("export", 2, &words);
        let recording = folder.path().join("any.mcap");
        make(&recording);
        let words = ["any.mcap"];
        answer(program().arg("inspect").arg(&recording)).expect("inspect", 2, &words);
        calibrate(&recording, &root().join("robots/titan4"), folder.path()).expect("calibrate", 2, &words);
        for mesh in ["any.stl", "any.obj"] {
            make(&folder.path().join(mesh));
            let tail = format!(
                "[[obstacle]]\nname = \"a\"\nshape = \"mesh\"\nfile = \"{mesh}\"\nposition_m = [9.0, 9.0, 9.0]\n"
            );
            let routine = ShortRoutine { tail, ..ShortRoutine::default() }.write(folder.path());
            check(&routine).expect(mesh, 2, &[mesh]);
        }
        let tail = "[world.vehicle]\nmotion = \"recorded\"\nmotion_file = \"any.csv\"\n".to_owned();
        make(&folder.path().join("any.csv"));
        let routine = ShortRoutine { tail, ..ShortRoutine::default() }.write(folder.path());
        check(&routine).expect("motion", 2, &["any.csv"]);
    }
}

/// Replacements of a file that have no end or no beginning.
const NEVER_ENDING: [fn(&Path); 2] = [link_to_zeros, pipe_without_writer];

fn link_to_zeros(file: &Path) {
    let _ = std::fs::remove_file(file);
    std::os::unix::fs::symlink("/dev/zero", file).expect("linked");
}

fn pipe_without_writer(file: &Path) {
    let _ = std::fs::remove_file(file);
    assert!(std::process::Command::new("mkfifo").arg(file).status().expect("mkfifo").success());
}

#[test]
fn links_out_of_a_robot_folder_are_refused() {
    let _texts = Texts::of("links_out_of_a_robot_folder_are_refused");
    let folder = temp();
    for name in ["robot.toml", "titan4.urdf"] {
        let robot = robot_copy(folder.path());
        std::fs::rename(robot.join(name), folder.path().join(name)).expect("moved");
        std::os::unix::fs::symlink(folder.path().join(name), robot.join(name)).expect("linked");
        check(&robot).expect(name, 2, &[name]);
        std::fs::remove_dir_all(&robot).expect("removed");
    }
}

#[test]
fn long_files_and_many_entries_are_refused() {
    let _texts = Texts::of("long_files_and_many_entries_are_refused");
    let folder = temp();
    let file = folder.path().join("map.toml");
    let tag = |k: usize| {
        format!(
            "[[tag]]\nid = {k}\nsize_m = 0.1\nposition_m = [0.0, 0.0, 1.0]\nquaternion_wxyz = [1.0, 0.0, 0.0, 0.0]\n"
        )
    };
    let map =
        |n: usize| format!("version = 1\nkind = \"tag_map\"\nframe = \"a\"\n{}", (0..n).map(tag).collect::<String>());
    write(&file, &map(5_000));
    check(&file).expect("5,000 tags", 0, &["5000 landmarks"]);
    write(&file, &map(5_001));
    check(&file).expect("5,001 tags", 2, &["map.toml", "5001 tags", "0 .. 5000"]);
    write(&file, &map(60_000));
    check(&file).expect("60,000 tags", 2, &["map.toml"]);
    write(&file, &map(200_000));
    check(&file).expect("200,000 tags", 2, &["map.toml"]);
}

/// Marks that change the direction of writing do not either; read again, the files have the original name.
#[test]
fn names_steer_no_reader_of_the_files() {
    let folder = temp();
    let robot = robot_copy(folder.path());
    edit(&robot.join("robot.toml"), "name = \"titan4\"", "name = \"titan\\u202e\\u009b4\"");
    let out = folder.path().join("out");
    let done = calibrate(&root().join("recordings/sample/run.mcap"), &robot, &out);
    assert_eq!(done.code, 0, "{done:#?}");
    for name in ["calibration.toml", "summary.json", "report.html"] {
        let text = std::fs::read_to_string(out.join(name)).expect(name);
        assert!(text.contains("titan\\u202e\\u009b4") && !text.contains(['\u{202e}', '\u{9b}']), "{name}");
    }
    let file = out.join("calibration.toml");
    assert_eq!(Calibration::read(&file).expect("it reads").robot, "titan\u{202e}\u{9b}4");
}

#[test]
fn control_characters_never_reach_the_terminal() {
    let folder = temp();
    let robot = robot_copy(folder.path());
    edit(&robot.join("robot.toml"), "name = \"titan4\"", "name = \"titan\\u001b[2J\\u009b4\"");
    let good = check(&robot);
    good.expect("a robot's name", 0, &["titan\\u001b[2J\\u009b4"]);
    let broken = folder.path().join("broken.toml");
    write(&broken, "version = 1\nname = \u{1b}]0;owned\u{7}\n");
    let spoilt = check(&broken);
    spoilt.expect("broken TOML", 2, &["\\u001b]0;owned\\u0007"]);
    let failed = run(&broken, &folder.path().join("out"));
    failed.expect("broken TOML", 2, &["\\u001b]0;owned\\u0007"]);
    let map = folder.path().join("map.toml");
    write(
        &map,
        "version = 1\nkind = \"tag_map\"\n\
         frame = \"a\\u001b[31m\"\n[[tag]]\nid = 1\nsize_m = 0.1\nposition_m = [0.0, 0.0, 1.0]\n",
    );
    let frame = check(&map);
    frame.expect("a frame", 0, &["a\\u001b[31m"]);
    for told in [good, spoilt, failed, frame] {
        let steers = |c: char| c.is_control() && c != '\n' && c != '\t';
        assert!(!told.stdout.contains(steers) && !told.stderr.contains(steers), "{told:#?}");
    }
}

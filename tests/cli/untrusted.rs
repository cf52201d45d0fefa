//! Files made to harm: the program ends at once with one clear error and within little memory.

use std::path::{Path, PathBuf};

use armcal::log::{RecordingHeader, RecordingWriter};

use crate::support::{
    Answer, ShortRoutine, answer, calibrate, program, robot_copy, root, run, temp, titan, write,
};

/// Deep enough to overflow the stack of a parser that recurs.
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
    let folder = temp();
    let robot = deep_robot(folder.path());
    let sample = root().join("recordings/sample/run.mcap");
    let words = ["titan4.urdf", "line 1", "nested more than 64 deep"];
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
    answer(&mut replay).expect("replay", 2, &["titan4.urdf", "nested more than 64 deep"]);
}

//! The program as a user calls it: exit codes, messages, and no panic for any input.

mod campaigns;
mod help;
mod inputs;
mod inspect;
mod live_view;
mod long;
mod manners;
mod output;
mod recordings;
mod situations;
mod small;
mod untrusted;

use crate::support::texts::Texts;
use crate::support::{answer, calibrate, program, robot_folder, run, shared_run, temp, write};

#[test]
fn a_run_leaves_the_files_that_scripts_rely_on() {
    let run = shared_run();
    for name in ["run.mcap", "truth.mcap", "run.rrd", "calibration.toml", "summary.json", "report.html"] {
        assert!(!run.bytes(name).is_empty(), "{name}");
    }
    let left = std::fs::read_dir(&run.out).expect("the folder").flatten();
    let left: Vec<String> = left.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    assert!(left.iter().all(|name| !name.ends_with(".partial") && !name.starts_with('.')), "{left:?}");
    let html = String::from_utf8(run.bytes("report.html")).expect("text");
    assert!(!html.contains("http://") && !html.contains("https://"), "the report needs no network");
}

#[test]
fn usage_errors_exit_with_2() {
    let _texts = Texts::of("usage_errors_exit_with_2");
    let folder = temp();
    answer(&mut program()).expect("no command", 2, &["Usage"]);
    answer(program().arg("dance")).expect("no such command", 2, &["dance"]);
    answer(program().args(["run"])).expect("no routine", 2, &["ROUTINE"]);
    answer(program().args(["run", "x.toml", "--seed=-3"])).expect("negative seed", 2, &["seed"]);
    answer(program().args(["calibrate", "x.mcap"])).expect("no robot", 2, &["--robot"]);
    answer(program().arg("--version")).expect("version", 0, &[env!("CARGO_PKG_VERSION")]);
    let mut unknown = program();
    unknown.arg("calibrate").arg(shared_run().file("run.mcap")).arg("--robot").arg(robot_folder());
    unknown.args(["--method", "guess"]).arg("--out").arg(folder.path());
    answer(&mut unknown).expect("unknown method", 2, &["guess", "minimum_distance"]);
}

#[test]
fn shells_and_man_know_every_command() {
    let folder = temp();
    let shell = answer(program().args(["completions", "bash"]));
    shell.expect("completions", 0, &["calibrate", "regress", "--tag-map"]);
    answer(program().arg("man").arg(folder.path().join("man"))).expect("man", 0, &["written"]);
    for command in armcal::cli::command().get_subcommands().filter(|command| !command.is_hide_set()) {
        let page = folder.path().join(format!("man/armcal-{}.1", command.get_name()));
        assert!(crate::support::read(&page).contains(".TH"), "{}", page.display());
    }
    answer(program().args(["completions", "abacus"])).expect("no such shell", 2, &["abacus", "zsh"]);
}

/// Not even root can make a folder below a file.
#[test]
fn an_output_folder_that_cannot_be_made_is_named() {
    let _texts = Texts::of("an_output_folder_that_cannot_be_made_is_named");
    let folder = temp();
    let file = folder.path().join("file");
    write(&file, "in the way");
    let out = file.join("out");
    let words = [out.to_str().expect("UTF-8"), "[file_unwritable]"];
    calibrate(&shared_run().file("run.mcap"), &robot_folder(), &out).expect("calibrate", 1, &words);
    run(&shared_run().routine, &out).expect("run", 1, &words);
}

#[test]
fn an_output_that_cannot_be_replaced_is_named() {
    let _texts = Texts::of("an_output_that_cannot_be_replaced_is_named");
    let folder = temp();
    std::fs::create_dir_all(folder.path().join("calibration.toml/full")).expect("a folder in the way");
    let answer = calibrate(&shared_run().file("run.mcap"), &robot_folder(), folder.path());
    answer.expect("calibrate", 1, &["calibration.toml"]);
}

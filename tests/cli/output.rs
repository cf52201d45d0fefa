//! Output streams: if stdout or stderr fail, the work is still done and its files are kept.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::support::{ShortRoutine, program, robot_copy, robot_folder, root, shared_run, temp};

/// A command line, its exit code where all output succeeds, and the file that it writes.
struct Case {
    command: Command,
    code: i32,
    leaves: Option<PathBuf>,
}

impl Case {
    fn new(words: &[&str]) -> Self {
        let mut command = program();
        command.args(words).current_dir(root());
        Self { command, code: 0, leaves: None }
    }

    fn with(mut self, argument: impl AsRef<Path>) -> Self {
        self.command.arg(argument.as_ref());
        self
    }

    /// Adds the file that the command leaves: `file` within the folder `path`, or `path` itself if `file` is empty.
    fn leaves(mut self, option: &str, path: PathBuf, file: &str) -> Self {
        self.command.arg(option).arg(&path);
        self.leaves = Some(if file.is_empty() { path } else { path.join(file) });
        self
    }
}

/// Every subcommand, each with a folder below `folder` to write to.
fn every_subcommand(folder: &Path) -> Vec<Case> {
    let mut short = ShortRoutine { poses: 10, held_out: 3, ..ShortRoutine::default() };
    short.targets_m.truncate(1);
    let routine = short.write(folder);
    let (shared, robot) = (shared_run(), robot_folder());
    let (recording, baseline) = (root().join("fuzz/corpus/recording/views.mcap"), folder.join("new.csv"));
    let out = |name: &str| folder.join(name);
    vec![
        Case::new(&["--help"]),
        Case::new(&["--version"]),
        Case { code: 2, ..Case::new(&["check"]).with(&routine).with("nothing.toml").with(&robot) },
        Case::new(&["inspect"]).with(&recording),
        Case::new(&["export", "--as", "yaml"]).with(shared.file("calibration.toml")),
        Case::new(&["run"]).with(&routine).leaves("--out", out("run"), "summary.json"),
        Case::new(&["campaign", "--seeds", "1"]).with(&routine).leaves("--out", out("campaign.csv"), ""),
        Case::new(&["regress", "--seeds", "1"]).with(&routine).leaves("--write-baseline", baseline.clone(), ""),
        Case::new(&["regress", "--baseline"]).with(&baseline).with(&routine).leaves("--out", out("now.csv"), ""),
        Case::new(&["plan"]).with(&routine).leaves("--out", out("plan"), "plan.toml"),
        Case::new(&["calibrate", "--robot"]).with(&robot).with(&recording).leaves("--out", out("c"), "summary.json"),
        Case::new(&["watch", "--robot"]).with(&robot).with(&recording).leaves("--out", out("w"), "belief.jsonl"),
        Case::new(&["tagmap", "--robot"]).with(&robot).with(&recording).leaves("--out", out("map.toml"), ""),
        Case::new(&["replay", "--robot"]).with(&robot).with(&recording).leaves("--save", out("replay.rrd"), ""),
        Case::new(&["new-robot", "--self-collision"]).with(robot_copy(folder)),
    ]
}

/// A pipe without a reader.
fn closed_pipe() -> Stdio {
    let (_, writer) = std::io::pipe().expect("a pipe");
    writer.into()
}

/// Ends the command, checks its file and removes it; returns exit code and stderr.
fn ended(case: &mut Case) -> (i32, String) {
    let output = case.command.spawn().expect("the program starts").wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let name = format!("{:?}", case.command);
    assert!(!said.contains("panicked"), "{name}: {said}");
    let code = output.status.code().unwrap_or_else(|| panic!("{name}: killed: {said}"));
    if let Some(file) = &case.leaves {
        assert!(fs::metadata(file).is_ok_and(|file| file.len() > 0), "{name}: no {}: {said}", file.display());
    }
    (code, said)
}

fn expect_work_without_readers(is_wanted: fn(&Case) -> bool) {
    let folder = temp();
    for mut case in every_subcommand(folder.path()).into_iter().filter(is_wanted) {
        case.command.stdout(closed_pipe()).stderr(closed_pipe());
        let (code, _) = ended(&mut case);
        assert_eq!(code, case.code, "{:?}", case.command);
    }
}

/// True for commands that simulate or plan; with a full stdout they are in the first tier.
fn is_long(case: &Case) -> bool {
    let first = case.command.get_args().next().and_then(|word| word.to_str()).expect("a subcommand");
    ["run", "campaign", "regress", "plan", "new-robot"].contains(&first)
}

#[test]
fn nobody_reads_and_subcommands_do_their_work() {
    expect_work_without_readers(|case| !is_long(case));
}

#[test]
#[ignore = "second tier: each subcommand that simulates or plans, 6 s"]
fn nobody_reads_and_long_subcommands_do_their_work() {
    expect_work_without_readers(is_long);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_stdout_is_one_error_after_the_work() {
    let folder = temp();
    for mut case in every_subcommand(folder.path()) {
        let full = File::options().write(true).open("/dev/full").expect("a device that is full");
        case.command.stdout(full).stderr(Stdio::piped());
        let (code, said) = ended(&mut case);
        let name = format!("{:?}", case.command);
        assert_eq!(code, 1, "{name}: {said}");
        let errors: Vec<&str> = said.lines().filter(|line| line.starts_with("error:")).collect();
        assert!(matches!(errors[..], [only] if only.contains("stdout")), "{name}: {said}");
    }
}

/// With a closed stderr, errors are still in the exit code.
#[test]
fn a_closed_stderr_hides_words_and_no_exit_code() {
    for (words, code) in [(&["dance"][..], 2), (&[], 2), (&["inspect", "nothing.mcap"], 2), (&["check", "x.toml"], 2)] {
        let mut case = Case::new(words);
        case.command.stdout(Stdio::piped()).stderr(closed_pipe());
        assert_eq!(ended(&mut case).0, code, "{words:?}");
    }
}

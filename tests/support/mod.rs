//! Common parts of several modules: a short routine, the program's answers, one run that all share, and edited copies
//! of files.

pub mod bag;
pub mod external;
pub mod scene;
pub mod synthetic;
pub mod texts;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

use armcal::Unwatched;
use armcal::output::OutputFolder;
use armcal::report::RunSummary;
use armcal::robot::{Robot, load};
use armcal::routine::{Override, Overrides};
use armcal::run::{Failure, Finished, Keep, RunInputs, RunOutput, execute};
use armcal::streams::{Arm, Message, Sink, SinkError};
use armcal::time::Stamp;
use tempfile::TempDir;

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

pub fn robot_folder() -> PathBuf {
    root().join("robots/titan4")
}

pub fn vehicle_file() -> PathBuf {
    root().join("robots/vehicles/work-class-front.toml")
}

pub fn titan() -> Robot {
    load(&robot_folder()).expect("the robot reads")
}

pub fn temp() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

pub fn write(path: &Path, text: &str) {
    fs::write(path, text).expect("written");
}

pub fn read(path: &Path) -> String {
    fs::read_to_string(path).expect("read")
}

/// All files below `folder` with this extension, sorted.
pub fn files_below(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(files_below(&path, extension));
        } else if path.extension().is_some_and(|of| of == extension) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// A routine of about three simulated minutes: few poses, few targets, otherwise the standard world.
#[derive(Clone, Debug)]
pub struct ShortRoutine {
    pub robot: PathBuf,
    pub vehicle: PathBuf,
    pub seed: u64,
    pub poses: u32,
    pub held_out: u32,
    pub min_tags: u32,
    pub targets_m: Vec<[f64; 3]>,
    /// Text appended unchanged: obstacles, `[world]`.
    pub tail: String,
}

impl Default for ShortRoutine {
    fn default() -> Self {
        Self {
            robot: robot_folder(),
            vehicle: vehicle_file(),
            seed: 1,
            poses: 12,
            held_out: 4,
            min_tags: 3,
            targets_m: vec![
                [0.500, 1.620, 0.323],
                [0.274, -1.276, 1.115],
                [1.242, -0.887, 0.457],
                [1.606, -0.135, 0.485],
                [0.595, -0.966, -0.015],
            ],
            tail: String::new(),
        }
    }
}

impl ShortRoutine {
    pub fn text(&self) -> String {
        let mut text = format!(
            "version = 1\nkind = \"routine\"\nname = \"short\"\nrobot = {:?}\nvehicle = {:?}\nseed = {}\n\
             [capture]\nposes = {}\nheld_out = {}\nmin_tags = {}\ndwell_s = 0.6\n[task]\ntolerance_m = 0.03\n",
            self.robot, self.vehicle, self.seed, self.poses, self.held_out, self.min_tags
        );
        writeln!(text, "targets_m = {:?}", self.targets_m).expect("text");
        text + &self.tail
    }

    /// Writes it as `short.toml`.
    pub fn write(&self, folder: &Path) -> PathBuf {
        let file = folder.join("short.toml");
        write(&file, &self.text());
        file
    }
}

/// Output and exit code of the program.
#[derive(Debug)]
pub struct Answer {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Answer {
    /// Checks the exit code and that stdout or stderr holds each of `words`.
    #[track_caller]
    pub fn expect(&self, what: &str, code: i32, words: &[&str]) {
        assert_eq!(self.code, code, "{what}: {self:#?}");
        for word in words {
            assert!(self.stdout.contains(word) || self.stderr.contains(word), "{what}: no `{word}` in {self:#?}");
        }
    }
}

pub fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_armcal"))
}

/// Runs the program to its end. It may fail, but not by a panic or a signal.
#[track_caller]
pub fn answer(command: &mut Command) -> Answer {
    let output = command.output().expect("the program starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    assert!(!stderr.contains("panicked"), "{command:?}: {stderr}");
    let code = output.status.code().unwrap_or_else(|| panic!("{command:?}: killed: {}: {stderr}", output.status));
    let answer = Answer { code, stdout, stderr };
    texts::note_answer(command, &answer);
    answer
}

pub fn run(routine: &Path, out: &Path) -> Answer {
    answer(program().arg("run").arg(routine).arg("--details").arg("--out").arg(out))
}

pub fn calibrate(recording: &Path, robot: &Path, out: &Path) -> Answer {
    answer(program().arg("calibrate").arg(recording).arg("--details").arg("--robot").arg(robot).arg("--out").arg(out))
}

/// A finished run of the closed loop.
pub struct FinishedRun {
    pub routine: PathBuf,
    pub out: PathBuf,
}

impl FinishedRun {
    pub fn file(&self, name: &str) -> PathBuf {
        self.out.join(name)
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.file(name)).expect("a file of the run")
    }

    pub fn summary(&self) -> RunSummary {
        serde_json::from_slice(&self.bytes("summary.json")).expect("summary.json reads")
    }
}

/// Runs `routine` in `folder`; `run` has the output files.
#[track_caller]
pub fn finished(routine: &ShortRoutine, folder: &Path) -> FinishedRun {
    fs::create_dir_all(folder).expect("a folder");
    let run = FinishedRun { routine: routine.write(folder), out: folder.join("run") };
    self::run(&run.routine, &run.out).expect("the short routine", 0, &["ACCEPTED"]);
    run
}

/// The finished run of a routine, made once for all tests of this process and read-only.
#[track_caller]
pub fn shared(routine: &ShortRoutine) -> &'static FinishedRun {
    static RUNS: Mutex<BTreeMap<String, &'static OnceLock<FinishedRun>>> = Mutex::new(BTreeMap::new());
    let run = *RUNS.lock().expect("no panic").entry(routine.text()).or_insert_with(|| Box::leak(Box::default()));
    run.get_or_init(|| finished(routine, &lasting_folder()))
}

/// Recording and results of a run. It is made in this process, without the files for people: no replay, no report.
pub struct Simulated {
    pub done: Result<Finished, Failure>,
    out: PathBuf,
}

impl Simulated {
    /// Runs `routine` in `out`; `settings` are keys of the routine and their values.
    pub fn new(routine: &Path, seed: Option<u64>, settings: &[(&str, toml::Value)], out: &Path) -> Self {
        let set = settings.iter().map(|(key, value)| Override::new(key, value.clone()).expect("a key")).collect();
        let inputs = RunInputs::load(routine, &Overrides { set, ..Overrides::default() }).expect("it reads");
        let (folder, _) = OutputFolder::open(out).expect("a folder");
        let output = RunOutput { folder: &folder, keep: Keep::StreamsAlone, listener: None };
        let done = execute(&inputs, seed.unwrap_or(inputs.routine.seed), output, &mut Unwatched);
        Self { done, out: out.to_owned() }
    }

    pub fn of(routine: &ShortRoutine, folder: &Path) -> Self {
        fs::create_dir_all(folder).expect("a folder");
        Self::new(&routine.write(folder), None, &[], &folder.join("run"))
    }

    /// Path of a recorded stream: `run` or `truth`.
    pub fn file(&self, name: &str) -> PathBuf {
        let ending = if self.done.is_ok() { ".mcap.partial" } else { "-cut-1.mcap" };
        self.out.join(format!("{name}{ending}"))
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.file(name)).expect("a stream of the run")
    }

    #[track_caller]
    pub fn finished(&self) -> &Finished {
        self.done.as_ref().expect("the run ends well")
    }
}

/// A seed whose digits occur only in the truth of [`shared_run`].
pub const SHARED_SEED: u64 = 7_215_503_169_846_213_077;
pub const SHARED_PUMP_FLOW_L_MIN: f64 = 12.345_678_901;

/// The run of the closed loop that most tests use.
pub fn shared_run() -> &'static FinishedRun {
    let tail = format!("[world.hydraulics]\npump_flow_l_min = {SHARED_PUMP_FLOW_L_MIN}\n");
    shared(&ShortRoutine { seed: SHARED_SEED, tail, ..ShortRoutine::default() })
}

/// A folder that outlives the tests, because no code is called when they end; those older than an hour are removed.
pub fn lasting_folder() -> PathBuf {
    let parent = Path::new(env!("CARGO_TARGET_TMPDIR")).join("shared-runs");
    fs::create_dir_all(&parent).expect("a folder in the target directory");
    for entry in fs::read_dir(&parent).into_iter().flatten().flatten() {
        let age = entry.metadata().and_then(|m| m.modified()).ok().and_then(|at| at.elapsed().ok());
        if age.is_some_and(|age| age > Duration::from_secs(3600)) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
    tempfile::tempdir_in(&parent).expect("a folder in the target directory").keep()
}

/// A copy of robots/titan4 to be edited.
pub fn robot_copy(folder: &Path) -> PathBuf {
    let copy = folder.join("robot");
    fs::create_dir_all(&copy).expect("a folder");
    for name in ["robot.toml", "titan4.urdf"] {
        fs::copy(robot_folder().join(name), copy.join(name)).expect("copied");
    }
    copy
}

/// Replaces the first `from` in a file by `to`.
#[track_caller]
pub fn edit(file: &Path, from: &str, to: &str) {
    let text = read(file);
    assert!(text.contains(from), "{}: no `{from}`", file.display());
    write(file, &text.replacen(from, to, 1));
}

/// A listener that keeps no message.
pub struct Nowhere;

impl Sink for Nowhere {
    fn record(&mut self, _: Stamp, _: &Message) -> Result<(), SinkError> {
        Ok(())
    }
}

impl Nowhere {
    /// Lets `seconds` pass.
    pub fn watch(arm: &mut dyn Arm, seconds: f64) {
        for _ in 0..(seconds / arm.period_s()).round() as u32 {
            arm.step(&mut Self).expect("the arm steps");
        }
    }
}

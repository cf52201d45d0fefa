//! `armcal watch` on recordings that are finished, that grow, and that become invalid meanwhile.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::support::texts::Texts;
use crate::support::{Answer, ShortRoutine, answer, program, read, robot_folder, root, temp};

/// Time limit for any wait.
const LONGEST: Duration = Duration::from_secs(60);

fn sample() -> PathBuf {
    root().join("recordings/sample/run.mcap")
}

/// Contents of belief.jsonl for a recording that is read whole, in the order of time.
fn of_whole(recording: &Path) -> String {
    let out = temp();
    let mut command = program();
    command.arg("watch").arg(recording).arg("--robot").arg(robot_folder());
    answer(command.arg("--out").arg(out.path()));
    read(&out.path().join("belief.jsonl"))
}

fn of_sample() -> &'static str {
    static BELIEF: OnceLock<String> = OnceLock::new();
    BELIEF.get_or_init(|| of_whole(&sample()))
}

fn watch(recording: &Path, words: &[&str]) -> Command {
    let mut command = program();
    command.arg("watch").arg(recording).arg("--robot").arg(robot_folder()).args(words);
    command
}

/// A running `watch` that prints JSON lines.
struct Watching {
    child: Child,
    stdout: PathBuf,
}

impl Watching {
    fn start(recording: &Path, out: &Path, words: &[&str]) -> Self {
        fs::create_dir_all(out).expect("a folder");
        let [stdout, stderr] = ["stdout", "stderr"].map(|name| out.join(name));
        let mut command = watch(recording, words);
        command.arg("--json").arg("--out").arg(out);
        command.stdout(File::create(&stdout).expect("a file")).stderr(File::create(stderr).expect("a file"));
        Self { child: command.spawn().expect("it starts"), stdout }
    }

    /// Waits until `n` lines are printed.
    fn await_lines(&mut self, n: usize) {
        let began = Instant::now();
        while read(&self.stdout).lines().count() < n {
            assert!(self.child.try_wait().expect("a state").is_none(), "it ended: {}", self.stderr());
            assert!(began.elapsed() < LONGEST, "fewer than {n} lines");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn stderr(&self) -> String {
        read(&self.stdout.with_file_name("stderr"))
    }

    #[cfg(unix)]
    fn signal(&self, name: &str) {
        let status = Command::new("kill").arg(format!("-{name}")).arg(self.child.id().to_string()).status();
        assert!(status.expect("kill").success());
    }

    fn end(mut self) -> Answer {
        let began = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("a state") {
                break status;
            }
            if began.elapsed() > LONGEST {
                self.child.kill().expect("killed");
                panic!("it does not end: {}", self.stderr());
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        let stderr = self.stderr();
        assert!(!stderr.contains("panicked"), "{stderr}");
        Answer { code: status.code().unwrap_or(-1), stdout: read(&self.stdout), stderr }
    }
}

/// Adds bytes to a file, in pieces of irregular size and with pauses.
fn grow(file: &Path, bytes: &[u8]) {
    let mut file = OpenOptions::new().create(true).append(true).open(file).expect("opened");
    for piece in bytes.chunks(76_543) {
        file.write_all(piece).expect("written");
        std::thread::sleep(Duration::from_millis(40));
    }
}

#[test]
fn a_finished_recording_gives_the_bytes_of_calibrate_online() {
    let out = temp();
    let said = answer(watch(&sample(), &[]).arg("--out").arg(out.path()));
    said.expect("text", 0, &["0:01:00  ", "belief.jsonl"]);
    assert_eq!(read(&out.path().join("belief.jsonl")), of_sample());
    let said = answer(&mut watch(&sample(), &["--json"]));
    said.expect("lines", 0, &[]);
    assert_eq!(said.stdout, of_sample());
    assert_eq!(said.stderr, "");
}

/// Expects a `watch` of a recording that now equals the sample to end well, with the sample's lines on stdout and in
/// the file.
#[track_caller]
fn ends_as_the_sample(watching: Watching, folder: &Path, says: &[&str]) {
    let said = watching.end();
    said.expect("a recording that ends", 0, says);
    assert_eq!(said.stdout, of_sample());
    assert_eq!(read(&folder.join("out/belief.jsonl")), of_sample());
}

/// The recording is awaited, followed piece by piece, and renamed as by a run: each line equals that of the finished
/// file.
#[test]
fn a_recording_that_grows_gives_the_same_lines() {
    let folder = temp();
    let [partial, whole] = ["run.mcap.partial", "run.mcap"].map(|name| folder.path().join(name));
    let mut watching = Watching::start(&partial, &folder.path().join("out"), &[]);
    let bytes = fs::read(sample()).expect("the sample");
    std::thread::sleep(Duration::from_millis(300));
    grow(&partial, &bytes[..bytes.len() - 5]);
    watching.await_lines(2);
    fs::rename(&partial, &whole).expect("renamed");
    grow(&whole, &bytes[bytes.len() - 5..]);
    ends_as_the_sample(watching, folder.path(), &[]);
}

#[test]
fn after_a_kill_the_next_watch_comes_to_the_same() {
    let folder = temp();
    let file = folder.path().join("run.mcap");
    let bytes = fs::read(sample()).expect("the sample");
    let mut n_written = 0;
    for end in [bytes.len() / 2, bytes.len() / 4 * 3] {
        grow(&file, &bytes[n_written..end]);
        n_written = end;
        let mut watching = Watching::start(&file, &folder.path().join("out"), &[]);
        watching.await_lines(1);
        watching.child.kill().expect("killed");
        let left = watching.end();
        assert!(of_sample().starts_with(&left.stdout), "{left:?}");
        assert!(!folder.path().join("out/belief.jsonl").exists(), "nothing half");
    }
    let watching = Watching::start(&file, &folder.path().join("out"), &[]);
    grow(&file, &bytes[n_written..]);
    ends_as_the_sample(watching, folder.path(), &[]);
}

/// The recording of a killed recorder is read to its end, including the beginning of its last chunk.
#[test]
fn a_recording_without_an_end_is_lost_data() {
    let folder = temp();
    let file = folder.path().join("run.mcap");
    let bytes = fs::read(sample()).expect("the sample");
    for length in [bytes.len() * 3 / 4, bytes.len() - 3] {
        fs::write(&file, &bytes[..length]).expect("written");
        let said = answer(&mut watch(&file, &["--json", "--idle-s", "1"]));
        said.expect("cut", 3, &["run.mcap"]);
        assert_eq!(said.stdout, of_whole(&file));
    }
}

#[test]
fn a_recording_that_is_taken_away_is_told_of() {
    let bytes = fs::read(sample()).expect("the sample");
    let half = &bytes[..bytes.len() / 2];
    for is_cut in [true, false] {
        let folder = temp();
        let file = folder.path().join("run.mcap");
        fs::write(&file, half).expect("written");
        let mut watching = Watching::start(&file, &folder.path().join("out"), &[]);
        watching.await_lines(1);
        if is_cut {
            OpenOptions::new().write(true).open(&file).and_then(|file| file.set_len(1000)).expect("cut");
        } else {
            let other = file.with_extension("other");
            fs::copy(sample(), &other).expect("copied");
            fs::rename(other, &file).expect("replaced");
        }
        let said = watching.end();
        said.expect("taken away", 2, &["run.mcap: "]);
        // The estimates until then are kept.
        assert_eq!(read(&folder.path().join("out/belief.jsonl")), said.stdout);
    }
}

#[cfg(unix)]
#[test]
fn a_signal_ends_it_with_its_last_line() {
    let folder = temp();
    let file = folder.path().join("run.mcap");
    let bytes = fs::read(sample()).expect("the sample");
    fs::write(&file, &bytes[..bytes.len() / 2]).expect("written");
    for name in ["TERM", "INT"] {
        let mut watching = Watching::start(&file, &folder.path().join(name), &["--idle-s", "0"]);
        watching.await_lines(1);
        watching.signal(name);
        let said = watching.end();
        // The recording is continued: it is not cut.
        said.expect(name, 0, &[]);
        assert_eq!(said.stderr, "");
        assert_eq!(read(&folder.path().join(name).join("belief.jsonl")), said.stdout);
        let last = said.stdout.lines().last().expect("a line");
        assert!(last.contains("tool_error_in_an_hour_m"), "{last}");
        assert!(said.stdout.lines().count() > 1);
    }
    let absent = folder.path().join("absent.mcap");
    let watching = Watching::start(&absent, &folder.path().join("absent"), &["--idle-s", "0"]);
    std::thread::sleep(Duration::from_millis(500));
    watching.signal("INT");
    watching.end().expect("nothing to follow", 2, &["absent.mcap"]);
}

#[test]
fn with_a_dead_sensor_it_ends_with_code_4() {
    let _texts = Texts::of("with_a_dead_sensor_it_ends_with_code_4");
    let said = answer(&mut watch(&sample(), &["--failed", "forearm_pitch=dead"]));
    said.expect("a dead forearm", 4, &[]);
}

#[test]
fn what_cannot_be_watched_is_refused() {
    let _texts = Texts::of("what_cannot_be_watched_is_refused");
    let folder = temp();
    let [absent, empty] = ["absent.mcap", "empty.mcap"].map(|name| folder.path().join(name));
    fs::write(&empty, "").expect("written");
    let soon = ["--idle-s", "1"];
    answer(&mut watch(&absent, &soon)).expect("absent", 2, &["absent.mcap", "waiting"]);
    answer(&mut watch(&empty, &soon)).expect("empty", 2, &[]);
    answer(&mut watch(&root().join("README.md"), &soon)).expect("a text", 2, &[]);
    answer(&mut watch(folder.path(), &soon)).expect("a folder", 2, &[]);
    answer(&mut watch(&sample(), &["--failed", "forearm=dead"])).expect("no joint", 2, &["--failed forearm=dead"]);
    let twice = sample();
    answer(watch(&sample(), &["--live"]).arg(&twice)).expect("two, live", 2, &["--live", "[usage_invalid]"]);
    let mut other = program();
    other.arg("watch").arg(sample()).arg("--robot").arg(root().join("robots/kraft-predator"));
    answer(&mut other).expect("another arm", 2, &["run.mcap", "shoulder"]);
}

/// The closed loop and a `watch` of it, at the same time.
#[test]
fn a_run_is_watched_while_it_lasts() {
    let folder = temp();
    let routine = ShortRoutine::default().write(folder.path());
    let out = folder.path().join("run");
    let watching = Watching::start(&out.join("run.mcap.partial"), &folder.path().join("watched"), &[]);
    let mut run = program();
    run.arg("run").arg(routine).arg("--out").arg(&out).stdout(Stdio::null()).stderr(Stdio::null());
    assert!(run.status().expect("it ends").success());
    let said = watching.end();
    said.expect("a run", 0, &[]);
    assert!(said.stdout.lines().count() > 2, "{said:?}");
    assert_eq!(said.stdout, of_whole(&out.join("run.mcap")));
}

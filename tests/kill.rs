//! Runs that end badly: killed, interrupted, out of disk, two at once. No recording is lost, and no file in the folder
//! is mistaken for a finished result.
//!
//! `ARMCAL_KILLS=50` makes the kill study longer than the three kills of every test run.

mod commands;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use armcal::log::read_recording;
use armcal::report::inspection::{State, inspect as look};
use armcal::stats::stream_rng;
use armcal::streams::{MarkKind, Message};
use rand::RngExt;

use crate::support::{
    Answer, FinishedRun, ShortRoutine, answer, calibrate, finished, program, robot_folder, run, temp,
};

const RESULTS: [&str; 7] = [
    "run.mcap",
    "truth.mcap",
    "run.rrd",
    "calibration.toml",
    "calibration.covariance.toml",
    "report.html",
    "summary.json",
];

/// A run that takes as little time as possible.
fn quick() -> ShortRoutine {
    let mut routine = ShortRoutine { poses: 10, held_out: 3, ..ShortRoutine::default() };
    routine.targets_m.truncate(1);
    routine
}

/// One such run to its end, and its duration.
fn reference() -> &'static (FinishedRun, Duration) {
    static RUN: OnceLock<(FinishedRun, Duration)> = OnceLock::new();
    RUN.get_or_init(|| {
        let folder = crate::support::lasting_folder();
        let began = Instant::now();
        let run = finished(&quick(), &folder);
        (run, began.elapsed())
    })
}

fn start(routine: &Path, out: &Path) -> Child {
    let mut command = program();
    command.arg("run").arg(routine).arg("--out").arg(out);
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts")
}

fn end(child: Child) -> (Option<i32>, String) {
    let output = child.wait_with_output().expect("it ends");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[cfg(unix)]
fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").arg(format!("-{name}")).arg(child.id().to_string()).status();
    assert!(status.expect("kill").success());
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

fn inspect(recording: &Path) -> Answer {
    answer(program().arg("inspect").arg(recording))
}

/// Waits until the arm has moved for a while: the recording is longer than the part written before any motion.
fn wait_until_it_moves(child: &mut Child, partial: &Path) {
    let began = Instant::now();
    while fs::metadata(partial).map_or(0, |file| file.len()) < 100_000 {
        assert!(child.try_wait().expect("a state").is_none(), "the run ended before it moved");
        assert!(began.elapsed() < Duration::from_secs(300), "the arm never moved");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[derive(Debug, Default, PartialEq)]
struct Tally {
    kills: u32,
    /// Kills before the recording was made.
    no_file: u32,
    /// Kills after which the recording was empty.
    empty: u32,
    /// Kills after which the recording was cut, and readable to the last completed chunk.
    readable: u32,
    /// Kills that came after the run had ended.
    ended: u32,
    /// Readable recordings that give a calibration.
    calibrated: u32,
}

/// Checks the files that a kill left in `out`, where an earlier run had its results.
fn look_at_leftover(out: &Path, earlier: &[(&str, Vec<u8>)], whole: &[u8], tally: &mut Tally) {
    let partial = out.join("run.mcap.partial");
    let is_old = |(name, bytes): &(&str, Vec<u8>)| fs::read(out.join(name)).is_ok_and(|found| found == *bytes);
    let has_summary = out.join("summary.json").exists();
    if !partial.exists() && fs::read(out.join("run.mcap")).is_ok_and(|found| found == whole) {
        tally.ended += 1;
        assert_eq!(inspect(&out.join("run.mcap")).code, 0);
        return;
    }
    // Results of the earlier run are untouched, or the summary that vouches for them is gone.
    assert!(!has_summary || earlier.iter().all(is_old), "{:?}", names(out));
    let Ok(left) = fs::read(&partial) else {
        tally.no_file += 1;
        return;
    };
    assert!(whole.starts_with(&left), "what is left is the beginning of the whole recording");
    if left.is_empty() {
        tally.empty += 1;
        return;
    }
    // A run that was killed while writing its results has a finished recording.
    let (code, state) = if left == whole { (0, "state        whole") } else { (3, "state        cut") };
    inspect(&partial).expect("a leftover", code, &[state]);
    tally.readable += 1;
    let found = look(&partial, Some(&crate::support::titan())).expect("it reads");
    if found.observable.expect("a robot").missing.is_empty() {
        calibrate(&partial, &robot_folder(), &out.join("calibrated")).expect(
            "a leftover with views",
            code,
            &["ACCEPTED"],
        );
        tally.calibrated += 1;
    }
}

/// Sends kill -9 at random moments of a run.
#[test]
fn a_killed_run_leaves_a_readable_recording() {
    let kills: u32 = std::env::var("ARMCAL_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(3);
    let (reference, took) = reference();
    let whole = reference.bytes("run.mcap");
    let earlier: Vec<(&str, Vec<u8>)> =
        RESULTS.iter().map(|name| (*name, format!("earlier {name}").into_bytes())).collect();
    let mut rng = stream_rng(1, "kills");
    let mut tally = Tally::default();
    for kill in 0..kills {
        let folder = temp();
        let out = folder.path().join("out");
        fs::create_dir_all(&out).expect("a folder");
        for (name, bytes) in &earlier {
            fs::write(out.join(name), bytes).expect("written");
        }
        let mut child = start(&reference.routine, &out);
        // The first kill comes early in the run, the others at any time.
        let share = if kill == 0 { 0.02 } else { rng.random_range(0.0..1.0) };
        std::thread::sleep(took.mul_f64(share));
        child.kill().expect("killed");
        child.wait().expect("gone");
        tally.kills += 1;
        look_at_leftover(&out, &earlier, &whole, &mut tally);
    }
    eprintln!("{tally:?}");
    assert_eq!(tally.no_file + tally.empty + tally.readable + tally.ended, kills, "{tally:?}");
}

/// The next run into the folder keeps what the killed one left.
#[cfg(unix)]
#[test]
fn the_run_after_a_killed_one_keeps_its_recording() {
    let folder = temp();
    let routine = quick().write(folder.path());
    let out = folder.path().join("out");
    let partial = out.join("run.mcap.partial");
    let mut first = start(&routine, &out);
    wait_until_it_moves(&mut first, &partial);

    // No other run may write there meanwhile.
    run(&routine, &out).expect("two runs at once", 1, &["--out"]);
    first.kill().expect("killed");
    first.wait().expect("gone");
    let left = fs::read(&partial).expect("left");

    let mut second = start(&routine, &out);
    while !out.join("truth-cut-1.mcap").exists() {
        assert!(second.try_wait().expect("a state").is_none(), "the run ended");
        std::thread::sleep(Duration::from_millis(5));
    }
    wait_until_it_moves(&mut second, &partial);
    assert!(fs::read(out.join("run-cut-1.mcap")).expect("kept") == left);
    assert!(out.join("truth-cut-1.mcap").exists());
    signal(&second, "INT");
    let (code, said) = end(second);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("run-cut-1.mcap"), "{said}");
    assert!(said.contains("[interrupted]") && said.contains("run-cut-2.mcap"), "{said}");
    assert_eq!(names(&out), ["run-cut-1.mcap", "run-cut-2.mcap", "truth-cut-1.mcap", "truth-cut-2.mcap"]);
    check_interrupted(&out.join("run-cut-2.mcap"));
    inspect(&out.join("truth-cut-2.mcap")).expect("the truth", 0, &["state        whole"]);
}

/// Checks that the recording is finished properly: it is complete, and its last message tells the arm to hold.
fn check_interrupted(path: &Path) {
    inspect(path).expect("interrupted", 0, &["state        whole"]);
    let recording = read_recording(path).expect("it reads");
    let mut last = recording.messages.iter().rev().map(|(_, message)| message);
    assert!(matches!(last.next(), Some(Message::Log(line)) if line.text.contains("holds its last set-point")));
    let commands: Vec<_> = recording
        .messages
        .iter()
        .rev()
        .filter_map(|(_, m)| if let Message::JointCommand(command) = m { Some(command.counts) } else { None })
        .take(2)
        .collect();
    let moved: f64 = commands[0].iter().zip(commands[1].iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved < 500.0, "the set-point does not jump: {moved} counts");
}

/// Checks that a moving run stops by this signal and keeps its recording.
#[cfg(unix)]
#[track_caller]
fn stops_by(name: &str, routine: &Path, out: &Path) {
    // The parent process of the tests may ignore hangups.
    let mut command = Command::new("env");
    command.arg("--default-signal").arg(env!("CARGO_BIN_EXE_armcal")).arg("run").arg(routine).arg("--out").arg(out);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
    wait_until_it_moves(&mut child, &out.join("run.mcap.partial"));
    signal(&child, name);
    let (code, said) = end(child);
    assert_eq!(code, Some(1), "{said}");
    check_interrupted(&out.join("run-cut-1.mcap"));
}

#[cfg(unix)]
#[test]
fn sigterm_stops_a_run_and_a_second_signal_ends_it_at_once() {
    let folder = temp();
    let routine = quick().write(folder.path());
    let out = folder.path().join("out");
    stops_by("TERM", &routine, &out);

    // During planning the first signal waits; the second does not.
    let out = folder.path().join("twice");
    let mut child = start(&routine, &out);
    while !out.join("run.mcap.partial").exists() {
        std::thread::sleep(Duration::from_millis(5));
    }
    signal(&child, "INT");
    std::thread::sleep(Duration::from_millis(50));
    if child.try_wait().expect("a state").is_none() {
        signal(&child, "INT");
    }
    let (code, said) = end(child);
    assert!(matches!(code, Some(1 | 130)), "{code:?} {said}");
}

/// Runs where files cannot grow beyond `limit` blocks of 512 bytes, which imitates a full disk without special rights.
#[cfg(unix)]
fn run_on_full_disk(limit: u64, reference: &FinishedRun, out: &Path) -> Answer {
    let mut shell = Command::new("sh");
    let line = format!("ulimit -f {limit}; exec \"$0\" run \"$1\" --out \"$2\"");
    shell.arg("-c").arg(line).arg(env!("CARGO_BIN_EXE_armcal")).arg(&reference.routine).arg(out);
    answer(&mut shell)
}

#[cfg(unix)]
#[test]
fn a_full_disk_is_told_and_costs_nothing_that_was_there() {
    let (reference, _) = reference();
    let folder = temp();
    for (limit, is_early) in [(0, true), (200, false), (2400, false)] {
        let out = folder.path().join(format!("out{limit}"));
        fs::create_dir_all(&out).expect("a folder");
        for name in RESULTS {
            fs::write(out.join(name), "earlier").expect("written");
        }
        let said = run_on_full_disk(limit, reference, &out);
        assert_eq!(said.code, 1, "limit {limit}: {said:#?}");
        assert!(
            said.stderr.contains(".partial") && said.stderr.contains("[file_unwritable]"),
            "limit {limit}: {said:#?}"
        );
        for name in RESULTS {
            assert_eq!(fs::read(out.join(name)).expect("there"), b"earlier", "limit {limit}: {name}");
        }
        assert!(names(&out).iter().all(|name| !name.ends_with(".partial")), "{:?}", names(&out));
        let kept: PathBuf = out.join("run-cut-1.mcap");
        assert_eq!(kept.exists(), !is_early, "limit {limit}: {said:#?}");
        if !is_early {
            let found = look(&kept, None).expect("it reads");
            assert!(found.messages > 500, "limit {limit}: {} messages", found.messages);
            assert!(limit < 2400 || found.arm.views_fit > 0, "limit {limit}: no view");
            assert!(found.completeness.state != State::Damaged, "limit {limit}: {:?}", found.completeness);
        }
    }
}

/// Expects no loss at `n` limits: any size up to that of the largest result, and just below and above that of each.
/// `ARMCAL_FULL_DISKS` sets `n`.
#[cfg(unix)]
fn expect_full_disks_to_lose_nothing(n: u64) {
    const BLOCK_BYTES: u64 = 512;
    let (reference, _) = reference();
    let sizes = RESULTS.map(|name| fs::metadata(reference.file(name)).expect("a result").len() / BLOCK_BYTES);
    // The last limit leaves room for all files.
    let largest = sizes.into_iter().max().unwrap_or(0) + 2;
    let spread = (1..=n).map(|k| largest * k / n);
    let edges = sizes.iter().flat_map(|blocks| [*blocks, *blocks + 2]).filter(|_| n >= 64);
    let limits: Vec<u64> = spread.chain(edges).collect();
    let (mut n_stopped, mut n_without_replay) = (0, 0);
    for &limit in &limits {
        let folder = temp();
        let out = folder.path().join("out");
        fs::create_dir_all(&out).expect("a folder");
        for name in RESULTS {
            fs::write(out.join(name), "earlier").expect("written");
        }
        let said = run_on_full_disk(limit, reference, &out);
        assert!(names(&out).iter().all(|name| !name.ends_with(".partial")), "limit {limit}: {:?}", names(&out));
        let kept = out.join("run-cut-1.mcap");
        if said.code == 0 {
            for name in ["run.mcap", "truth.mcap", "calibration.toml"] {
                assert!(fs::read(out.join(name)).expect("there") == reference.bytes(name), "limit {limit}: {name}");
            }
            let replay = fs::read(out.join("run.rrd")).ok();
            assert!(replay.as_deref() != Some(b"earlier"), "limit {limit}: an old replay beside new results");
            assert_eq!(replay.is_none(), said.stderr.contains("run.rrd"), "limit {limit}: {said:#?}");
            n_without_replay += u32::from(replay.is_none());
            continue;
        }
        n_stopped += 1;
        assert_eq!(said.code, 1, "limit {limit}: {said:#?}");
        assert!(said.stderr.contains("[file_unwritable]"), "limit {limit}: {said:#?}");
        for name in RESULTS {
            assert_eq!(fs::read(out.join(name)).expect("there"), b"earlier", "limit {limit}: {name}");
        }
        let found = kept.exists().then(|| look(&kept, None).expect("it reads"));
        assert!(found.is_none_or(|found| found.completeness.state != State::Damaged), "limit {limit}");
    }
    eprintln!("{n_stopped} of {} stopped, {n_without_replay} without a replay", limits.len());
    assert!(n_stopped > 0 && n_stopped < limits.len());
}

#[cfg(unix)]
#[test]
fn a_disk_that_fills_on_the_way_loses_nothing() {
    expect_full_disks_to_lose_nothing(2);
}

#[cfg(unix)]
#[test]
#[ignore = "second tier: disks of four sizes, 7 s"]
fn a_disk_that_fills_at_any_size_loses_nothing() {
    expect_full_disks_to_lose_nothing(
        std::env::var("ARMCAL_FULL_DISKS").ok().and_then(|n| n.parse().ok()).unwrap_or(4),
    );
}

/// The replay is larger than the recording: only the replay does not fit, and all else is written.
#[cfg(unix)]
#[test]
fn a_replay_that_does_not_fit_is_a_warning() {
    let folder = temp();
    let tail = "[world.physics]\ntruth_rate_hz = 10.0\n".to_owned();
    let routine = ShortRoutine { tail, ..quick() }.write(folder.path());
    let out = folder.path().join("out");
    let mut shell = Command::new("sh");
    let line = "ulimit -f 5000; exec \"$0\" run \"$1\" --out \"$2\"";
    shell.arg("-c").arg(line).arg(env!("CARGO_BIN_EXE_armcal")).arg(&routine).arg(&out);
    answer(&mut shell).expect("no replay", 0, &["run.rrd", "ACCEPTED"]);
    let mut expected: Vec<&str> = RESULTS.into_iter().filter(|name| *name != "run.rrd").collect();
    expected.sort_unstable();
    assert_eq!(names(&out), expected);
    inspect(&out.join("run.mcap")).expect("the recording", 0, &["state        whole"]);
}

/// A closed terminal sends a hangup; a run under `nohup` continues.
#[cfg(unix)]
#[test]
fn a_hangup_stops_a_run_unless_it_was_started_to_ignore_it() {
    let folder = temp();
    let routine = quick().write(folder.path());
    let out = folder.path().join("out");
    stops_by("HUP", &routine, &out);

    let out = folder.path().join("nohup");
    let mut shell = Command::new("sh");
    shell.arg("-c").arg("trap '' HUP; exec \"$0\" run \"$1\" --out \"$2\"").arg(env!("CARGO_BIN_EXE_armcal"));
    shell.arg(&routine).arg(&out).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = shell.spawn().expect("the program starts");
    wait_until_it_moves(&mut child, &out.join("run.mcap.partial"));
    signal(&child, "HUP");
    let (code, said) = end(child);
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn a_folder_that_was_removed_is_named() {
    let folder = temp();
    let routine = quick().write(folder.path());
    let out = folder.path().join("out");
    let mut child = start(&routine, &out);
    wait_until_it_moves(&mut child, &out.join("run.mcap.partial"));
    fs::remove_dir_all(&out).expect("removed");
    let (code, said) = end(child);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("[file_unwritable]") && said.contains("out"), "{said}");
}

#[test]
fn a_run_into_a_used_folder_leaves_its_own_files_alone() {
    let (reference, _) = reference();
    let folder = temp();
    for name in ["summary.json", "run.rrd", "notes.txt"] {
        fs::write(folder.path().join(name), "earlier").expect("written");
    }
    run(&reference.routine, folder.path()).expect("a run", 0, &["ACCEPTED"]);
    let mut expected: Vec<String> = RESULTS.iter().map(|name| (*name).to_owned()).collect();
    expected.push("notes.txt".to_owned());
    expected.sort();
    assert_eq!(names(folder.path()), expected);
    for name in ["run.mcap", "truth.mcap", "calibration.toml"] {
        assert!(fs::read(folder.path().join(name)).expect("there") == reference.bytes(name), "{name}");
    }
}

/// The run is refused before anything moves, and no file is left.
#[test]
fn an_output_that_cannot_take_a_run_is_refused_at_once() {
    let (reference, took) = reference();
    let folder = temp();
    let file = folder.path().join("file");
    fs::write(&file, "in the way").expect("written");
    let out = folder.path().join("out");
    fs::create_dir_all(out.join("summary.json")).expect("a folder in the way");
    let mut cases = vec![(file, "file"), (out.clone(), "summary.json")];
    if cfg!(target_os = "linux") {
        // Not even root can make files there.
        cases.push((PathBuf::from("/proc/self"), "/proc/self"));
    }
    for (out, words) in cases {
        let began = Instant::now();
        let said = run(&reference.routine, &out);
        said.expect("refused", 1, &[words, out.to_str().expect("UTF-8"), "[file_unwritable]"]);
        assert!(began.elapsed() < took.mul_f64(0.5), "before anything is simulated");
    }
    assert_eq!(names(&out), ["summary.json"]);
}

/// At most two seconds of the arm's time are only in memory, and a captured view is on disk at once.
#[test]
fn chunks_are_short_and_end_with_captured_views() {
    let (reference, _) = reference();
    let bytes = reference.bytes("run.mcap");
    let recording = read_recording(reference.file("run.mcap")).expect("it reads");
    let marks: Vec<_> = recording
        .messages
        .iter()
        .filter_map(|(at, m)| match m {
            Message::Mark(mark) if !matches!(mark.kind, MarkKind::Phase(_)) => Some(*at),
            _ => None,
        })
        .collect();
    let (mut at, mut ends, mut longest_s, mut largest) = (8, Vec::new(), 0.0_f64, 0);
    while at + 9 <= bytes.len() - 8 {
        let len = 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("8 bytes")) as usize;
        if bytes[at] == 6 {
            let time =
                |field: usize| u64::from_le_bytes(bytes[at + field..at + field + 8].try_into().expect("8 bytes"));
            longest_s = longest_s.max((time(17) - time(9)) as f64 * 1e-9);
            largest = largest.max(len);
            ends.push(time(17));
        }
        at += len;
    }
    eprintln!("{} chunks, at most {longest_s:.2} s and {largest} bytes", ends.len());
    assert!(longest_s <= 2.01, "{longest_s} s");
    for mark in &marks {
        assert!(ends.contains(&(mark.nanos as u64)), "a view is on disk when it is marked");
    }
}

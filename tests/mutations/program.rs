//! The program on changed files, under limits of memory and time.
//!
//! A case is a number, which chooses a file and a command and seeds the changes. `ARMCAL_MUTATED_FROM=N
//! ARMCAL_MUTATED_RUNS=1` repeats it. The folder of a failed case is kept.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use armcal::stats::stream_rng;

use super::bytes::mutated;
use super::recording::with_changed_messages;
use crate::support::{program, root, temp, write};

/// Limit of one run's processor time, and of its waiting time beyond that, because other work on the machine may delay
/// it.
const LONGEST: Duration = Duration::from_secs(20);
const LONGEST_WAIT: Duration = Duration::from_secs(600);
/// Address space of a run, KiB; `MOST_KIB` limits the memory in use.
const GIVEN_KIB: u64 = 2 << 20;
const MOST_KIB: u64 = 500_000;
/// Number of runs in every test run; `ARMCAL_MUTATED_RUNS=20000` for a campaign.
const RUNS: u64 = 51;

/// A file to change, its name in the folder of the case, and the command. A word after `-` is kept; a name of the
/// folder becomes its path.
struct Case {
    /// Path of the file below the repository's root.
    seed: &'static str,
    name: &'static str,
    command: &'static str,
}

const fn case(seed: &'static str, name: &'static str, command: &'static str) -> Case {
    Case { seed, name, command }
}

const VIEWS: &str = "fuzz/corpus/recording/views.mcap";
const BAG: &str = "fuzz/corpus/bag/arm.db3";
const CUT: &str = "fuzz/corpus/recording/cut.mcap";
const TAGMAP: &str = "tagmap views.mcap --topic /camera/wrist/detections --camera cameras.yaml --tags";
const TABLE: &str = "calibrate poses.csv --robot robot --input table.toml --out out --method minimum_distance";

const CASES: [Case; 54] = [
    case("robots/titan4/titan4.urdf", "robot/titan4.urdf", "check robot"),
    case("robots/titan4/titan4.urdf", "robot/titan4.urdf", "inspect views.mcap --robot robot"),
    case("robots/kraft-predator/kraft-predator.urdf", "robot/titan4.urdf", "check robot"),
    case("robots/titan4/robot.toml", "robot/robot.toml", "check robot"),
    case("robots/titan4/self_collision.toml", "robot/self_collision.toml", "check robot"),
    case("robots/titan4-gripper-tag/robot.toml", "robot/robot.toml", "check robot"),
    case("robots/vehicles/work-class-front.toml", "vehicle.toml", "check vehicle.toml"),
    case("robots/vehicles/under-ice.toml", "vehicle.toml", "check vehicle.toml"),
    case("fuzz/corpus/routine/short.toml", "routine.toml", "check routine.toml"),
    case("routines/titan4-touch.toml", "routine.toml", "check routine.toml"),
    case("routines/bad-dive.toml", "routine.toml", "check routine.toml"),
    case("fuzz/corpus/obj/angle.obj", "a.obj", "check hull-obj.toml"),
    case("fuzz/corpus/obj/angle.obj", "a.obj", "check parts-obj.toml"),
    case("fuzz/corpus/dae/scene.dae", "a.dae", "check hull-dae.toml"),
    case("fuzz/corpus/dae/scene.dae", "a.dae", "check parts-dae.toml"),
    case("fuzz/corpus/stl/binary.stl", "a.stl", "check hull-stl.toml"),
    case("fuzz/corpus/stl/text.stl", "a.stl", "check parts-stl.toml"),
    case("routines/motion/hover.csv", "motion.csv", "check motion.toml"),
    case("fuzz/corpus/task/task.toml", "task.toml", "check task.toml"),
    case("fuzz/corpus/input_map/positions.toml", "input.toml", "check input.toml"),
    case("fuzz/corpus/input_map/table.toml", "input.toml", "check input.toml"),
    case("fuzz/corpus/input_map/board.toml", "input.toml", "check input.toml"),
    case("fuzz/corpus/table_csv/poses.csv", "poses.csv", TABLE),
    case("fuzz/corpus/plan/plan.toml", "plan.toml", "check plan.toml"),
    case("fuzz/corpus/tag_map/map.toml", "map.toml", "check map.toml"),
    case("fuzz/corpus/tag_map/board.toml", "map.toml", "check map.toml"),
    case("recordings/sample/calibration.toml", "calibration.toml", "check calibration.toml"),
    case("recordings/sample/calibration.toml", "calibration.toml", "export calibration.toml --as yaml"),
    case("recordings/sample/calibration.covariance.toml", "calibration.covariance.toml", "check calibration.toml"),
    case("fuzz/corpus/compact/minimum_distance.txt", "line.txt", "export line.txt --as yaml --robot robot"),
    case("robots/titan4/titan4.urdf", "given.urdf", "new-robot given.urdf --out made"),
    case("fuzz/corpus/new_robot/hand.urdf", "given.urdf", "new-robot given.urdf --out made"),
    case("robots/titan4/titan4.urdf", "robot/titan4.urdf", "export calibration.toml --as urdf --robot robot"),
    case("recordings/sample/calibration.toml", "calibration.toml", "export calibration.toml --as table --robot robot"),
    case("recordings/sample/calibration.toml", "calibration.toml", "export calibration.toml --as kalibr --robot robot"),
    case("fuzz/corpus/tags/tagslam.yaml", "tags.yaml", TAGMAP),
    case("fuzz/corpus/tags/kalibr.yaml", "tags.yaml", TAGMAP),
    case("fuzz/corpus/cameras/cameras.yaml", "cameras.yaml", TAGMAP),
    case("fuzz/corpus/campaign_table/rows.csv", "rows.csv", "campaign --merge rows.csv --out out.csv"),
    case(VIEWS, "given.mcap", "inspect given.mcap --robot robot"),
    case(CUT, "given.mcap", "inspect given.mcap --json"),
    case(VIEWS, "changed.mcap", "inspect changed.mcap --robot robot --write-input map.toml"),
    case(CUT, "given.mcap", "replay given.mcap --save out.rrd"),
    case(BAG, "given.db3", "inspect given.db3 --robot robot"),
    case(BAG, "given.db3", "inspect given.db3 --write-input map.toml"),
    case(BAG, "given.db3", "calibrate given.db3 --robot robot --out out --method minimum_distance"),
    case(VIEWS, "given.mcap", "watch given.mcap --robot robot --idle-s 1"),
    case(VIEWS, "changed.mcap", "watch changed.mcap --robot robot --idle-s 1 --json --out out"),
    case(VIEWS, "changed.mcap", "inspect changed.mcap --robot robot"),
    case(VIEWS, "changed.mcap", "calibrate changed.mcap --robot robot --out out --method minimum_distance"),
    case(VIEWS, "changed.mcap", "calibrate changed.mcap --robot robot --out out"),
    case(VIEWS, "changed.mcap", "watch changed.mcap --robot robot --out out --stationary"),
    case(VIEWS, "changed.mcap", "replay changed.mcap --robot robot --save out.rrd"),
    case(VIEWS, "changed.mcap", "tagmap changed.mcap --robot robot --out out.toml"),
];

/// Writes the files that accompany the changed one.
fn lay_out(folder: &Path) {
    std::fs::create_dir(folder.join("robot")).expect("a folder");
    for name in ["robot.toml", "titan4.urdf"] {
        std::fs::copy(root().join("robots/titan4").join(name), folder.join("robot").join(name)).expect("copied");
    }
    for (from, to) in [
        ("robots/vehicles/work-class-front.toml", "vehicle.toml"),
        (VIEWS, "views.mcap"),
        ("fuzz/corpus/cameras/cameras.yaml", "cameras.yaml"),
        ("fuzz/corpus/tags/tagslam.yaml", "tags.yaml"),
        ("fuzz/corpus/input_map/table.toml", "table.toml"),
        ("recordings/sample/calibration.toml", "calibration.toml"),
        ("recordings/sample/calibration.covariance.toml", "calibration.covariance.toml"),
    ] {
        std::fs::copy(root().join(from), folder.join(to)).expect("copied");
    }
    let routine = std::fs::read_to_string(root().join("fuzz/corpus/routine/short.toml")).expect("it reads");
    for (name, convex) in [("hull", "hull"), ("parts", "decomposed")] {
        for kind in ["stl", "obj", "dae"] {
            let mesh = format!("shape = \"mesh\"\nscale_m = 0.001\nfile = \"a.{kind}\"\nconvex = \"{convex}\"\n");
            let text = routine.replace("shape = \"sphere\"\nradius_m = 0.5\n", &mesh);
            write(&folder.join(format!("{name}-{kind}.toml")), &text);
        }
    }
    let moved = "[world.vehicle]\nmotion = \"recorded\"\nmotion_file = \"motion.csv\"\n";
    write(&folder.join("motion.toml"), &format!("{routine}{moved}"));
}

/// Runs one case; returns the exit code, or the fault.
fn run_case(number: u64) -> Result<i32, String> {
    let case = &CASES[(number % CASES.len() as u64) as usize];
    let folder = temp();
    lay_out(folder.path());
    let mut rng = stream_rng(number, "mutated runs");
    let seed = root().join(case.seed);
    let bytes = if case.name == "changed.mcap" {
        with_changed_messages(&seed, &mut rng)
    } else {
        mutated(&std::fs::read(&seed).expect("it reads"), &mut rng)
    };
    std::fs::write(folder.path().join(case.name), bytes).expect("written");
    let tags = if case.command == TAGMAP { " tags.yaml" } else { "" };
    let words = format!("{}{tags}", case.command);
    let found = watch(folder.path(), &words);
    found.map_err(|problem| {
        let kept = folder.keep();
        format!("case {number}: {problem}: cd {} && armcal {words}", kept.display())
    })
}

/// Runs the program in `folder`, and checks its exit, its time and its memory.
fn watch(folder: &Path, words: &str) -> Result<i32, String> {
    let output = |name: &str| std::fs::File::create(folder.join(name)).expect("a file");
    let limited = format!("ulimit -v {GIVEN_KIB}; exec \"$0\" \"$@\"");
    let mut child = Command::new("sh")
        .args(["-c", &limited])
        .arg(program().get_program())
        .args(words.split(' '))
        .current_dir(folder)
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::null())
        .stdout(output("stdout"))
        .stderr(output("stderr"))
        .spawn()
        .expect("the program starts");
    let (code, used_kib) = wait(&mut child)?;
    let said = ["stdout", "stderr"].map(|name| std::fs::read(folder.join(name)).expect("it reads"));
    let said = said.map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    if said.contains("panicked") || said.contains("memory allocation") {
        return Err(said.lines().take(3).collect::<Vec<_>>().join(" "));
    }
    if used_kib > MOST_KIB {
        return Err(format!("{used_kib} KiB used"));
    }
    if !(0..=4).contains(&code) {
        return Err(format!("exit code {code}"));
    }
    if let Some(c) = said.chars().find(|c| c.is_control() && *c != '\n' && *c != '\t') {
        return Err(format!("{c:?} reaches the terminal"));
    }
    Ok(code)
}

/// Exit code and peak memory, KiB.
fn wait(child: &mut Child) -> Result<(i32, u64), String> {
    let started = Instant::now();
    let status = PathBuf::from(format!("/proc/{}/status", child.id()));
    let mut used_kib = 0;
    loop {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let peak = text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"));
        used_kib = used_kib.max(peak.and_then(|kib| kib.trim().parse().ok()).unwrap_or(0));
        if let Some(ended) = child.try_wait().expect("it can be waited for") {
            return ended.code().map(|code| (code, used_kib)).ok_or_else(|| format!("killed: {ended}"));
        }
        let used = processor_time(child.id());
        if used > LONGEST || started.elapsed() > LONGEST_WAIT {
            child.kill().and_then(|()| child.wait()).expect("it ends");
            return Err(format!("{used:?} of processor time and more, {:?} in all", started.elapsed()));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Processor time of a process, without its children; zero where it has ended.
fn processor_time(id: u32) -> Duration {
    let text = std::fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    // Fields after the name in brackets: state, eleven others, then the ticks of user and system, of 10 ms each.
    let fields = text.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace().skip(11).take(2);
    Duration::from_millis(fields.filter_map(|ticks| ticks.parse::<u64>().ok()).sum::<u64>() * 10)
}

#[test]
fn the_program_survives_mutated_files() {
    let number = |name: &str, other| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(other);
    let first = number("ARMCAL_MUTATED_FROM", 0);
    let (next, end) = (AtomicU64::new(first), first + number("ARMCAL_MUTATED_RUNS", RUNS));
    let (codes, problems) = (Mutex::new(BTreeMap::<i32, u64>::new()), Mutex::new(Vec::new()));
    let work = || {
        loop {
            let case = next.fetch_add(1, Ordering::Relaxed);
            if case >= end {
                return;
            }
            match run_case(case) {
                Ok(code) => *codes.lock().expect("codes").entry(code).or_default() += 1,
                Err(problem) => {
                    eprintln!("{problem}");
                    problems.lock().expect("problems").push(problem);
                }
            }
        }
    };
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| (0..n_threads).for_each(|_| drop(scope.spawn(work))));
    let problems = problems.into_inner().expect("problems");
    eprintln!("exit codes and how often: {:?}", codes.into_inner().expect("codes"));
    assert!(problems.is_empty(), "{} cases went wrong:\n{}", problems.len(), problems.join("\n"));
}

/// The check detects a panic, too much memory and too long a time.
#[test]
fn what_goes_wrong_is_seen() {
    let folder = temp();
    assert_eq!(watch(folder.path(), "--version"), Ok(0));
    assert_eq!(watch(folder.path(), "dance"), Ok(2));
    let mut child = Command::new("sh").args(["-c", "kill -6 $$"]).spawn().expect("it starts");
    assert!(wait(&mut child).is_err_and(|problem| problem.contains("killed")));
}

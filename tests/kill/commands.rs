//! Commands that are killed at any moment, or cannot use their folder: a result is the old one or the new one,
//! complete.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use armcal::stats::stream_rng;
use rand::RngExt;

use super::{names, reference};
use crate::support::texts::Texts;
use crate::support::{ShortRoutine, answer, calibrate, program, read, robot_folder, shared_run, temp};

/// A command that writes into `out`, and its files; the last one vouches for the others.
struct Case {
    command: fn(&Path) -> Command,
    leaves: &'static [&'static str],
}

const CASES: [Case; 3] = [
    Case {
        command: |out| {
            let mut command = program();
            command.arg("calibrate").arg(shared_run().file("run.mcap")).arg("--robot").arg(robot_folder());
            command.arg("--out").arg(out);
            command
        },
        leaves: &["calibration.covariance.toml", "calibration.toml", "report.html", "summary.json"],
    },
    Case {
        command: |out| {
            let mut command = program();
            command.arg("replay").arg(shared_run().file("run.mcap")).arg("--save").arg(out.join("a.rrd"));
            command
        },
        leaves: &["a.rrd"],
    },
    Case {
        command: |out| {
            let mut command = program();
            command.arg("regress").arg(&reference().0.routine).args(["--seeds=1", "--write-baseline"]);
            command.arg(out.join("b.csv"));
            command
        },
        leaves: &["b.csv"],
    },
];

fn whole(command: &mut Command) {
    let said = answer(command);
    assert_eq!(said.code, 0, "{said:#?}");
}

/// The summary without its times, the only values of the wall clock.
fn without_times(text: &str) -> String {
    text.lines().filter(|line| !line.contains("wall_s")).collect()
}

fn results(out: &Path, case: &Case) -> Vec<Option<String>> {
    let text = |name: &&str| fs::read(out.join(name)).ok().map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    case.leaves.iter().map(text).map(|text| text.map(|text| without_times(&text))).collect()
}

/// Sends kill -9 at random moments while the commands read, work, write and rename: `ARMCAL_KILLS` of each.
fn expect_old_results_or_new_ones(cases: &[Case], kills: u32) {
    let mut rng = stream_rng(2, "kills");
    for case in cases {
        let folder = temp();
        let out = folder.path().to_owned();
        let began = Instant::now();
        whole(&mut (case.command)(&out));
        let (took, new) = (began.elapsed(), results(&out, case));
        let (mut n_old, mut n_new) = (0, 0);
        for kill in 0..kills {
            for name in case.leaves {
                fs::write(out.join(name), "earlier").expect("written");
            }
            let mut child = (case.command)(&out).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("started");
            // Two of three kills come near the end, when files are put in place.
            let share = if kill % 3 == 0 { rng.random_range(0.0..1.0) } else { rng.random_range(0.9..1.1) };
            std::thread::sleep(took.mul_f64(share));
            child.kill().expect("killed");
            child.wait().expect("gone");
            let left = results(&out, case);
            let is_old = |text: &Option<String>| text.as_deref() == Some("earlier");
            // Between the first and the last rename nothing vouches for the others.
            match left.last().expect("a result") {
                Some(_) if left.iter().all(is_old) => n_old += 1,
                Some(_) => {
                    assert_eq!(left, new, "all of the new ones");
                    n_new += 1;
                }
                None => {
                    assert!(left.iter().flatten().all(|text| text == "earlier" || new.contains(&Some(text.clone()))))
                }
            }
        }
        eprintln!("{:?}: {n_old} of {kills} old, {n_new} new", case.leaves);
        whole(&mut (case.command)(&out));
        assert_eq!(results(&out, case), new);
        let mut expected = case.leaves.to_vec();
        expected.sort_unstable();
        assert_eq!(names(&out), expected, "what was left half is gone");
    }
}

#[test]
fn a_killed_calibration_leaves_old_results_or_new_ones() {
    expect_old_results_or_new_ones(&CASES[..1], 3);
}

#[test]
#[ignore = "second tier: three commands killed three times each, 12 s"]
fn a_killed_command_leaves_old_results_or_new_ones() {
    let kills = std::env::var("ARMCAL_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(3);
    expect_old_results_or_new_ones(&CASES, kills);
}

#[test]
fn of_two_calibrations_into_a_folder_the_second_says_so() {
    let _texts = Texts::of("of_two_calibrations_into_a_folder_the_second_says_so");
    let folder = temp();
    let lock = fs::File::create(folder.path().join("armcal.lock")).expect("made");
    lock.lock().expect("locked");
    let recording = shared_run().file("run.mcap");
    calibrate(&recording, &robot_folder(), folder.path()).expect("busy", 1, &["--out"]);
    assert_eq!(names(folder.path()), ["armcal.lock"]);
    drop(lock);
    calibrate(&recording, &robot_folder(), folder.path()).expect("alone", 0, &["ACCEPTED"]);
    assert!(!names(folder.path()).contains(&"armcal.lock".to_owned()));
}

#[cfg(unix)]
#[test]
fn results_have_the_rights_that_the_umask_leaves() {
    use std::os::unix::fs::PermissionsExt;
    for (umask, expected) in [("002", 0o664), ("027", 0o640)] {
        for case in &CASES[..2] {
            let folder = temp();
            let of = (case.command)(folder.path());
            let mut shell = Command::new("sh");
            shell.arg("-c").arg(format!("umask {umask}; exec \"$0\" \"$@\"")).arg(of.get_program()).args(of.get_args());
            whole(&mut shell);
            for name in case.leaves {
                let mode = fs::metadata(folder.path().join(name)).expect("there").permissions().mode() & 0o777;
                assert_eq!(mode, expected, "{name} under {umask}: {mode:o}");
            }
        }
    }
}

/// The error comes before the work, not after an hour of runs.
#[cfg(target_os = "linux")]
#[test]
fn where_nothing_can_be_written_is_found_before_the_work() {
    let (reference, took) = reference();
    // Not even root can make files there.
    let nowhere = PathBuf::from("/proc/self/a.csv");
    let baseline = ["regress", "--seeds=1", "--write-baseline"];
    for words in [&baseline[..], &["campaign", "--seeds=1", "--out"]] {
        let began = Instant::now();
        let said = answer(program().args(words).arg(&nowhere).arg(&reference.routine));
        said.expect(words[0], 1, &["/proc/self"]);
        assert!(began.elapsed() < took.mul_f64(0.5), "{words:?}");
    }
    // With an unwritable folder and an impossible task, the error names the folder first.
    let folder = temp();
    let unreachable = ShortRoutine { targets_m: vec![[0.0, 0.0, 2.2]], ..ShortRoutine::default() }.write(folder.path());
    let said = answer(program().arg("plan").arg(&unreachable).args(["--out", "/proc/self"]));
    said.expect("plan", 1, &["/proc/self"]);
    let new = folder.path().join("new");
    let said = answer(program().arg("plan").arg(&unreachable).arg("--out").arg(&new));
    assert!(said.code != 0 && !said.stderr.contains("/proc/self"), "{said:#?}");
    assert!(!new.exists(), "what comes to nothing leaves nothing");
}

#[cfg(unix)]
#[test]
fn a_link_in_the_place_of_a_growing_file_is_not_followed() {
    let folder = temp();
    let [target, out] = ["precious", "c.csv"].map(|name| folder.path().join(name));
    fs::write(&target, "precious").expect("written");
    std::os::unix::fs::symlink(&target, folder.path().join("c.csv.partial")).expect("linked");
    let mut campaign = program();
    campaign.arg("campaign").arg(&reference().0.routine).args(["--seeds=1", "--out"]).arg(&out);
    answer(&mut campaign).expect("a link", 1, &["c.csv.partial", "is a link"]);
    assert_eq!(read(&target), "precious");
}

/// Sends kill -9 at random moments to repeated runs of the same campaign: `ARMCAL_KILLS` of them.
fn expect_a_killed_campaign_to_go_on(kills: u32) {
    let folder = temp();
    let campaign = |name: &str, seeds: u32| {
        let mut command = program();
        command.arg("campaign").arg(&reference().0.routine).args(["--threads=2", "--seeds"]);
        command.arg(format!("1..{seeds}")).arg("--out").arg(folder.path().join(name));
        command
    };
    // With this number of seeds about one kill comes in the middle of each run, for any load of the machine.
    let seeds = kills.div_ceil(2).max(2);
    let began = Instant::now();
    whole(&mut campaign("whole.csv", seeds));
    let per_run = began.elapsed() / seeds;
    let (mut rng, mut n_rows) = (stream_rng(3, "kills"), 0);
    for _ in 0..kills {
        let mut child =
            campaign("killed.csv", seeds).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts");
        std::thread::sleep(per_run.mul_f64(rng.random_range(0.0..2.5)));
        child.kill().expect("killed");
        child.wait().expect("gone");
        let rows = ["killed.csv", "killed.csv.partial"].map(|name| fs::read_to_string(folder.path().join(name)));
        let rows = rows.iter().flatten().map(|text| text.lines().count()).max().unwrap_or(0);
        // The last row may be cut, and is removed when the campaign continues.
        assert!(rows + 1 >= n_rows, "{rows} rows after {n_rows}");
        n_rows = rows;
    }
    eprintln!("{kills} kills of a campaign of {seeds} runs, {n_rows} lines before it went on to its end");
    whole(&mut campaign("killed.csv", seeds));
    let parquet = cfg!(feature = "parquet").then_some("parquet");
    for ending in ["csv"].into_iter().chain(parquet) {
        let [expected, found] =
            ["whole", "killed"].map(|name| fs::read(folder.path().join(name).with_extension(ending)).expect("written"));
        assert!(expected == found, "{ending}");
    }
    assert!(names(folder.path()).iter().all(|name| !name.contains("partial")), "{:?}", names(folder.path()));
}

#[test]
fn a_killed_campaign_goes_on_to_the_same_rows() {
    expect_a_killed_campaign_to_go_on(1);
}

#[test]
#[ignore = "second tier: three kills of a campaign, 11 s"]
fn a_campaign_that_is_killed_again_and_again_goes_on_to_the_same_rows() {
    expect_a_killed_campaign_to_go_on(std::env::var("ARMCAL_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(3));
}

/// Commands that write into `out`, an existing folder.
fn that_write(out: &Path) -> Vec<Command> {
    let recording = shared_run().file("run.mcap");
    let routine = &reference().0.routine;
    let with = |words: &[&str], paths: &[&Path]| {
        let mut command = program();
        command.args(words).args(paths);
        command
    };
    let out_is = [Path::new("--out"), out];
    let robot = [Path::new("--robot"), &robot_folder()].map(Path::to_owned);
    vec![
        with(&["run"], &[&[routine.as_path()], &out_is[..]].concat()),
        with(&["plan"], &[&[routine.as_path()], &out_is[..]].concat()),
        with(&["calibrate"], &[&[recording.as_path(), &robot[0], &robot[1]], &out_is[..]].concat()),
        with(&["watch"], &[&[recording.as_path(), &robot[0], &robot[1]], &out_is[..]].concat()),
        with(&["tagmap"], &[&recording, &robot[0], &robot[1], Path::new("--out"), &out.join("map.toml")]),
        with(&["replay"], &[&recording, Path::new("--save"), &out.join("a.rrd")]),
        with(&["campaign", "--seeds=1"], &[routine, Path::new("--out"), &out.join("c.csv")]),
        with(&["regress", "--seeds=1"], &[routine, Path::new("--write-baseline"), &out.join("b.csv")]),
    ]
}

/// A mount in a separate namespace, in which root cannot write either. The test is skipped where none can be made.
#[cfg(target_os = "linux")]
#[test]
fn a_read_only_mount_is_named_and_nothing_is_left() {
    let folder = temp();
    let out = folder.path().join("out");
    fs::create_dir(&out).expect("a folder");
    fs::write(out.join("earlier"), "earlier").expect("written");
    let mounted = "mount --bind \"$0\" \"$0\" && mount -o remount,ro,bind \"$0\" && exec \"$@\"";
    let inside = |of: &Command| {
        let mut command = Command::new("unshare");
        command.args(["-rm", "sh", "-c", mounted]).arg(&out).arg(of.get_program()).args(of.get_args());
        command
    };
    if !inside(&Command::new("true")).status().is_ok_and(|status| status.success()) {
        eprintln!("SKIPPED: no mount can be made here");
        return;
    }
    for command in that_write(&out) {
        let said = answer(&mut inside(&command));
        said.expect(&format!("{command:?}"), 1, &[out.to_str().expect("UTF-8")]);
        assert_eq!(names(&out), ["earlier"], "{command:?}");
    }
}

//! Commands that are killed at any moment, or kept from their folder: a result is the old one or the new one, whole.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use armcal::stats::stream_rng;
use rand::RngExt;

use super::{names, reference};
use crate::support::{answer, calibrate, program, read, robot_folder, shared_run, temp};

/// A command that writes into `out`, and what it leaves there, the one that vouches for the others last.
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
        leaves: &["calibration.covariance.toml", "calibration.toml", "summary.json"],
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

/// What the wall clock says is in the summary alone.
fn without_times(text: &str) -> String {
    text.lines().filter(|line| !line.contains("wall_s")).collect()
}

fn results(out: &Path, case: &Case) -> Vec<Option<String>> {
    let text = |name: &&str| fs::read(out.join(name)).ok().map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    case.leaves.iter().map(text).map(|text| text.map(|text| without_times(&text))).collect()
}

/// kill -9 at random moments, reading, working, writing and renaming: `ARMCAL_KILLS` of each.
#[test]
fn a_killed_command_leaves_old_results_or_new_ones() {
    let kills: u32 = std::env::var("ARMCAL_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(3);
    let mut rng = stream_rng(2, "kills");
    for case in &CASES {
        let folder = temp();
        let out = folder.path().to_owned();
        whole(&mut (case.command)(&out));
        let began = Instant::now();
        whole(&mut (case.command)(&out));
        let (took, new) = (began.elapsed(), results(&out, case));
        let (mut n_old, mut n_new) = (0, 0);
        for kill in 0..kills {
            for name in case.leaves {
                fs::write(out.join(name), "earlier").expect("written");
            }
            let mut child = (case.command)(&out).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("started");
            // Two of three near the end, where files are put in place.
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
fn of_two_calibrations_into_a_folder_the_second_says_so() {
    let folder = temp();
    let lock = fs::File::create(folder.path().join("armcal.lock")).expect("made");
    lock.lock().expect("locked");
    let recording = shared_run().file("run.mcap");
    calibrate(&recording, &robot_folder(), folder.path()).expect("busy", 1, &["another run or calibration", "--out"]);
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

/// Not after an hour of runs.
#[cfg(target_os = "linux")]
#[test]
fn where_nothing_can_be_written_is_found_before_the_work() {
    let (reference, took) = reference();
    // Nobody can make files there, not even root.
    let nowhere = PathBuf::from("/proc/self/a.csv");
    let baseline = ["regress", "--seeds=1", "--write-baseline"];
    for words in [&baseline[..], &["campaign", "--seeds=1", "--out"]] {
        let began = Instant::now();
        let said = answer(program().args(words).arg(&nowhere).arg(&reference.routine));
        said.expect(words[0], 1, &["/proc/self"]);
        assert!(began.elapsed() < took.mul_f64(0.5), "{words:?}");
    }
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

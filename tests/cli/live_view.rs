//! `--live`: a viewer that is absent or stuck does not change a run.

use std::net::TcpListener;

use crate::determinism::elsewhere;
use crate::support::{answer, program, robot_folder, shared_run, temp};

/// Address of a loopback port without a listener.
fn closed_address() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.local_addr().expect("an address").to_string()
}

#[test]
fn a_run_without_a_viewer_and_one_with_a_stuck_viewer_give_the_same_recording() {
    let absent = elsewhere();
    let note = format!(" {}", absent.viewer);
    assert_eq!(absent.said.stderr.matches(&note).count(), 1, "{}", absent.said.stderr);

    // This viewer accepts the connection and reads nothing.
    let out = temp();
    let stuck = TcpListener::bind("127.0.0.1:0").expect("a port");
    let live = format!("--live={}", stuck.local_addr().expect("an address"));
    let held = std::thread::spawn(move || stuck.accept().map(|(stream, _)| stream));
    let said = answer(program().arg("run").arg(&shared_run().routine).args([&live, "--out"]).arg(out.path()));
    said.expect("a stuck viewer", 0, &["ACCEPTED"]);
    assert!(said.stderr.contains("slow"), "{}", said.stderr);
    drop(held);

    for name in ["run.mcap", "truth.mcap", "run.rrd", "calibration.toml"] {
        let alone = shared_run().bytes(name);
        for folder in [&absent.out, out.path()] {
            let shown = std::fs::read(folder.join(name)).expect("it reads");
            assert!(shown == alone, "{}: {name} differs", folder.display());
        }
    }
}

#[test]
fn a_replay_into_a_viewer_that_is_not_there_says_what_to_do() {
    let recording = shared_run().file("run.mcap");
    let address = closed_address();
    let live = format!("--live={address}");
    let said = answer(program().arg("replay").arg(&recording).arg(&live));
    said.expect("no viewer", 1, &[]);
    assert!(said.stderr.contains(&address) && said.stderr.contains("[viewer_missing]"), "{}", said.stderr);
    let both = answer(program().arg("replay").arg(&recording).args([&live, "--save", "x.rrd"]));
    both.expect("both", 2, &[]);
}

#[test]
fn what_watch_hears_does_not_depend_on_a_viewer() {
    let recording = shared_run().file("run.mcap");
    let watch =
        |live: &[&str]| answer(program().arg("watch").arg(&recording).arg("--robot").arg(robot_folder()).args(live));
    let (alone, absent) = (watch(&[]), watch(&[&format!("--live={}", closed_address())]));
    assert_eq!(alone.stdout, absent.stdout);
    assert!(absent.stderr.contains("--live"), "{}", absent.stderr);
    let wrong = watch(&["--live=nowhere"]);
    wrong.expect("no address", 2, &[]);
    assert!(wrong.stderr.contains("HOST:PORT"), "{}", wrong.stderr);
}

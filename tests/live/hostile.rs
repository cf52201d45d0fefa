//! Malicious peers and servers: each costs at most its budget, or ends the program with the cause.

use std::process::Command;

use crate::support::{answer, read, root, temp};

/// Figures of an attack.
#[derive(Debug)]
struct Row {
    name: String,
    peak_mb: f64,
    exit_code: String,
    within: String,
    said: String,
}

/// Rows of a script's table, for the attacks with one of `names` in theirs.
fn attacked(script: &str, names: &[&str]) -> Vec<Row> {
    let out = temp();
    let file = out.path().join("table.csv");
    let mut command = Command::new("python3");
    command.arg(root().join("benches/hostile").join(script)).arg(env!("CARGO_BIN_EXE_armcal")).arg(&file).args(names);
    let told = answer(&mut command);
    assert!(file.is_file() && told.code != 2, "user namespaces are needed: {}", told.stderr);
    let table = read(&file);
    let (head, rows) = table.split_once('\n').expect("a head");
    let head: Vec<&str> = head.trim().split(',').collect();
    let row = |line: &str| {
        let fields: Vec<&str> = line.splitn(head.len(), ',').collect();
        let field = |name: &str| fields[head.iter().position(|own| *own == name).expect(name)].to_owned();
        let peak_mb = field("peak_mb").parse().expect("a number");
        let (exit_code, within, said) = (field("exit_code"), field("within"), field("said"));
        Row { name: fields[0].to_owned(), peak_mb, exit_code, within, said }
    };
    let rows: Vec<Row> = rows.lines().map(row).collect();
    assert_eq!(rows.len(), names.len(), "{rows:?}");
    for row in &rows {
        eprintln!("{}: {row:?}", row.name);
    }
    rows
}

/// The middleware keeps samples and their numbers without limit: the program ends before they fill the memory.
#[test]
#[ignore = "needs user namespaces"]
fn peers_that_make_the_program_grow_end_it_with_the_cause() {
    let names = ["one_fragment_of_2_gb/discover", "one_fragment_of_2_gb/listen", "heartbeats_of_all_numbers/discover"];
    for row in attacked("dds.py", &names) {
        assert!(row.exit_code == "1" && row.said.contains("[arm_connection]"), "{row:?}");
        assert!(row.peak_mb < 1000.0, "{row:?}");
    }
}

/// The stop is sent although the threads for it are busy with a sample of 3 GB, or with endless numbers.
#[test]
#[ignore = "needs user namespaces"]
fn an_arm_in_motion_is_stopped_before_the_program_ends() {
    for row in attacked("dds.py", &["mb_in_motion/drive", "gb_in_motion/drive", "heartbeats_of_all_numbers_in_motion"])
    {
        assert!(row.exit_code == "1" && row.said.contains("[arm_was_stopped]"), "{row:?}");
    }
}

#[test]
#[ignore = "needs user namespaces"]
fn floods_of_a_domain_stay_within_the_budget() {
    let names = [
        "ten_thousand_participants/discover",
        "three_thousand_topics_of_joints/discover",
        "names_of_topics_that_steer_the_terminal/discover",
        "images_of_5_mb/listen",
        "set_points_of_many_points/serve",
    ];
    for row in attacked("dds.py", &names) {
        assert_eq!((row.exit_code.as_str(), row.within.as_str()), ("0", "yes"), "{row:?}");
        assert!(row.peak_mb < 200.0, "{row:?}");
    }
}

#[test]
#[ignore = "needs user namespaces"]
fn readings_stamped_in_the_future_are_refused_with_the_cause() {
    for row in attacked("dds.py", &["stamps_of_tomorrow/listen", "stamps_of_the_future/listen"]) {
        assert!(row.exit_code == "1" && row.within == "yes", "{row:?}");
        assert!(row.said.contains("clock_step_s"), "{row:?}");
    }
}

#[test]
#[ignore = "needs Python"]
fn servers_that_are_no_rosbridge_stay_within_the_budget() {
    for row in
        attacked("rosbridge.py", &["keys_of_many", "topics_that_steer", "complaints_that", "nesting_of_a_million"])
    {
        assert!(row.exit_code == "1" && row.within == "yes" && row.peak_mb < 100.0, "{row:?}");
    }
}

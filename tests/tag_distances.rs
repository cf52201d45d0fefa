//! Distances between tags that robot.toml states, in a calibration by the program.

use crate::support::{Answer, answer, program, read, robot_copy, root, temp, write};

/// Calibrates the sample with these tables at the end of robot.toml.
fn calibrated(tables: &str) -> (Answer, String) {
    let folder = temp();
    let robot = robot_copy(folder.path());
    let file = robot.join("robot.toml");
    write(&file, &format!("{}\n{tables}", read(&file)));
    let out = folder.path().join("out");
    let mut command = program();
    command.arg("calibrate").arg(root().join("recordings/sample/run.mcap")).arg("--robot").arg(&robot);
    let answer = answer(command.arg("--out").arg(&out));
    let result = out.join("calibration.toml");
    (answer, if result.exists() { read(&result) } else { String::new() })
}

fn distance(tags: [u32; 2], distance_m: f64, std_m: f64) -> String {
    format!("[[geometry.tag_distance]]\ntags = {tags:?}\ndistance_m = {distance_m:?}\nstd_m = {std_m:?}\n")
}

fn n_checks(calibration: &str) -> usize {
    let table: toml::Table = calibration.parse().expect("TOML");
    table["verdict"]["checks"].as_array().expect("checks").len()
}

/// Distance between the centres of tags 0 and 3 in robots/titan4, m.
const APART_M: f64 = 1.9078;

#[test]
fn a_distance_that_the_views_confirm_is_a_check_and_one_that_they_contradict_refuses() {
    let (answer, result) = calibrated(&distance([0, 3], APART_M, 0.003));
    answer.expect("as it is", 0, &["ACCEPTED"]);
    assert_eq!(n_checks(&result), n_checks(&calibrated("").1) + 1);
    let (answer, result) = calibrated(&distance([0, 3], APART_M + 0.03, 0.002));
    answer.expect("3 cm more", 4, &["1937.8 mm", "[length_contradicted]"]);
    assert!(!result.is_empty() && !result.contains("tag_moved"), "a tag is blamed for the tape");
    let (answer, _) = calibrated(&distance([0, 99], 0.5, 0.002));
    answer.expect("no such tag", 0, &["[length_unused]"]);
}

#[test]
fn distances_that_cannot_be_meant_are_refused_by_their_key() {
    for (tables, words) in [
        (distance([3, 3], 0.5, 0.002), "[value_invalid]"),
        (distance([0, 3], -0.5, 0.002), "[value_out_of_range]"),
        (distance([0, 3], 0.5, 0.0), "[value_out_of_range]"),
        ("[[geometry.tag_distance]]\ntags = [0, 3]\ndistance_m = 0.5\n".to_owned(), "std_m"),
    ] {
        calibrated(&tables).0.expect(words, 2, &["robot.toml", words]);
    }
}

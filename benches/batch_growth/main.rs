//! Growth of calibrations of an arm and of maps of tags: processor time and memory over views and tags.
//!
//! Run `cargo bench --no-default-features --bench batch_growth > batch-growth.csv`, then
//! `tests/oracle/plot_batch_growth.py batch-growth.csv`. Each figure comes from a process of its own, and the time is
//! the least of a few. `ARMCAL_MOST_VIEWS` omits cases with more views.

#![allow(clippy::print_stdout, reason = "its table is what it is for")]

mod arms;
mod corridor;
mod measure;
#[allow(dead_code, reason = "other benchmarks use the rest")]
#[path = "../problems.rs"]
mod problems;

use std::process::Command;

use measure::Row;

/// Environment variable that names the one measurement of a process.
const CASE: &str = "ARMCAL_GROWTH_CASE";
const MOST_VIEWS: &str = "ARMCAL_MOST_VIEWS";
/// Number of repetitions, where all together take less than `ENOUGH_S`.
const N_REPETITIONS: usize = 5;
const ENOUGH_S: f64 = 30.0;

/// Measurement: name, views, tags.
type Case = (&'static str, usize, usize);

const CASES: [Case; 32] = [
    ("least_squares", 30, 8),
    ("least_squares", 100, 8),
    ("least_squares", 300, 8),
    ("least_squares", 1_000, 8),
    ("least_squares", 3_000, 8),
    ("least_squares", 10_000, 8),
    ("estimate", 30, 8),
    ("estimate", 100, 8),
    ("estimate", 300, 8),
    ("estimate", 1_000, 8),
    ("estimate", 3_000, 8),
    ("estimate", 10_000, 8),
    ("calibrate", 30, 8),
    ("calibrate", 100, 8),
    ("calibrate", 300, 8),
    ("calibrate", 1_000, 8),
    ("calibrate", 3_000, 8),
    ("calibrate", 10_000, 8),
    ("estimate_by_tags", 300, 4),
    ("estimate_by_tags", 300, 8),
    ("estimate_by_tags", 300, 16),
    ("estimate_by_tags", 300, 32),
    ("estimate_by_tags", 300, 64),
    ("estimate_by_tags", 300, 128),
    ("estimate_by_tags", 300, 256),
    ("tag_map", 200, 10),
    ("tag_map", 600, 30),
    ("tag_map", 2_000, 100),
    ("tag_map", 6_000, 300),
    ("tag_map", 12_000, 600),
    ("tag_map", 20_000, 1_000),
    ("tag_map_20_seeds", 2_000, 100),
];

fn main() {
    if let Ok(case) = std::env::var(CASE) {
        let parts: Vec<&str> = case.split(' ').collect();
        let [name, n_views, n_tags] = parts[..] else { panic!("{CASE}: not understood: {case}") };
        let count = |text: &str| text.parse().unwrap_or_else(|_| panic!("{CASE}: not a number: {text}"));
        println!("{}", row(name, count(n_views), count(n_tags)).text());
        return;
    }
    let most = std::env::var(MOST_VIEWS).ok().and_then(|text| text.parse().ok()).unwrap_or(usize::MAX);
    println!(
        "what,views,tags,detections,steps,cpu_s,memory_mb,along_mm,along_std_mm,across_mm,across_std_mm,distance2"
    );
    for (name, n_views, n_tags) in CASES.into_iter().filter(|(_, n_views, _)| *n_views <= most) {
        println!("{name},{n_views},{n_tags},{}", least(name, n_views, n_tags));
    }
}

fn row(name: &str, n_views: usize, n_tags: usize) -> Row {
    match name {
        "least_squares" => arms::solved(n_views, n_tags),
        "estimate" | "estimate_by_tags" => arms::estimated(n_views, n_tags),
        "calibrate" => arms::calibrated(n_views, n_tags),
        "tag_map" => corridor::mapped(n_views, n_tags),
        "tag_map_20_seeds" => corridor::mapped_over_seeds(n_views, n_tags),
        _ => panic!("no measurement is called {name}"),
    }
}

/// The row of the fastest repetition.
fn least(name: &str, n_views: usize, n_tags: usize) -> String {
    let program = std::env::current_exe().expect("this program has a path");
    let mut best: Option<(f64, String)> = None;
    let mut spent_s = 0.0;
    for _ in 0..N_REPETITIONS {
        let output = Command::new(&program).env(CASE, format!("{name} {n_views} {n_tags}")).output();
        let output = output.expect("this program can be started again");
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{name}, {n_views} views, {n_tags} tags: {told}");
        let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        let cpu_s: f64 = text.split(',').nth(2).and_then(|word| word.parse().ok()).expect("a time");
        spent_s += cpu_s;
        if best.as_ref().is_none_or(|(least, _)| cpu_s < *least) {
            best = Some((cpu_s, text));
        }
        if spent_s > ENOUGH_S {
            break;
        }
    }
    best.expect("a case is measured at least once").1
}

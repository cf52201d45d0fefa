//! The study's claims on its small tier.

use std::path::Path;
use std::sync::LazyLock;

use crate::minimum_variance::Gauge;
use crate::study::*;
use armcal_core::robot::{Robot, load};

fn titan() -> Robot {
    load(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4")).expect("the robot reads")
}

fn of_name(name: &str) -> Experiment {
    experiments(Tier::Small).into_iter().find(|e| e.name == name).expect("an experiment")
}

fn rows_on(threads: usize, name: &str) -> Vec<PaperRow> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| run_experiment(&titan(), &of_name(name), 1).expect("rows"))
}

static NO_NOISE: LazyLock<Vec<PaperRow>> = LazyLock::new(|| rows_on(3, "no noise"));
static NOISE: LazyLock<Vec<PaperRow>> = LazyLock::new(|| rows_on(3, "noise"));
static FROM_THE_TRUTH: LazyLock<Vec<PaperRow>> = LazyLock::new(|| rows_on(3, "from the truth"));

fn row<'a>(rows: &'a [PaperRow], contender: &str, is_it: impl Fn(&Setting) -> bool) -> &'a PaperRow {
    rows.iter().find(|row| row.contender == contender && is_it(&row.setting)).expect("a row")
}

#[test]
fn without_noise_all_find_the_tool_but_minimum_variance_with_its_gauge_free() {
    let rows = &*NO_NOISE;
    let exact = |setting: &Setting| setting.readings == Readings::Exact;
    let [free, fixed] = [Gauge::Free, Gauge::Fixed].map(|gauge| MethodVariant::minimum_variance(gauge).name);
    for name in [MethodVariant::minimum_distance().name, MethodVariant::least_squares().name, fixed] {
        let found = row(rows, name, exact);
        assert!(found.tool_p95_m < 1e-5 && found.converged == found.draws, "{found:?}");
    }
    let free = row(rows, free, exact);
    assert!((0.02..0.11).contains(&free.tool_median_m), "{free:?}");
    // Half a count is 0.2 mrad.
    let counts = row(rows, MethodVariant::minimum_distance().name, |s| s.readings == Readings::WholeCounts);
    assert!((1e-5..1e-3).contains(&counts.tool_rms_m), "{counts:?}");
}

#[test]
fn at_one_centimetre_minimum_distance_is_near_least_squares_and_that_at_the_bound() {
    let rows = &*NOISE;
    let at_1_cm = |setting: &Setting| setting.noise_m == 0.01;
    let squares = row(rows, MethodVariant::least_squares().name, at_1_cm);
    let distance = row(rows, MethodVariant::minimum_distance().name, at_1_cm);
    let bound_m = squares.bound_rms_m.expect("noise");
    assert!((0.7..1.35).contains(&(squares.tool_rms_m / bound_m)), "{squares:?}");
    assert!(distance.over_least_squares.expect("paired") < 1.25, "{distance:?}");
    assert!(distance.tool_rms_m < 0.003, "{distance:?}");
    let bundle = row(rows, MethodVariant::bundle().name, at_1_cm);
    assert!((0.8..1.2).contains(&bundle.over_least_squares.expect("paired")), "{bundle:?}");
    let free = row(rows, MethodVariant::minimum_variance(Gauge::Free).name, at_1_cm);
    assert!(free.tool_rms_m > 10.0 * distance.tool_rms_m, "{free:?}");
    let fixed = row(rows, MethodVariant::minimum_variance(Gauge::Fixed).name, at_1_cm);
    assert!(fixed.tool_rms_m < 3.0 * distance.tool_rms_m, "{fixed:?}");
    // Errors grow with the noise.
    let [low, high] = [0.001, 0.03].map(|noise| row(rows, distance.contender, |s| s.noise_m == noise).tool_rms_m);
    assert!((15.0..60.0).contains(&(high / low)), "{low} {high}");
}

/// Figure 3, right: a search from the truth ends at less spread and a worse tool.
#[test]
fn from_the_truth_minimum_variance_finds_less_spread_and_a_worse_tool() {
    let rows = &*FROM_THE_TRUTH;
    for gauge in [Gauge::Free, Gauge::Fixed] {
        let found = row(rows, MethodVariant::minimum_variance(gauge).name, |_| true);
        assert!(found.cost_final_median < found.cost_initial_median && found.tool_median_m > 5e-4, "{found:?}");
    }
}

#[test]
fn raw_units_end_far_from_the_minimum() {
    let rows = &rows_on(3, "preconditioning");
    let exact = |setting: &Setting| setting.noise_m == 0.0;
    let scaled = row(rows, MethodVariant::minimum_distance().name, exact);
    let raw = row(rows, "minimum distance, raw units", exact);
    assert!(raw.evaluations_median > 5.0 * scaled.evaluations_median, "{raw:?}");
    assert!(raw.tool_median_m > 1e3 * scaled.tool_median_m, "{raw:?}");
}

#[test]
fn tables_are_the_same_on_any_number_of_threads_and_show_every_row() {
    let names = ["no noise", "from the truth"];
    let experiments = names.map(of_name);
    let written = |rows: &[PaperRow]| (paper_markdown(&experiments, rows), paper_csv(rows));
    let on_three = written(&[&NO_NOISE[..], &FROM_THE_TRUTH[..]].concat());
    assert_eq!(written(&names.map(|name| rows_on(1, name)).concat()), on_three);
    let (markdown, csv) = on_three;
    assert_eq!(csv.lines().count(), 1 + 10 + 5);
    assert_eq!(markdown.matches("| minimum distance |").count(), 3);
}

#[test]
fn figures_are_small_and_whole() {
    let rows = &*NOISE;
    for (name, text) in paper_figures(&titan(), rows, 1).expect("figures") {
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"), "{name}");
        assert!((2_000..60_000).contains(&text.len()), "{name}: {} bytes", text.len());
    }
}

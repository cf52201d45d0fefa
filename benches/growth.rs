//! Cost of one more view after many: processor time and memory of the online estimate over a hundred thousand views.
//!
//! Run `cargo bench --bench growth > growth.csv`, then `tests/oracle/plot_growth.py growth.csv`; `ARMCAL_VIEWS` sets
//! the number of views. The views are those of the sample, one a minute, repeated, with the thermometer's readings
//! between them. Drift, lags and comparisons of lags are active as in any dive.
//! drift, lags and races at work as in any dive.

#![allow(clippy::print_stdout, reason = "its table is what it is for")]

use std::path::Path;

use armcal::calib::online::{OnlineEstimator, OnlineSettings, ViewStream};
use armcal::calib::{TagMeasurement, View};
use armcal::log::read_recording;
use armcal::robot::load;
use armcal::stats::stream_rng;
use rand::RngExt;

const N_VIEWS: usize = 100_000;
/// Number of rows of the table.
const N_ROWS: usize = 200;
const VIEW_EVERY_S: f64 = 60.0;
const READINGS_PER_VIEW: usize = 6;
const CORNER_NOISE_PX: f64 = 0.15;

fn main() {
    let n_views = std::env::var("ARMCAL_VIEWS").ok().and_then(|text| text.parse().ok()).unwrap_or(N_VIEWS);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let robot = load(&root.join("robots/titan4")).expect("the robot is part of the repository");
    let recording =
        read_recording(root.join("recordings/sample/run.mcap")).expect("the sample is part of the repository");
    let mut stream = ViewStream::new(robot.clone());
    let mut views: Vec<View> = recording.messages.iter().flat_map(|(at, message)| stream.push(*at, message)).collect();
    views.extend(stream.finish());
    let mut estimator = OnlineEstimator::new(robot, OnlineSettings::default());
    let mut rng = stream_rng(1, "growth");
    let start = views[0].end;
    let per_row = n_views.div_ceil(N_ROWS).max(1);
    let mut started_s = processor_s();
    println!("views,ms_a_view,memory_mb,events");
    let mut n_events = 0;
    for k in 0..n_views {
        let at_s = k as f64 * VIEW_EVERY_S;
        for reading in 0..READINGS_PER_VIEW {
            let stamp = start.plus_s(at_s - VIEW_EVERY_S * (1.0 - reading as f64 / READINGS_PER_VIEW as f64));
            estimator.hear_temperature(stamp, oil_c(at_s));
        }
        let mut view = views[k % views.len()].clone();
        view.end = start.plus_s(at_s);
        (view.conditions.stamp, view.conditions.oil_c) = (Some(view.end), Some(oil_c(at_s)));
        for tag in &mut view.tags {
            if let TagMeasurement::Corners(seen) = &mut tag.measured {
                for px in seen.corners_px.as_flattened_mut() {
                    *px += rng.random_range(-CORNER_NOISE_PX..CORNER_NOISE_PX);
                }
            }
        }
        estimator.add_view(&view);
        n_events += estimator.take_events().len();
        if (k + 1) % per_row == 0 {
            let ms = 1e3 * (processor_s() - started_s) / per_row as f64;
            println!("{},{ms:.4},{:.2},{n_events}", k + 1, memory_mb());
            started_s = processor_s();
        }
    }
}

/// Temperature of the oil, degC, with a daily swing of 4 K.
fn oil_c(at_s: f64) -> f64 {
    25.0 + 2.0 * (at_s / 86_400.0 * std::f64::consts::TAU).sin()
}

/// Processor time of this process so far, s, which does not depend on other programs; NaN where the system does not
/// report it.
fn processor_s() -> f64 {
    let text = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    let nanos: Option<f64> = text.split_whitespace().next().and_then(|word| word.parse().ok());
    nanos.map_or(f64::NAN, |nanos| 1e-9 * nanos)
}

/// Resident memory, MB; NaN where the system does not report it.
fn memory_mb() -> f64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages: Option<f64> = text.split_whitespace().nth(1).and_then(|word| word.parse().ok());
    pages.map_or(f64::NAN, |pages| pages * 4096.0 / 1e6)
}

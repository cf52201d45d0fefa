//! The study's rows, table and chart.

use std::fmt::Write as _;

use crate::poses::study::{CRITERIA, POSES, PoseRow};
use armcal_charts::{Axis, Panel, Series, Style, svg};
use armcal_core::routine::PoseCriterion;
use armcal_core::stats::quantile;

/// Tool errors whose cost in poses and time the table gives, m.
const TOLERANCES_M: [f64; 4] = [0.004, 0.003, 0.0025, 0.002];

fn name(criterion: PoseCriterion) -> &'static str {
    match criterion {
        PoseCriterion::ToolError => "tool error",
        PoseCriterion::DOptimal => "D-optimal",
        PoseCriterion::AOptimal => "A-optimal",
        PoseCriterion::EOptimal => "E-optimal",
        PoseCriterion::Random => "random",
    }
}

/// CSV with one line per estimate; lengths in mm.
#[must_use]
pub fn poses_csv(rows: &[PoseRow]) -> String {
    let mut out = String::from("seed,criterion,poses,views,true_mm,by_bundle_mm,planned_mm,arm_time_s\n");
    for row in rows {
        let mm = [row.true_m, row.by_bundle_m, row.planned_m].map(|m| format!("{:.4}", 1e3 * m)).join(",");
        let PoseRow { seed, criterion, poses, views, arm_time_s, .. } = row;
        let _ = writeln!(out, "{seed},{},{poses},{views},{mm},{arm_time_s:.1}", name(*criterion));
    }
    out
}

fn of(rows: &[PoseRow], criterion: PoseCriterion, poses: usize) -> impl Iterator<Item = &PoseRow> {
    rows.iter().filter(move |row| row.criterion == criterion && row.poses == poses)
}

fn quantile_of(rows: &[PoseRow], criterion: PoseCriterion, poses: usize, q: f64, f: fn(&PoseRow) -> f64) -> f64 {
    quantile(&of(rows, criterion, poses).map(f).collect::<Vec<_>>(), q).unwrap_or(f64::NAN)
}

/// Number of poses and arm time (s) at which the median of the true error falls to `limit_m`, interpolated linearly
/// between numbers of poses; `None` where it does not.
fn cost(rows: &[PoseRow], criterion: PoseCriterion, limit_m: f64) -> Option<[f64; 2]> {
    let at = |poses: usize| {
        let median = |f: fn(&PoseRow) -> f64| quantile_of(rows, criterion, poses, 0.5, f);
        (median(|row| row.true_m), [poses as f64, median(|row| row.arm_time_s)])
    };
    let mut before: Option<(f64, [f64; 2])> = None;
    for poses in POSES {
        let (error_m, cost) = at(poses);
        if error_m <= limit_m {
            let Some((error_before_m, cost_before)) = before else { return Some(cost) };
            let share = (error_before_m - limit_m) / (error_before_m - error_m).max(f64::MIN_POSITIVE);
            return Some([0, 1].map(|k| cost_before[k] + share * (cost[k] - cost_before[k])));
        }
        before = Some((error_m, cost));
    }
    None
}

/// Table of errors by number of poses with their predictions, and of the cost of each tolerance.
#[must_use]
pub fn poses_table(rows: &[PoseRow]) -> String {
    let seeds = of(rows, PoseCriterion::Random, POSES[0]).count();
    let mut out = format!("true tool error, mm, median and 95 % over {seeds} seeds\n\n| poses |");
    for criterion in CRITERIA {
        let _ = write!(out, " {} |", name(criterion));
    }
    let _ = writeln!(out, "\n|--:|{}", "--:|".repeat(CRITERIA.len()));
    for poses in POSES {
        let _ = write!(out, "| {poses} |");
        for criterion in CRITERIA {
            let mm = |q: f64| 1e3 * quantile_of(rows, criterion, poses, q, |row| row.true_m);
            let _ = write!(out, " {:.2} / {:.2} |", mm(0.5), mm(0.95));
        }
        out.push('\n');
    }
    let _ = writeln!(
        out,
        "\npredicted over true, root mean squares over seeds: by the plan, by bundle\n\n\
         | poses | tool error | random |\n|--:|--:|--:|"
    );
    for poses in POSES {
        let ratio = |criterion: PoseCriterion, f: fn(&PoseRow) -> f64| {
            let sum = |f: fn(&PoseRow) -> f64| of(rows, criterion, poses).map(|row| f(row).powi(2)).sum::<f64>();
            (sum(f) / sum(|row| row.true_m)).sqrt()
        };
        let both = |criterion| {
            let (plan, bundle) = (ratio(criterion, |row| row.planned_m), ratio(criterion, |row| row.by_bundle_m));
            format!("{plan:.2}, {bundle:.2}")
        };
        let _ = writeln!(out, "| {poses} | {} | {} |", both(PoseCriterion::ToolError), both(PoseCriterion::Random));
    }
    out.push_str("\nposes and time of the arm to a median error of\n\n| criterion |");
    for limit_m in TOLERANCES_M {
        let _ = write!(out, " {:.1} mm |", 1e3 * limit_m);
    }
    let _ = writeln!(out, "\n|---|{}", "--:|".repeat(TOLERANCES_M.len()));
    for criterion in CRITERIA {
        let _ = write!(out, "| {} |", name(criterion));
        for limit_m in TOLERANCES_M {
            let _ = match (cost(rows, criterion, limit_m), cost(rows, PoseCriterion::Random, limit_m)) {
                (None, _) => write!(out, " not reached |"),
                (Some([n, s]), Some([n_random, s_random])) => {
                    write!(out, " {n:.1}, {s:.0} s ({:.2}, {:.2}) |", n / n_random, s / s_random)
                }
                (Some([n, s]), None) => write!(out, " {n:.1}, {s:.0} s |"),
            };
        }
        out.push('\n');
    }
    out.push_str("\nin brackets: over random's\n");
    out
}

/// Chart of the median true error over the number of poses and over the arm's time.
///
/// # Errors
/// Errors of the drawing library.
pub fn poses_figure(rows: &[PoseRow]) -> Result<String, String> {
    let series = |x: fn(&PoseRow) -> f64| -> Vec<Series> {
        let of_criterion = |criterion: &PoseCriterion| Series {
            name: name(*criterion).to_owned(),
            color: None,
            style: if *criterion == PoseCriterion::Random { Style::Dashes } else { Style::Line },
            points: POSES
                .iter()
                .map(|&poses| {
                    let median = |f: fn(&PoseRow) -> f64| quantile_of(rows, *criterion, poses, 0.5, f);
                    [median(x), 1e3 * median(|row| row.true_m)]
                })
                .collect(),
        };
        CRITERIA.iter().map(of_criterion).collect()
    };
    let panel = |title: &str, x: &str, series: Vec<Series>| Panel {
        title: title.to_owned(),
        x: (x.to_owned(), Axis::Linear),
        y: ("true tool error, mm, median".to_owned(), Axis::Log),
        is_map: false,
        series,
    };
    svg(&[
        panel("Tool error by poses", "poses", series(|row| row.poses as f64)),
        panel("Tool error by time of the arm", "time of the arm, s", series(|row| row.arm_time_s)),
    ])
}

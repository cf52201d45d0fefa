//! The online estimate: its lines of the table, and its curve over time in report.html.

use maud::{Markup, html as markup};

use crate::report::summary::{OnlineSummary, RunSummary};
use armcal_belief::calib::online::{BeliefLog, BeliefRow};
use armcal_core::stats::quantile;
use armcal_core::units::Unit;

/// Width of the curve's picture, in its own units.
const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 180.0;
const LEFT: f64 = 60.0;
/// Upper limit of the error scale, m: a joint whose sensor failed leaves the tool unknown for a while.
const TOP_M: f64 = 0.02;

/// Lines of the closing table.
pub(super) fn online_lines(summary: &RunSummary) -> Vec<String> {
    let Some(online) = &summary.online else { return Vec::new() };
    let OnlineSummary { views, tool_error_m: now, tool_error_in_an_hour_m: later, .. } = online;
    let health = match online.is_good_enough {
        Some(false) => "NOT good enough for the task",
        Some(true) => "good enough for the task",
        None => "no limit is named",
    };
    let mut lines = vec![format!(
        "online       {views} views; tool error {} median, {} worst over the targets now, {} worst in an hour without \
         views: {health}",
        Unit::Metres.shown(now.median, 1),
        Unit::Metres.shown(now.max, 1),
        Unit::Metres.shown(later.max, 1),
    )];
    let errors: Vec<f64> = summary.score.iter().flat_map(|score| &score.work).map(|task| task.tool_error_m).collect();
    if let (Some(median), Some(p95)) = (quantile(&errors, 0.5), quantile(&errors, 0.95)) {
        let (median, p95) = (Unit::Metres.shown(median, 1), Unit::Metres.shown(p95, 1));
        lines.push(format!("tasks        {}: tool error {median} median, {p95} 95 % (simulated truth)", errors.len()));
    }
    let (n_poses, arm_time_s) =
        online.asked.iter().fold((0, 0.0), |(n, s), asked| (n + asked.views, s + asked.arm_time_s));
    lines.push(match online.asked.len() {
        0 => "asked        for no calibration pose".to_owned(),
        times => {
            format!("asked        {times} times for calibration poses: {n_poses} in {arm_time_s:.0} s of arm time")
        }
    });
    lines.extend(online.events.iter().map(|event| format!("event        {}", event.to_line())));
    lines
}

/// Curve of the tool error over time; empty if the log holds no online estimate.
pub(super) fn online_section(log: &BeliefLog, summary: &RunSummary) -> Markup {
    let rows: Vec<&BeliefRow> = log.beliefs().collect();
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return Markup::default() };
    let hours = |nanos: i64| (nanos - first.stamp_nanos) as f64 / 3.6e12;
    let end_h = hours(last.stamp_nanos).max(1e-3);
    let tasks = summary.score.iter().flat_map(|score| &score.work);
    let errors: Vec<[f64; 2]> = tasks.map(|task| [task.time_s / 3600.0, task.tool_error_m]).collect();
    let predicted = || rows.iter().map(|row| row.tool_error_m.median);
    let top_m = predicted().chain(errors.iter().map(|[_, error_m]| *error_m)).fold(0.001, f64::max).min(TOP_M);
    let x = |h: f64| LEFT + (WIDTH - LEFT) * (h / end_h).clamp(0.0, 1.0);
    let y = |error_m: f64| 10.0 + (HEIGHT - 10.0) * (1.0 - (error_m / top_m).min(1.0));
    let points: Vec<String> =
        rows.iter().map(|row| format!("{:.1},{:.1}", x(hours(row.stamp_nanos)), y(row.tool_error_m.median))).collect();
    markup! {
        h2 { "Tool error over time" }
        svg viewBox=(format!("0 0 {} {}", WIDTH + 30.0, HEIGHT + 30.0)) role="img" aria-label="tool error over time" {
            @for share in [0.0, 0.5, 1.0] {
                @let level = y(share * top_m);
                line x1=(LEFT) x2=(WIDTH) y1=(level) y2=(level) stroke="#d5dce3" { }
                text x="0" y=(level + 4.0) font-size="11" fill="#5b6b79" { (Unit::Metres.shown(share * top_m, 1)) }
            }
            @for share in [0.0, 0.5, 1.0] {
                text x=(x(share * end_h)) y=(HEIGHT + 18.0) font-size="11" text-anchor="middle" fill="#5b6b79" {
                    (format!("{:.1} h", share * end_h))
                }
            }
            @for event in log.events() {
                @let at = x(hours(event.since_nanos));
                line x1=(at) x2=(at) y1="10" y2=(HEIGHT) stroke="#b3261e" stroke-dasharray="4 3" {
                    title { (event.to_line()) }
                }
            }
            @for asked in summary.online.iter().flat_map(|online| &online.asked) {
                @let at = x(asked.time_s / 3600.0);
                line x1=(at) x2=(at) y1=(HEIGHT - 12.0) y2=(HEIGHT) stroke="#0a7d38" stroke-width="3" { }
            }
            polyline points=(points.join(" ")) fill="none" stroke="#2a7f9e" stroke-width="2" { }
            @for [at_h, error_m] in &errors {
                circle cx=(x(*at_h)) cy=(y(*error_m)) r="3" fill="#c0603a" { }
            }
        }
        p { small {
            "Line: expected error of the tool, one sigma, median over the targets. Dots: true error at the tasks. "
            "Dashed: what happened. Green: calibration poses that were asked for."
        } }
        @if log.events().next().is_some() {
            table.notes {
                @for event in log.events() {
                    tr { td { (log.clock(event.since_nanos)) } td { (event.to_line()) } }
                }
            }
        }
    }
}

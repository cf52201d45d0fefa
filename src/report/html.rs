//! report.html: one file, no network, no scripts.

use maud::{DOCTYPE, Markup, html as markup};

use crate::report::online::online_section;
use crate::report::summary::RunSummary;
use crate::report::table::{check_lines, labelled, score_rows};
use crate::score::Score;
use armcal_belief::calib::online::BeliefLog;
use armcal_belief::calib::{Calibration, Status};

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:60em;margin:2em auto;\
    padding:0 1em;color:#1b2733}\
table{border-collapse:collapse;margin:1em 0}td,th{padding:.3em .9em;border-bottom:1px solid #d5dce3;text-align:right}\
td:first-child,th:first-child{text-align:left}.ok{color:#0a7d38}.no{color:#b3261e}svg{width:100%;height:auto}\
.notes td{text-align:left;vertical-align:top}small{color:#5b6b79}";

/// Renders the report.
#[must_use]
pub fn html(summary: &RunSummary, calibration: &Calibration, online: Option<&BeliefLog>) -> String {
    let title = match &summary.routine {
        Some(routine) => format!("{routine} on {}", summary.robot),
        None => summary.robot.clone(),
    };
    let (class, verdict) = match summary.status {
        Status::Accepted => ("ok", "accepted"),
        Status::Refused => ("no", "refused"),
    };
    markup! {
        (DOCTYPE)
        html lang="en" {
            head { meta charset="utf-8"; title { "armcal: " (title) } style { (STYLE) } }
            body {
                h1 { (title) ": calibration " span class=(class) { (verdict) } }
                @if let Some(seed) = summary.seed { p { small { "seed " (seed) ", method " (summary.method) } } }
                @if let Some(score) = &summary.score { (score_section(score)) }
                h2 { "How it went" }
                table.notes {
                    @for (label, text) in check_lines(summary).iter().map(|line| labelled(line)) {
                        tr { td { (label) } td { (text) } }
                    }
                }
                @if let Some(log) = online { (online_section(log, summary)) }
                (joint_section(calibration))
            }
        }
    }
    .into_string()
}

fn score_section(score: &Score) -> Markup {
    markup! {
        h2 { "Reach task, against the truth" }
        table {
            tr { th { } th { "before" } th { "after" } th { } }
            @for row in score_rows(&score.before, score.after.as_ref()) {
                tr { @for cell in row { td { (cell) } } }
            }
        }
        (bars(score))
    }
}

/// Median, 95 % and worst tool error before and after, on a logarithmic scale.
fn bars(score: &Score) -> Markup {
    let sides = [("before", Some(&score.before), "#c0603a"), ("after", score.after.as_ref(), "#2a7f9e")];
    let x = |mm: f64| 90.0 + 540.0 * ((mm.max(0.1) / 0.1).log10() / 4.0).min(1.0);
    markup! {
        svg viewBox="0 0 680 120" role="img" aria-label="tool error before and after" {
            @for (k, (name, side, color)) in sides.iter().enumerate() {
                @if let Some(error) = side.and_then(|s| s.tool_error_m) {
                    @let y = 18 + 36 * k;
                    text x="0" y=(y + 14) font-size="13" { (name) }
                    rect x="90" y=(y) width=(x(error.median * 1e3) - 90.0) height="18" fill=(color) { }
                    @let [median, max] = [x(error.median * 1e3), x(error.max * 1e3)];
                    line x1=(median) x2=(max) y1=(y + 9) y2=(y + 9) stroke=(color) stroke-width="2" { }
                    circle cx=(x(error.p95 * 1e3)) cy=(y + 9) r="4" fill=(color) { }
                }
            }
            @for mm in [0.1, 1.0, 10.0, 100.0, 1000.0] {
                line x1=(x(mm)) x2=(x(mm)) y1="10" y2="92" stroke="#d5dce3" { }
                text x=(x(mm)) y="108" font-size="11" text-anchor="middle" fill="#5b6b79" { (mm) " mm" }
            }
        }
        p { small { "Bar: median over the targets; dot: 95th percentile; line: worst." } }
    }
}

fn joint_section(calibration: &Calibration) -> Markup {
    let percent = |value: f64| format!("{:+.2}", value * 100.0);
    markup! {
        h2 { "Joint sensors" }
        table {
            tr {
                th { "joint" } th { "gain, rad/count" } th { "1 sigma, %" }
                th { "offset, deg" } th { "1 sigma, deg" } th { "covered, deg" }
            }
            @for joint in &calibration.joint {
                tr {
                    td {
                        (joint.name)
                        @if !joint.gain_estimated && !joint.offset_estimated { " " small { "(not calibrated)" } }
                    }
                    td { (format!("{:.8}", joint.gain_rad_per_count)) }
                    @let gain_std = joint.gain_std_rad_per_count / joint.gain_rad_per_count.abs();
                    td { (percent(gain_std).trim_start_matches('+')) }
                    td { (format!("{:+.3}", joint.offset_rad.to_degrees())) }
                    td { (format!("{:.3}", joint.offset_std_rad.to_degrees())) }
                    @let [from_deg, to_deg] = joint.covered_rad.map(f64::to_degrees);
                    td { (format!("{from_deg:.0} .. {to_deg:.0}")) }
                }
            }
        }
        p { small { "Rests on messages " (calibration.messages_hash) } }
    }
}

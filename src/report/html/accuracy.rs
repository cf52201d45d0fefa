//! Tool accuracy: target by target, over the reach task, and against the number of views.

use std::collections::BTreeMap;

use armcal_charts::{Axis, Color, Panel, Style};
use maud::{Markup, html as markup};

use super::Report;
use super::figure::{figure, panel, series};
use crate::report::table::{risk_in_words, score_rows};
use crate::score::{Score, TargetScore};
use armcal_belief::calib::Status;
use armcal_belief::judge::TargetU95;
use armcal_core::units::Unit;

pub(super) fn section(report: &Report<'_>) -> Markup {
    let score = report.summary.score.as_ref();
    let targets = targets(report);
    markup! {
        @if score.is_some() || !targets.is_empty() { h2 { "Tool accuracy" } }
        @if let Some(score) = score { (reach_task(score)) }
        div.figures {
            @if !targets.is_empty() { (target_chart(&targets)) }
            (growth(report))
        }
        @if !targets.is_empty() { (target_table(&targets)) }
    }
}

fn reach_task(score: &Score) -> Markup {
    markup! {
        div.wide {
            table {
                tr { th { "reach task, simulated truth" } th { "before" } th { "after" } th { "ratio" } }
                @for row in score_rows(&score.before, score.after.as_ref()) {
                    tr { @for cell in row { td { (cell) } } }
                }
            }
        }
    }
}

/// All figures of one target.
#[derive(Clone, Copy, Default)]
struct Target<'a> {
    truth: Option<&'a TargetScore>,
    u95: Option<&'a TargetU95>,
}

impl<'a> Target<'a> {
    fn before_m(self) -> Option<f64> {
        self.truth?.tool_error_before_m
    }

    fn after_m(self) -> Option<f64> {
        self.truth?.tool_error_after_m
    }

    fn risk(self) -> Option<f64> {
        self.u95?.p_beyond_tolerance
    }

    fn u95_m(self) -> Option<f64> {
        self.u95?.u95_m
    }
}

/// Targets by their number, from 1.
fn targets<'a>(report: &'a Report<'_>) -> BTreeMap<usize, Target<'a>> {
    let mut all: BTreeMap<usize, Target<'a>> = BTreeMap::new();
    for truth in report.summary.score.iter().flat_map(|score| &score.targets) {
        all.entry(truth.target + 1).or_default().truth = Some(truth);
    }
    let stated = report.summary.status == Status::Accepted;
    for u95 in report.calibration.u95.target.iter().filter(|_| stated) {
        all.entry(u95.index + 1).or_default().u95 = Some(u95);
    }
    all
}

fn target_chart<'a>(targets: &BTreeMap<usize, Target<'a>>) -> Markup {
    let points = |of: fn(Target<'a>) -> Option<f64>| -> Vec<[f64; 2]> {
        targets.iter().filter_map(|(number, target)| Some([*number as f64, 1e3 * of(*target)?])).collect()
    };
    let has_truth = targets.values().any(|target| target.truth.is_some());
    let series = vec![
        series("true, before", Color::Red, Style::Crosses, points(Target::before_m)),
        series("true, after", Color::Green, Style::Dots, points(Target::after_m)),
        series("U95", Color::Blue, Style::Line, points(Target::u95_m)),
    ];
    let shown = series.into_iter().filter(|series| !series.points.is_empty()).collect();
    let chart = Panel {
        x: ("target number".to_owned(), Axis::Whole),
        y: ("tool error, mm".to_owned(), Axis::Log),
        ..panel("Tool error at each target", "", "", shown)
    };
    let of_truth = if has_truth { " True errors come from the simulator." } else { "" };
    figure(&chart, &format!("U95: the error is smaller with 95 % probability.{of_truth}"))
}

fn target_table(targets: &BTreeMap<usize, Target<'_>>) -> Markup {
    let has_truth = targets.values().any(|target| target.truth.is_some());
    let mm = |value: Option<f64>| Unit::Metres.shown_if(value, 2);
    markup! {
        div.wide {
            table {
                tr {
                    th { "target" }
                    @if has_truth { th { "true, before" } th { "true, after" } }
                    th { "U95" } th { "P(error > tolerance)" }
                }
                @for (number, target) in targets {
                    tr {
                        td { (number) }
                        @if has_truth { td { (mm(target.before_m())) } td { (mm(target.after_m())) } }
                        td { (mm(target.u95_m())) } td { (target.risk().map_or_else(String::new, risk_in_words)) }
                    }
                }
            }
        }
    }
}

/// Chart of the predicted error against the number of views of the last capture, with the true error at its end.
fn growth(report: &Report<'_>) -> Markup {
    let renewals = &report.summary.capture.renewals;
    let last = renewals.chunk_by(|before, after| before.views < after.views).last().unwrap_or_default();
    if last.len() < 2 {
        return Markup::default();
    }
    let mut predicted: Vec<[f64; 2]> =
        last.iter().map(|renewal| [renewal.views as f64, 1e3 * renewal.predicted_tool_error_m]).collect();
    let n_views = report.summary.capture.views as f64;
    predicted.extend(report.summary.calibration.predicted_tool_error_m.map(|error| [n_views, 1e3 * error.median]));
    let mut shown = vec![series("predicted", Color::Blue, Style::Line, predicted)];
    let after = report.summary.score.as_ref().and_then(|score| score.after.as_ref()?.tool_error_m);
    shown.extend(
        after.map(|after| series("true, median", Color::Green, Style::Dots, vec![[n_views, 1e3 * after.median]])),
    );
    let chart = Panel {
        x: ("views".to_owned(), Axis::Whole),
        y: ("tool error, mm".to_owned(), Axis::Log),
        ..panel("Tool error by number of views", "", "", shown)
    };
    figure(&chart, "Predictions made while views were captured.")
}

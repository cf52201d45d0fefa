//! A report as a page: its sections in their order, or any body in the same look.

use maud::{DOCTYPE, Markup, PreEscaped, html as markup};

use super::{Report, accuracy, arm, geometry, joints, limits, residuals, verdict};
use crate::report::online::online_section;

/// Renders the report.
#[must_use]
pub fn html(report: &Report<'_>) -> String {
    let title = format!("Calibration of {}", title(report));
    let body = markup! {
        (verdict::section(report))
        (accuracy::section(report))
        (arm::section(report))
        (joints::section(report))
        (geometry::section(report.calibration))
        (residuals::section(report))
        @if let Some(log) = report.online { (online_section(log, report.summary)) }
        (limits::section(report))
        (verdict::all_lines(report.summary))
        (verdict::signatures())
    };
    page(&title, &body)
}

/// A whole page: one file without network.
pub(crate) fn page(title: &str, body: &Markup) -> String {
    markup! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "armcal: " (title) }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body {
                main { h1 { (title) } (body) }
            }
        }
    }
    .into_string()
}

fn title(report: &Report<'_>) -> String {
    match &report.summary.routine {
        Some(routine) => format!("{}, {routine}", report.summary.robot),
        None => report.summary.robot.clone(),
    }
}

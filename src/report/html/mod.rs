//! report.html: one file, no network, no scripts; for a screen, light or dark, and for paper.
//!
//! The order is that in which an engineer asks: `verdict` (may I use it, why, what next, what is this of), `accuracy`
//! (how good at each target), `arm` (a picture of what changed), `joints` (each sensor's curve), `geometry` (camera
//! mount, links, tags), `residuals` (what the fit leaves), `limits` (what it does not hold for). `figure` draws charts.

mod accuracy;
mod arm;
mod figure;
mod geometry;
mod joints;
mod limits;
mod outline;
mod residuals;
mod verdict;

use maud::{DOCTYPE, Markup, PreEscaped, html as markup};

#[cfg(feature = "sim")]
pub(crate) use figure::{figure as chart, panel};

use crate::report::online::online_section;
use crate::report::summary::RunSummary;
use armcal_belief::calib::Calibration;
use armcal_belief::calib::online::BeliefLog;
use armcal_core::robot::Robot;

/// All that a report shows.
pub struct Report<'a> {
    pub summary: &'a RunSummary,
    pub calibration: &'a Calibration,
    /// By its folder: drawing and datasheets.
    pub robot: &'a Robot,
    pub online: Option<&'a BeliefLog>,
    pub about: About,
}

/// What a report is of, as far as somebody said it.
#[derive(Clone, Debug, Default)]
pub struct About {
    pub operator: Option<String>,
    pub vehicle: Option<String>,
    pub recordings: Vec<String>,
}

/// Renders the report.
#[must_use]
pub fn html(report: &Report<'_>) -> String {
    let title = format!("Calibration of {}", report.title());
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

impl Report<'_> {
    fn title(&self) -> String {
        match &self.summary.routine {
            Some(routine) => format!("{}, {routine}", self.summary.robot),
            None => self.summary.robot.clone(),
        }
    }
}

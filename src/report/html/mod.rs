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
mod page;
mod residuals;
mod verdict;

pub(crate) use figure::{figure as chart, panel, series};
pub use page::html;
pub(crate) use page::page;

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

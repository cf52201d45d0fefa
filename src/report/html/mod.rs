//! report.html: one file, no network, no scripts; for a screen, light or dark, and for paper.
//!
//! The order is that in which an engineer asks. `verdict` has decision, reasons, next step and details, `accuracy` the
//! error at each target. `arm` is a picture of the change, `joints` each sensor's curve. Then follow `geometry` (camera
//! mount, links, tags), `residuals` and `limits` (conditions and ranges of the result). `figure` draws charts.

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

/// Contents of a report.
pub struct Report<'a> {
    pub summary: &'a RunSummary,
    pub calibration: &'a Calibration,
    /// The robot as its folder describes it: nominal model (URDF) and datasheets.
    pub robot: &'a Robot,
    pub online: Option<&'a BeliefLog>,
    pub about: About,
}

/// Details of the report that the user gave; each may be absent.
#[derive(Clone, Debug, Default)]
pub struct About {
    pub operator: Option<String>,
    pub vehicle: Option<String>,
    pub recordings: Vec<String>,
}

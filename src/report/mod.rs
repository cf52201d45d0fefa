//! What people and programs get to see; computes nothing new.
//!
//! `RunSummary` is summary.json; `table` the closing table on the terminal; `html` report.html, one file that needs no
//! network. `markdown` the replay's panel.
//! All show the same figures. `inspection` is what a recording holds and what could be calibrated from it,
//! `proposed_map` an input map for it, `pose_table` both for tables of poses.
//! `verdict` is how a result is judged, in words. `tag_map` is a tag map as table and page.

mod html;
pub mod inspection;
mod markdown;
mod online;
pub mod pose_table;
pub mod proposed_map;
mod summary;
mod table;
mod tag_map;
mod verdict;

pub use html::{About, Report, html};
#[cfg(feature = "sim")]
pub(crate) use html::{chart, page, panel};
pub use markdown::markdown;
pub use summary::{
    AssertSummary, CalibrationSummary, CaptureSummary, HeldJointSummary, HeldOutSummary, OnlineSummary, RenewalSummary,
    RunSummary, WorldSummary,
};
pub(crate) use table::fit_columns;
pub use table::{closing, table};
pub use tag_map::{TAG_COLUMNS, TagMapPage, fit_lines, group_title, tag_map_html, tag_rows};

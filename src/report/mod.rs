//! Reports for people and programs; computes nothing new.
//!
//! `RunSummary` is summary.json; `table` the closing table on the terminal; `html` report.html, one file that needs no
//! network. `markdown` the replay's panel.
//! All show the same figures. `inspection` describes a recording's contents and what could be calibrated from it.
//! `proposed_map` proposes an input map for it, `pose_table` does both for tables of poses. `verdict` puts the
//! judgement of a result in words. `tag_map` shows a tag map as table and page.

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

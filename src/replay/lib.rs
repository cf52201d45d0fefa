//! Converts a run to a file for the Rerun viewer, or sends it to an open viewer, from recorded streams only.
//!
//! [`write_rrd`] draws estimates, detections and, with the simulator's truth file, the truth. [`write_plan_rrd`] draws
//! the motions of a plan, [`write_views_rrd`] the calibrated views of a real arm. [`open_viewer`] hands the file to an
//! installed viewer, which is not linked. [`LiveView`] sends a run in progress to an open viewer, [`show_recording`] a
//! whole recording. All entities (`entities`) share one timeline, `sim_time`: seconds since the recording's first log
//! time. The same input gives the same bytes of a file.

mod arms;
mod axis;
mod blueprint;
mod camera;
mod colors;
mod connection;
mod entities;
mod entity_log;
mod error;
mod fault_words;
mod identity;
mod live;
mod nearest;
mod news;
mod online;
mod phases;
mod plan;
mod plots;
mod poses;
mod read;
mod recording;
mod rerun;
mod residuals;
mod rrd;
mod scene;
mod scenery;
mod shapes;
mod shown;
mod summary;
mod targets;
mod touches;
mod tracks;
mod truth;
mod uncertainty;
mod viewer;
mod viewpoint;
mod views;

pub use connection::LOOPBACK_VIEWER;
pub use error::ReplayError;
pub use live::{LiveView, LiveViewEnd, show_recording};
pub use news::LiveDrawings;
pub use plan::{PlanInput, write_plan_rrd};
pub use read::read_for_replay;
pub use recording::write_rrd;
pub use scene::ReplayInput;
pub use viewer::{ViewerError, open_viewer};
pub use views::{ViewsInput, write_views_rrd};

#[cfg(test)]
mod tests;

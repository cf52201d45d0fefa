//! Input of a replay, and the recording as all drawing modules share it.

use std::path::Path;

use crate::tracks::Tracks;
use crate::truth::Truth;
use armcal_core::log::Recording;
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Scene;

/// Recording, truth and drawings to show.
pub struct ReplayInput<'a> {
    pub recording: &'a Recording,
    /// The simulator's truth file, if there is one.
    pub truth: Option<&'a Path>,
    pub robot: &'a Robot,
    pub vehicle: Option<&'a Vehicle>,
    pub scene: Option<&'a Scene>,
    /// Shown as it is, in place of a short description of the recording.
    pub summary_markdown: Option<&'a str>,
}

/// Data shared by the drawing modules.
pub(crate) struct ReplayScene<'a> {
    pub tracks: Tracks<'a>,
    pub truth: Option<Truth>,
    pub robot: &'a Robot,
    pub vehicle: Option<&'a Vehicle>,
    pub scene: Option<&'a Scene>,
}

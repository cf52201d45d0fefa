//! Input of a replay, and the recording as all drawing modules share it.

use std::path::Path;

use crate::tracks::Tracks;
use crate::truth::Truth;
use armcal_belief::calib::ViewResidual;
use armcal_belief::calib::online::BeliefLog;
use armcal_belief::session::ToolBelief;
use armcal_core::joints::JointAngles;
use armcal_core::kinematics::{Chain, LinkCorrections, LinkPoses};
use armcal_core::log::Recording;
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Scene;
use armcal_core::time::Stamp;

/// Recording, truth and drawings to show.
pub struct ReplayInput<'a> {
    pub recording: &'a Recording,
    /// The simulator's truth file, if there is one.
    pub truth: Option<&'a Path>,
    pub robot: &'a Robot,
    pub vehicle: Option<&'a Vehicle>,
    pub scene: Option<&'a Scene>,
    /// Link corrections of the estimate, each with the time from which they apply, in the order of time.
    pub believed_links: &'a [(Stamp, LinkCorrections)],
    /// Estimates of the tool's uncertainty, each with the time from which they apply, in the order of time; `None` if
    /// unknown.
    pub tool_beliefs: &'a [(Stamp, Option<ToolBelief>)],
    /// Residuals of the tags in each calibration, with its time.
    pub residuals: &'a [(Stamp, &'a [ViewResidual])],
    /// Clearance that planning requires around the arm, m; `None` if unknown.
    pub clearance_m: Option<f64>,
    /// Online estimates.
    pub online: Option<&'a BeliefLog>,
    /// Text that is shown unchanged, instead of a short description of the recording.
    pub summary_markdown: Option<&'a str>,
}

/// Data shared by the drawing modules.
pub(crate) struct ReplayScene<'a> {
    pub tracks: Tracks<'a>,
    pub truth: Option<Truth>,
    pub robot: &'a Robot,
    pub vehicle: Option<&'a Vehicle>,
    pub scene: Option<&'a Scene>,
    /// Estimated kinematic chains, each with the time from which it applies, s; before the first one, the nominal model
    /// (URDF) applies.
    pub believed_chains: Vec<(f64, Chain)>,
    /// Online estimates.
    pub online: Option<&'a BeliefLog>,
    /// State of the run: over or in progress.
    pub state: RunState,
}

/// State of a run while it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RunState {
    Over,
    GoesOn,
}

impl ReplayScene<'_> {
    /// Returns the link poses of the estimated arm at the estimated angles.
    pub(crate) fn believed_poses(&self, time_s: f64, angles: &JointAngles) -> LinkPoses {
        let since = self.believed_chains.partition_point(|(since_s, _)| *since_s <= time_s);
        let chain = since.checked_sub(1).map_or(&self.robot.chain, |at| &self.believed_chains[at].1);
        chain.link_poses(angles)
    }
}

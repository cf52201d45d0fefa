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
    /// Since when the arm was believed to be other than drawn, and how; in the order of time.
    pub believed_links: &'a [(Stamp, LinkCorrections)],
    /// Since when it was believed how surely where the tool is, in the order of time; `None` where nobody said.
    pub tool_beliefs: &'a [(Stamp, Option<ToolBelief>)],
    /// What each calibration left of the tags that it saw, since its time.
    pub residuals: &'a [(Stamp, &'a [ViewResidual])],
    /// What planning keeps clear around the arm, m; `None` where nobody says.
    pub clearance_m: Option<f64>,
    /// What was believed online.
    pub online: Option<&'a BeliefLog>,
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
    /// Arms that were believed in since a time, s, before which there was the drawing.
    pub believed_chains: Vec<(f64, Chain)>,
    /// What was believed online.
    pub online: Option<&'a BeliefLog>,
    /// Whether more will come.
    pub state: RunState,
}

/// How far a run is while it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RunState {
    Over,
    GoesOn,
}

impl ReplayScene<'_> {
    /// Poses of the links of the arm that was believed in, at believed angles.
    pub(crate) fn believed_poses(&self, time_s: f64, angles: &JointAngles) -> LinkPoses {
        let since = self.believed_chains.partition_point(|(since_s, _)| *since_s <= time_s);
        let chain = since.checked_sub(1).map_or(&self.robot.chain, |at| &self.believed_chains[at].1);
        chain.link_poses(angles)
    }
}

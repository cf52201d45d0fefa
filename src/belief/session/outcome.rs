//! What a run leaves, as far as the arm itself can tell.

use std::fmt;

use crate::file::calibration::{Calibration, Status};
use crate::session::held_joint::HeldJoint;
use crate::session::online_belief::OnlineOutcome;
use crate::session::tool_belief::{Certainty, ToolBelief};
use armcal_core::kinematics::LinkCorrections;
use armcal_core::robot::Robot;
use armcal_core::routine::AssertFigure;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointAngles, ReachAttempt};
use armcal_core::time::Stamp;
use serde::{Deserialize, Serialize};

/// What came out.
#[derive(Debug)]
pub struct Outcome {
    /// The last one, accepted or refused.
    pub calibration: Calibration,
    /// Poses at which the arm settled and was recorded.
    pub poses: usize,
    /// Poses given up: no path, or the arm did not settle.
    pub poses_skipped: usize,
    /// Targets given up, in the order of time.
    pub skipped_targets: Vec<SkippedTarget>,
    /// Time of the whole run, by the arm's clock.
    pub duration_s: f64,
    /// Time for which the arm was moving, not standing, s.
    pub motion_s: f64,
    /// Time spent in the script's `wait` steps, s.
    pub waited_s: f64,
    /// Time that the estimator itself took, by the watcher's clock.
    pub calibration_wall_s: f64,
    /// What the arm believed, since when.
    pub epochs: Vec<Epoch>,
    /// Captured views, in their order.
    pub visits: Vec<Visit>,
    /// Updates of the interim estimate, over all captures.
    pub renewals: Vec<EstimateUpdate>,
    /// Why the last capture took no more views.
    pub capture_ended: Option<String>,
    /// In the order of the script.
    pub reaches: Vec<ReachStep>,
    /// Every limit in the order of the script, with those that it did not come to.
    pub asserts: Vec<AssertResult>,
    /// Why the script ended before its last step.
    pub stopped: Option<String>,
    /// Joints that were given up, in the order of time.
    pub held: Vec<HeldJoint>,
    /// What they left within reach, by the last reach.
    pub still_reachable: Option<StillReachable>,
    /// What was believed online; `None` where no step works by it.
    pub online: Option<OnlineOutcome>,
}

impl Outcome {
    /// The calibrations of the run: accepted ones with the times since which they were believed, then the last one, if
    /// it was refused, with the end of its last view.
    #[must_use]
    pub fn calibrations(&self) -> Vec<(Stamp, &Calibration)> {
        let mut found: Vec<(Stamp, &Calibration)> = Vec::new();
        let epochs = self.epochs.iter().filter_map(|epoch| Some((epoch.from, epoch.calibration.as_ref()?)));
        let refused = &self.calibration;
        let end = Stamp { nanos: refused.valid.time_nanos };
        let refused = (refused.status == Status::Refused).then_some((end, refused));
        for (from, calibration) in epochs.chain(refused) {
            if found.last().is_none_or(|(_, last)| last.messages_hash != calibration.messages_hash) {
                found.push((from, calibration));
            }
        }
        found
    }
}

/// Which targets of a reach an arm with joints that are given up still reaches.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StillReachable {
    /// Names of the joints.
    pub joints: Vec<String>,
    /// How many targets a plan and a path lead to.
    pub reachable: usize,
    /// How many were asked for.
    pub of: usize,
    /// Numbers of the targets that a sound arm would reach.
    pub needs: Vec<usize>,
    /// Numbers of those that have a plan, and no path, or did not come to rest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub no_path: Vec<usize>,
}

impl fmt::Display for StillReachable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "still reachable: {} of {}", self.reachable, self.of)?;
        let joints = self.joints.join(", ");
        self.needs.iter().try_for_each(|target| write!(f, "; target {} needs {joints}", target + 1))?;
        self.no_path.iter().try_for_each(|target| write!(f, "; no path to target {} without {joints}", target + 1))
    }
}

/// The sensors that the arm believed in from a moment on.
#[derive(Clone, Debug)]
pub struct Epoch {
    /// Start of this belief, by the arm's clock.
    pub from: Stamp,
    /// Sensors believed in from then until the next epoch.
    pub sensors: ArmSensors,
    /// Where they come from; `None` for the datasheet.
    pub calibration: Option<Calibration>,
    /// How well they are known.
    pub certainty: Certainty,
}

impl Epoch {
    /// The links believed in, beyond the drawing.
    #[must_use]
    pub fn links(&self) -> LinkCorrections {
        self.calibration.as_ref().map(Calibration::link_corrections).unwrap_or_default()
    }

    /// How well the tool's place is known; `None` where nobody says.
    #[must_use]
    pub fn tool_belief(&self, robot: &Robot) -> Option<ToolBelief> {
        match &self.certainty {
            Certainty::Datasheet => Some(ToolBelief::by_datasheet(robot, &self.sensors)),
            Certainty::Calibration => ToolBelief::by_calibration(robot, self.calibration.as_ref()?),
            Certainty::Interim(estimate) => ToolBelief::by_calibration(robot, estimate),
            Certainty::Online(covariance) => {
                let robot = Robot { chain: robot.chain.corrected(&self.links()), ..robot.clone() };
                Some(ToolBelief::online(robot, &self.sensors, covariance))
            }
            Certainty::Unknown => None,
        }
    }
}

/// A captured view, and what was believed just before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Visit {
    /// Start of the dwell, by the arm's clock.
    pub at: Stamp,
    /// Joint angles by the readings under the belief of that moment.
    pub believed: JointAngles,
    /// Views that this belief rests on.
    pub belief_views: usize,
    /// Of the end of each link, from the first joint's on: the distance from where it is believed to be that is
    /// exceeded with a probability of 1 %, m.
    pub link_q99_m: Vec<f64>,
    /// Root mean square over the task, m.
    pub expected_tool_error_m: Option<f64>,
    /// Sum over the surveyed tags of the probability that the camera sees them there.
    pub tags_expected: f64,
}

/// A renewal of the belief while views were captured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimateUpdate {
    /// Number of views captured so far in this capture.
    pub views: usize,
    /// Since the capture began.
    pub elapsed_s: f64,
    /// Root mean square over the task, m.
    pub expected_tool_error_m: f64,
}

/// One `reach` or `work` step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReachStep {
    /// Number of the step in the script, from 1.
    pub step: usize,
    /// Whether it is a `work` step.
    pub is_work: bool,
    /// Targets that it asks for.
    pub targets: usize,
    /// Whether the arm believed in a calibration.
    pub attempt: ReachAttempt,
    /// Start of the step, by the arm's clock.
    pub start: Stamp,
    /// End of the step.
    pub end: Stamp,
}

/// A target of a `reach` step that the arm did not come to rest at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SkippedTarget {
    /// Number of the step in the script, from 1.
    pub step: usize,
    /// Number of the task's target, from 0.
    pub target: usize,
    /// The reason, in words.
    pub reason: String,
}

impl fmt::Display for SkippedTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "step {}, target {}: {}", self.step, self.target + 1, self.reason)
    }
}

/// One limit of an `assert` step, and how it came out.
#[derive(Clone, Debug, PartialEq)]
pub struct AssertResult {
    /// Number of the step in the script, from 1.
    pub step: usize,
    /// The figure that the limit is for.
    pub figure: AssertFigure,
    /// In the figure's unit; a minimum for the clearance, else a maximum.
    pub limit: f64,
    /// `None`: the arm itself cannot know it, or there is no such figure.
    pub value: Option<f64>,
    /// When it was asked; `None` if the script did not come to it.
    pub at: Option<Stamp>,
    /// The last reach before it, an index into [`Outcome::reaches`].
    pub last_reach: Option<usize>,
}

impl AssertResult {
    /// Whether the limit holds; `None` where the figure is not known.
    #[must_use]
    pub fn holds(&self) -> Option<bool> {
        Some(self.figure.holds(self.value?, self.limit))
    }
}

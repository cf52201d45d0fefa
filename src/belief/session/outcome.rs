//! Outcome of a run, as far as the arm itself can know it.

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

/// Outcome of a run.
#[derive(Debug)]
pub struct Outcome {
    /// The last calibration, accepted or refused.
    pub calibration: Calibration,
    /// Number of poses at which the arm settled and was recorded.
    pub poses: usize,
    /// Number of abandoned poses: no path, or the arm did not settle.
    pub poses_skipped: usize,
    /// Abandoned targets, in the order of time.
    pub skipped_targets: Vec<SkippedTarget>,
    /// Arm time of the whole run, s.
    pub duration_s: f64,
    /// Time for which the arm was moving, not standing, s.
    pub motion_s: f64,
    /// Time spent in the script's `wait` steps, s.
    pub waited_s: f64,
    /// Time that the estimator itself took, by the caller's clock, s.
    pub calibration_wall_s: f64,
    /// Beliefs of the arm, each with its start.
    pub epochs: Vec<Epoch>,
    /// Captured views, in their order.
    pub visits: Vec<Visit>,
    /// Updates of the interim estimate, over all captures.
    pub renewals: Vec<EstimateUpdate>,
    /// Reason why the last capture took no more views.
    pub capture_ended: Option<String>,
    /// Reaches in the order of the script.
    pub reaches: Vec<ReachStep>,
    /// Every limit in the order of the script, including those that the script did not reach.
    pub asserts: Vec<AssertResult>,
    /// Reason why the script ended before its last step.
    pub stopped: Option<String>,
    /// Held joints, in the order of time.
    pub held: Vec<HeldJoint>,
    /// Targets still reachable with the held joints, by the last reach.
    pub still_reachable: Option<StillReachable>,
    /// Outcome of the online estimate; `None` if no step uses it.
    pub online: Option<OnlineOutcome>,
}

impl Outcome {
    /// Returns the calibrations of the run. Accepted ones come with the start of their use. The last one, if refused,
    /// comes with the end of its last view.
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

/// Targets of a reach that an arm with held joints still reaches.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StillReachable {
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Number of targets with a plan and a path.
    pub reachable: usize,
    /// Number of requested targets.
    pub of: usize,
    /// Numbers of the targets that a sound arm would reach.
    pub needs: Vec<usize>,
    /// Numbers of the targets that have a plan, but no path, or at which the arm did not come to rest.
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

/// The sensors that the arm believed from one time on.
#[derive(Clone, Debug)]
pub struct Epoch {
    /// Start of this belief, by the arm's clock.
    pub from: Stamp,
    /// Believed sensors from then until the next epoch.
    pub sensors: ArmSensors,
    /// Calibration that gave them; `None` for the datasheet.
    pub calibration: Option<Calibration>,
    /// Source of their uncertainty.
    pub certainty: Certainty,
}

impl Epoch {
    /// Returns the believed corrections of the links relative to the nominal model.
    #[must_use]
    pub fn links(&self) -> LinkCorrections {
        self.calibration.as_ref().map(Calibration::link_corrections).unwrap_or_default()
    }

    /// Returns the uncertainty of the tool position; `None` if it is unknown.
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

/// A captured view, and the belief just before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Visit {
    /// Start of the dwell, by the arm's clock.
    pub at: Stamp,
    /// Joint angles by the readings under the belief at that time.
    pub believed: JointAngles,
    /// Number of views on which this belief is based.
    pub belief_views: usize,
    /// Distance between true and believed end of each link, from the first joint's on, that is exceeded with a
    /// probability of 1 %, m.
    pub link_q99_m: Vec<f64>,
    /// Expected root mean square tool error over the task, m.
    pub expected_tool_error_m: Option<f64>,
    /// Sum over the surveyed tags of the probability that the camera sees them there.
    pub tags_expected: f64,
}

/// An update of the belief during a capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimateUpdate {
    /// Number of views captured so far in this capture.
    pub views: usize,
    /// Arm time since the capture began, s.
    pub elapsed_s: f64,
    /// Expected root mean square tool error over the task, m.
    pub expected_tool_error_m: f64,
}

/// One `reach` or `work` step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReachStep {
    /// Number of the step in the script, from 1.
    pub step: usize,
    /// True if it is a `work` step.
    pub is_work: bool,
    /// Number of requested targets.
    pub targets: usize,
    /// Calibration state of the arm: before or after a calibration.
    pub attempt: ReachAttempt,
    /// Start of the step, by the arm's clock.
    pub start: Stamp,
    /// End of the step, by the arm's clock.
    pub end: Stamp,
}

/// A target of a `reach` step at which the arm did not come to rest.
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

/// One limit of an `assert` step, and its result.
#[derive(Clone, Debug, PartialEq)]
pub struct AssertResult {
    /// Number of the step in the script, from 1.
    pub step: usize,
    /// The figure that is limited.
    pub figure: AssertFigure,
    /// Limit in the figure's unit; a minimum for the clearance, otherwise a maximum.
    pub limit: f64,
    /// Value of the figure; `None` if the arm itself cannot know it, or there is no such figure.
    pub value: Option<f64>,
    /// Time of the check; `None` if the script did not reach it.
    pub at: Option<Stamp>,
    /// Index into [`Outcome::reaches`] of the last reach before it.
    pub last_reach: Option<usize>,
}

impl AssertResult {
    /// Returns true if the limit holds; `None` if the figure is unknown.
    #[must_use]
    pub fn holds(&self) -> Option<bool> {
        Some(self.figure.holds(self.value?, self.limit))
    }
}

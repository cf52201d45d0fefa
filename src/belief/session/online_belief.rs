//! The online estimate in a session: it takes in the recorded messages.

use serde::{Deserialize, Serialize};

use crate::follow::belief_log::BeliefLog;
use crate::follow::event::OnlineEvent;
use crate::follow::follower::Follower;
use crate::follow::settings::OnlineSettings;
use crate::solve::covariance::ParameterCovariance;
use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointAngles, Message};
use armcal_core::time::Stamp;

/// An online estimate that takes in every message as it is recorded.
pub(crate) struct OnlineBelief {
    follower: Follower,
    log: BeliefLog,
    /// Events that were not reported yet.
    events: Vec<OnlineEvent>,
}

/// Calibration poses between two tasks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AskedPoses {
    /// Time of the request, s since the start.
    pub time_s: f64,
    /// Number of captured views.
    pub views: usize,
    /// Arm time that they took, s.
    pub arm_time_s: f64,
    /// Tool error that 5 % exceed at the next target, before and after, m; `None` if a joint was to be located.
    pub u95_m: Option<[f64; 2]>,
}

/// Outcome of the online estimate.
#[derive(Clone, Debug)]
pub struct OnlineOutcome {
    /// Estimate and events over time.
    pub log: BeliefLog,
    /// True if the tool is known within the task's tolerance at the end; `None` without an estimate.
    pub is_good_enough: Option<bool>,
    /// Calibration poses that it requested.
    pub asked: Vec<AskedPoses>,
}

impl OnlineBelief {
    /// Returns the online estimate of an arm from the recording so far.
    pub(crate) fn of(robot: Robot, so_far: &Recording) -> Self {
        let follower = Follower::new(robot, OnlineSettings::default());
        let mut online = Self { follower, log: BeliefLog::default(), events: Vec::new() };
        so_far.messages.iter().for_each(|(log_time, message)| online.hear(*log_time, message));
        online
    }

    /// Returns the covariance of the sensors under the present conditions.
    pub(crate) fn covariance(&self) -> Option<ParameterCovariance> {
        let (sensors, conditions) = (self.follower.sensors(), self.follower.conditions());
        let covariance = self.follower.estimator().covariance(conditions)?;
        Some(covariance.under(&conditions.departure_from(&sensors.reference)))
    }

    pub(crate) fn hear(&mut self, log_time: Stamp, message: &Message) {
        let events = self.follower.push(log_time, message);
        self.events.extend(events.iter().cloned());
        self.log.hear(&self.follower, events);
    }

    /// Returns the events since the last call.
    pub(crate) fn take_events(&mut self) -> Vec<OnlineEvent> {
        std::mem::take(&mut self.events)
    }

    /// Takes in the held joints, each with the std of its angle, rad.
    pub(crate) fn hold(&mut self, held: impl Iterator<Item = (usize, f64)>) {
        held.for_each(|(joint, std_rad)| self.follower.stands_still(joint, std_rad));
    }

    pub(crate) fn sensors(&self) -> ArmSensors {
        self.follower.sensors()
    }

    pub(crate) fn u95_at_m(&self, angles: &JointAngles) -> Option<f64> {
        self.follower.u95_at_m(angles)
    }

    /// Returns the outcome at the end.
    pub(crate) fn end(mut self, asked: Vec<AskedPoses>) -> OnlineOutcome {
        let events = self.follower.finish();
        self.log.hear(&self.follower, events);
        self.log.end(&self.follower);
        OnlineOutcome { is_good_enough: self.follower.is_good_enough(), log: self.log, asked }
    }
}

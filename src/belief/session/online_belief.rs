//! The online belief at work: it hears what is recorded.

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

/// A belief that hears every message as it is recorded.
pub(crate) struct OnlineBelief {
    follower: Follower,
    log: BeliefLog,
    /// What nobody was told yet.
    events: Vec<OnlineEvent>,
}

/// Calibration poses between two tasks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AskedPoses {
    /// When they were asked for, since the start, s.
    pub time_s: f64,
    /// Views that came of it.
    pub views: usize,
    /// Time that they took, s.
    pub arm_time_s: f64,
    /// Error of the tool that 5 % exceed at the next target, before and after, m; `None` where a joint was looked for.
    pub u95_m: Option<[f64; 2]>,
}

/// What was believed online.
#[derive(Clone, Debug)]
pub struct OnlineOutcome {
    /// Over time.
    pub log: BeliefLog,
    /// Whether the tool is known within the task's tolerance at the end; `None` without a belief.
    pub is_good_enough: Option<bool>,
    /// Calibration poses that it asked for.
    pub asked: Vec<AskedPoses>,
}

impl OnlineBelief {
    /// Of an arm by all that was recorded so far.
    pub(crate) fn of(robot: Robot, so_far: &Recording) -> Self {
        let follower = Follower::new(robot, OnlineSettings::default());
        let mut online = Self { follower, log: BeliefLog::default(), events: Vec::new() };
        so_far.messages.iter().for_each(|(log_time, message)| online.hear(*log_time, message));
        online
    }

    /// Of the sensors under the conditions of now.
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

    /// What happened since this was last asked for.
    pub(crate) fn take_events(&mut self) -> Vec<OnlineEvent> {
        std::mem::take(&mut self.events)
    }

    /// Joints that were given up, and one sigma of where they are believed to stand, rad.
    pub(crate) fn hold(&mut self, held: impl Iterator<Item = (usize, f64)>) {
        held.for_each(|(joint, std_rad)| self.follower.stands_still(joint, std_rad));
    }

    pub(crate) fn sensors(&self) -> ArmSensors {
        self.follower.sensors()
    }

    pub(crate) fn u95_at_m(&self, angles: &JointAngles) -> Option<f64> {
        self.follower.u95_at_m(angles)
    }

    /// What is left of it at the end.
    pub(crate) fn end(mut self, asked: Vec<AskedPoses>) -> OnlineOutcome {
        let events = self.follower.finish();
        self.log.hear(&self.follower, events);
        self.log.end(&self.follower);
        OnlineOutcome { is_good_enough: self.follower.is_good_enough(), log: self.log, asked }
    }
}

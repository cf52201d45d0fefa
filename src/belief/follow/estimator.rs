//! The estimator that is fed view by view: beliefs under several lags of the sensors' temperature, and the one that
//! explains the views best.

use crate::follow::constants::estimator::{APART_K, GIVEN_UP_NATS, LAGS_S, TOLD_LATE_NANOS};
use std::sync::Arc;

use crate::follow::event::OnlineEvent;
use crate::follow::filter::Filter;
use crate::follow::hypothesis::Fault;
use crate::follow::lagged_temperature::LaggedTemperature;
use crate::follow::member::Member;
use crate::follow::oracle::Oracle;
use crate::follow::settings::{DriftModel, OnlineSettings};
use crate::model::parameters::JointParameters;
use crate::solve::covariance::ParameterCovariance;
use crate::views::view::View;
use armcal_core::robot::{FailedJoint, FailedKind, Robot};
use armcal_core::sensor::Conditions;
use armcal_core::time::Stamp;

/// Keeps a calibration up to date, view by view. It has no clock and no thread; the same views give the same belief.
#[derive(Clone)]
pub struct OnlineEstimator {
    robot: Robot,
    /// The best one first.
    members: Vec<Member>,
    /// Lags that do not yet differ from none.
    waiting: Vec<LaggedTemperature>,
    /// Of the last minutes: a belief that becomes the best one may have decided the same, before or after.
    told: Vec<OnlineEvent>,
    /// That nobody asked for yet.
    events: Vec<OnlineEvent>,
}

impl OnlineEstimator {
    /// For `robot` with the tags that are around it.
    #[must_use]
    pub fn new(robot: Robot, settings: OnlineSettings) -> Self {
        let settings = Arc::new(settings);
        let [without, lags @ ..] = LAGS_S;
        let is_drifting = settings.drift == DriftModel::Tuned;
        let waiting = lags.iter().filter(|_| is_drifting).map(|lag_s| LaggedTemperature::new(*lag_s)).collect();
        let members = vec![Member::new(robot.clone(), Arc::clone(&settings), without)];
        let mut estimator = Self { members, waiting, robot, told: Vec::new(), events: Vec::new() };
        // A slip is found and taken account of; all else that was declared says nothing of the angle.
        let declared: Vec<FailedJoint> = estimator.robot.failed.clone();
        declared
            .iter()
            .filter(|failed| failed.kind != FailedKind::Jumps)
            .for_each(|failed| estimator.leave_out(failed.joint));
        estimator
    }

    /// The arm that it is for, as drawn.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Lags of the sensors' temperature that are followed now, each with a belief of its own, and how much less
    /// probable than the best one its views are, nats: the best one first.
    #[must_use]
    pub fn lags(&self) -> Vec<[f64; 2]> {
        let best = self.best().nats;
        self.members.iter().map(|member| [member.lag_s(), best - member.nats]).collect()
    }

    /// Number of views taken in.
    #[must_use]
    pub fn n_views(&self) -> usize {
        self.best().n_views()
    }

    /// A joint that is left out stands still, and is known to stand where it is believed to within one sigma, rad.
    pub fn stands_still(&mut self, joint: usize, std_rad: f64) {
        if joint < self.robot.n_joints() {
            self.members.iter_mut().for_each(|member| member.stands_still(joint, std_rad));
        }
    }

    /// From now on the sensor of `joint` is not looked at: somebody declared that it has failed.
    pub fn leave_out(&mut self, joint: usize) {
        if joint < self.robot.n_joints() {
            self.members.iter_mut().for_each(|member| member.leave_out(joint));
        }
    }

    /// A reading of the oil's thermometer: what a sensor's temperature follows, whether a view comes or not.
    pub fn hear_temperature(&mut self, stamp: Stamp, oil_c: f64) {
        self.members.iter_mut().for_each(|member| member.hear_temperature(stamp, oil_c));
        self.waiting.iter_mut().for_each(|lag| lag.hear(stamp, oil_c));
    }

    /// Takes a view in; whether it told anything. Tags whose place nobody knows are not looked at: a map comes first.
    pub fn add_view(&mut self, view: &View) -> bool {
        let Some(view) = view.of_known_tags(&self.robot) else { return false };
        self.split(&view.conditions);
        let mut has_told = false;
        for member in &mut self.members {
            has_told |= member.add_view(view.clone());
        }
        // Stable: of equal ones the shorter lag comes first.
        self.members.sort_by(|a, b| b.nats.total_cmp(&a.nats));
        let best = self.best().nats;
        let mut place = 0;
        self.members.retain(|member| {
            place += 1;
            place == 1 || best - member.nats < GIVEN_UP_NATS
        });
        self.collect_events(view.end);
        has_told
    }

    /// Gives lags whose temperature has become another one a belief of their own.
    fn split(&mut self, conditions: &Conditions) {
        let Some(without) = self.members.iter().find(|member| member.lag_s() == LAGS_S[0]) else {
            // They had the same temperatures, and are as improbable.
            self.waiting.clear();
            return;
        };
        let is_apart = |lag: &LaggedTemperature| {
            let temperatures = lag.of_sensors(conditions).oil_c.zip(conditions.oil_c);
            temperatures.is_some_and(|(sensor_c, oil_c)| (sensor_c - oil_c).abs() > APART_K)
        };
        let (apart, waiting): (Vec<_>, Vec<_>) = self.waiting.iter().copied().partition(is_apart);
        let new: Vec<Member> = apart.into_iter().map(|lag| without.with_lag(lag)).collect();
        self.members.extend(new);
        self.waiting = waiting;
    }

    fn best(&self) -> &Member {
        // At least the best one stays.
        &self.members[0]
    }

    /// State and information of the best one; `None` before the first view.
    pub(crate) fn best_filter(&self) -> Option<&Filter> {
        self.best().filter()
    }

    /// What each of `explanations`, all of whose faults happen now, makes of the views from now on; `None` before the
    /// first belief. For studies that know what happened.
    #[must_use]
    pub fn oracle(&self, explanations: &[Vec<Fault>]) -> Option<Oracle> {
        self.best().oracle(explanations)
    }

    /// What happened since this was last asked for, in the order of time. What the best belief decided while it was not
    /// yet the best one is told as soon as it is.
    pub fn take_events(&mut self) -> Vec<OnlineEvent> {
        std::mem::take(&mut self.events)
    }

    /// Of the best one; those of the others wait for them to become it.
    fn collect_events(&mut self, now: Stamp) {
        let is_past = |event: &OnlineEvent| now.nanos - event.decided_nanos > TOLD_LATE_NANOS;
        self.told.retain(|event| !is_past(event));
        self.members.iter_mut().for_each(|member| member.forget_events(is_past));
        let mut new = self.members[0].take_events();
        new.retain(|event| !self.told.iter().any(|told| told.covers(event)));
        self.told.extend(new.iter().cloned());
        self.events.extend(new);
    }

    /// The sensors as believed; `None` before the first view.
    #[must_use]
    pub fn parameters(&self) -> Option<JointParameters> {
        self.best().parameters()
    }

    /// `conditions` as the sensors have them, with their temperature behind the oil's.
    #[must_use]
    pub fn at_sensors(&self, conditions: &Conditions) -> Conditions {
        self.best().lagged(conditions)
    }

    /// Covariance of the joints' parameters under `conditions`, with what may have changed since the last view.
    #[must_use]
    pub fn covariance(&self, conditions: &Conditions) -> Option<ParameterCovariance> {
        self.best().covariance(conditions)
    }

    /// How much faster than by the datasheet offsets walk and lag, as factors of standard deviations.
    #[must_use]
    pub fn drift_factors(&self) -> Option<[f64; 2]> {
        self.best().drift_factors()
    }

    /// How much later the joint sensors' stamps are than the camera's, and one sigma, s; `None` before the first view.
    #[must_use]
    pub fn clock_offset_s(&self) -> Option<[f64; 2]> {
        self.best().clock_offset_s()
    }

    /// Lag of the sensors' temperature that explains the views best, s.
    #[must_use]
    pub fn temperature_lag_s(&self) -> f64 {
        self.best().lag_s()
    }
}

//! The estimator that takes in view by view: beliefs under several lags of the sensors' temperature, of which the best
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

/// Keeps a calibration up to date, view by view. It has no clock and no thread; the same views give the same estimate.
#[derive(Clone)]
pub struct OnlineEstimator {
    robot: Robot,
    /// Members, the best one first.
    members: Vec<Member>,
    /// Lags that do not yet differ from none.
    waiting: Vec<LaggedTemperature>,
    /// Events of the last minutes: a belief that becomes the best one may have decided the same, before or after.
    told: Vec<OnlineEvent>,
    /// Events not yet collected by the caller.
    events: Vec<OnlineEvent>,
}

impl OnlineEstimator {
    /// Returns an estimator for `robot`, with the tags around it.
    #[must_use]
    pub fn new(robot: Robot, settings: OnlineSettings) -> Self {
        let settings = Arc::new(settings);
        let [without, lags @ ..] = LAGS_S;
        let is_drifting = settings.drift == DriftModel::Tuned;
        let waiting = lags.iter().filter(|_| is_drifting).map(|lag_s| LaggedTemperature::new(*lag_s)).collect();
        let members = vec![Member::new(robot.clone(), Arc::clone(&settings), without)];
        let mut estimator = Self { members, waiting, robot, told: Vec::new(), events: Vec::new() };
        // A slip is estimated; all other declared sensor failures give no information on the angle.
        let declared: Vec<FailedJoint> = estimator.robot.failed.clone();
        declared
            .iter()
            .filter(|failed| failed.kind != FailedKind::Jumps)
            .for_each(|failed| estimator.leave_out(failed.joint));
        estimator
    }

    /// Returns the nominal arm.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Returns the lags of the sensors' temperature that are followed now, s. With each comes the loss of its views'
    /// evidence against the best one, nats. The best one comes first.
    #[must_use]
    pub fn lags(&self) -> Vec<[f64; 2]> {
        let best = self.best().nats;
        self.members.iter().map(|member| [member.lag_s(), best - member.nats]).collect()
    }

    /// Returns the number of views taken in.
    #[must_use]
    pub fn n_views(&self) -> usize {
        self.best().n_views()
    }

    /// Declares that a joint without a sensor stands still at its believed angle, with the std `std_rad`, rad.
    pub fn stands_still(&mut self, joint: usize, std_rad: f64) {
        if joint < self.robot.n_joints() {
            self.members.iter_mut().for_each(|member| member.stands_still(joint, std_rad));
        }
    }

    /// Ignores the sensor of `joint` from now on, because it is declared failed.
    pub fn leave_out(&mut self, joint: usize) {
        if joint < self.robot.n_joints() {
            self.members.iter_mut().for_each(|member| member.leave_out(joint));
        }
    }

    /// Takes in a reading of the oil's thermometer, which the sensors' temperatures follow even without views.
    pub fn hear_temperature(&mut self, stamp: Stamp, oil_c: f64) {
        self.members.iter_mut().for_each(|member| member.hear_temperature(stamp, oil_c));
        self.waiting.iter_mut().for_each(|lag| lag.hear(stamp, oil_c));
    }

    /// Takes in a view. Returns true if it gave information. Tags with unknown poses are ignored, because a map must
    /// come first.
    pub fn add_view(&mut self, view: &View) -> bool {
        let Some(view) = view.of_known_tags(&self.robot) else { return false };
        self.split(&view.conditions);
        let mut has_told = false;
        for member in &mut self.members {
            has_told |= member.add_view(view.clone());
        }
        // The sort is stable: of equal members the shorter lag comes first.
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

    /// Gives a lag its own belief once its temperature differs.
    fn split(&mut self, conditions: &Conditions) {
        let Some(without) = self.members.iter().find(|member| member.lag_s() == LAGS_S[0]) else {
            // These lags had the same temperatures, and are as improbable.
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
        // The best member always stays.
        &self.members[0]
    }

    /// Returns state and information of the best belief; `None` before the first view.
    pub(crate) fn best_filter(&self) -> Option<&Filter> {
        self.best().filter()
    }

    /// Returns an oracle that follows each of `explanations`, whose faults all happen now. `None` before the first
    /// estimate. For studies with known faults.
    #[must_use]
    pub fn oracle(&self, explanations: &[Vec<Fault>]) -> Option<Oracle> {
        self.best().oracle(explanations)
    }

    /// Returns the events since the last call, in the order of time. Events that the best belief decided before it
    /// became the best are included when it does.
    pub fn take_events(&mut self) -> Vec<OnlineEvent> {
        std::mem::take(&mut self.events)
    }

    /// Collects the events of the best belief; those of the others wait until theirs is the best.
    fn collect_events(&mut self, now: Stamp) {
        let is_past = |event: &OnlineEvent| now.nanos - event.decided_nanos > TOLD_LATE_NANOS;
        self.told.retain(|event| !is_past(event));
        self.members.iter_mut().for_each(|member| member.forget_events(is_past));
        let mut new = self.members[0].take_events();
        new.retain(|event| !self.told.iter().any(|told| told.covers(event)));
        self.told.extend(new.iter().cloned());
        self.events.extend(new);
    }

    /// Returns the estimated sensor parameters; `None` before the first view.
    #[must_use]
    pub fn parameters(&self) -> Option<JointParameters> {
        self.best().parameters()
    }

    /// Returns the conditions at the sensors, whose temperature lags behind the oil's.
    #[must_use]
    pub fn at_sensors(&self, conditions: &Conditions) -> Conditions {
        self.best().lagged(conditions)
    }

    /// Returns the covariance of the joints' parameters under `conditions`, including changes since the last view.
    #[must_use]
    pub fn covariance(&self, conditions: &Conditions) -> Option<ParameterCovariance> {
        self.best().covariance(conditions)
    }

    /// Returns the ratios of estimated to datasheet std: of the offsets' random walk and of their lag.
    #[must_use]
    pub fn drift_factors(&self) -> Option<[f64; 2]> {
        self.best().drift_factors()
    }

    /// Returns the delay of the joint sensors' stamps against the camera's and its std, s; `None` before the first
    /// view.
    #[must_use]
    pub fn clock_offset_s(&self) -> Option<[f64; 2]> {
        self.best().clock_offset_s()
    }

    /// Returns the lag of the sensors' temperature that explains the views best, s.
    #[must_use]
    pub fn temperature_lag_s(&self) -> f64 {
        self.best().lag_s()
    }
}

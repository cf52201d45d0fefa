//! The estimator under one lag of the sensors' temperature behind the thermometer's.

use crate::batch::constants::rounds::MIN_VIEWS_FOR_EVIDENCE;
use crate::follow::constants::member::{FORGETTING, MOVING_FOR_START, N_STARTS_OF_DRIFTING, START_AT, START_PAUSE_S};
use std::sync::Arc;

use crate::follow::branch::{Branch, Step};
use crate::follow::diagnosis::{Race, RecentViews, is_suspicious};
use crate::follow::event::OnlineEvent;
use crate::follow::filter::{Filter, ViewUpdate};
use crate::follow::hindsight::Hindsight;
use crate::follow::hypothesis::Fault;
use crate::follow::image_noise::{CornerNoise, MotionNoise};
use crate::follow::lagged_temperature::LaggedTemperature;
use crate::follow::oracle::{Explained, Oracle};
use crate::follow::process_noise::{JitterSize, JointErrorSize, ProcessNoise};
use crate::follow::settings::{DriftModel, FaultSearch, OnlineSettings, dive_scales, online_model};
use crate::follow::view_stream::is_moving;
use crate::model::parameters::JointParameters;
use crate::solve::covariance::ParameterCovariance;
use crate::solve::estimate::estimate;
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::views::view::View;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::robot::Robot;
use armcal_core::sensor::Conditions;
use armcal_core::time::Stamp;

/// A belief that takes in view by view, for sensors that follow the thermometer with one lag.
#[derive(Clone)]
pub(crate) struct Member {
    robot: Robot,
    settings: Arc<OnlineSettings>,
    lag: LaggedTemperature,
    corners: CornerNoise,
    /// Logarithm of the probability of the views by this belief, with less weight on older ones.
    pub nats: f64,
    /// Initial views, until the filter continues without them.
    first: Vec<View>,
    /// Views of a moving arm before the first one at rest.
    moving: Vec<View>,
    n_views: usize,
    /// Joints whose sensor gives no information any more.
    failed: Vec<usize>,
    /// Std of the angle of each joint that stands still without a sensor, rad.
    stands_within_rad: [f64; MAX_JOINTS],
    running: Option<Running>,
    suspect_since: Option<Stamp>,
    events: Vec<OnlineEvent>,
}

/// The filter, and its noise estimates.
#[derive(Clone)]
struct Running {
    filter: Filter,
    /// Open hypotheses about views that the filter did not expect.
    race: Option<Race>,
    recent: Option<RecentViews>,
    hindsight: Hindsight,
    noise: ProcessNoise,
    errors: JointErrorSize,
    motion: MotionNoise,
    jitter: JitterSize,
    /// Conditions of the last view.
    conditions: Conditions,
}

impl Member {
    pub(crate) fn new(robot: Robot, settings: Arc<OnlineSettings>, lag_s: f64) -> Self {
        let corners = CornerNoise::new(robot.camera.corner_std_px);
        Self {
            robot,
            settings,
            lag: LaggedTemperature::new(lag_s),
            corners,
            nats: 0.0,
            first: Vec::new(),
            moving: Vec::new(),
            n_views: 0,
            failed: Vec::new(),
            stands_within_rad: [f64::INFINITY; MAX_JOINTS],
            running: None,
            suspect_since: None,
            events: Vec::new(),
        }
    }

    /// Returns the same belief under another lag from now on, whose temperatures were about the same so far.
    pub(crate) fn with_lag(&self, lag: LaggedTemperature) -> Self {
        Self { lag, ..self.clone() }
    }

    /// Returns the number of views taken in.
    pub(crate) fn n_views(&self) -> usize {
        self.n_views
    }

    /// Ignores the sensor of `joint` from now on.
    pub(crate) fn leave_out(&mut self, joint: usize) {
        if !self.failed.contains(&joint) {
            self.failed.push(joint);
        }
    }

    /// Declares that the joint without a sensor stands still at its believed angle, with the std `std_rad`.
    pub(crate) fn stands_still(&mut self, joint: usize, std_rad: f64) {
        self.stands_within_rad[joint] = std_rad;
    }

    /// Takes in a reading of the oil's thermometer.
    pub(crate) fn hear_temperature(&mut self, stamp: Stamp, oil_c: f64) {
        self.lag.hear(stamp, oil_c);
    }

    /// Returns the conditions at the sensors.
    pub(crate) fn lagged(&self, conditions: &Conditions) -> Conditions {
        self.lag.of_sensors(conditions)
    }

    /// Takes in a view. Returns true if it gave information.
    pub(crate) fn add_view(&mut self, mut view: View) -> bool {
        self.n_views += 1;
        view.conditions = self.lagged(&view.conditions);
        self.failed.iter().for_each(|joint| view.is_free[*joint] = true);
        if view.is_free.contains(&true) && self.corners.creeps(&view) {
            return false;
        }
        if self.settings.scales.is_none() {
            self.corners.learn(&view);
            self.robot.camera.corner_std_px = self.corners.std_px();
        }
        self.close_start(&view);
        let is_start = self.running.is_none() || !self.first.is_empty();
        match (is_start, is_moving(&view)) {
            (true, true) => self.hold_back(view),
            (true, false) => self.start_with(view),
            (false, _) => self.carry_on(&view).is_some(),
        }
    }

    /// Ends a start after a long pause; the belief includes the views since its last batch. Without drift, views at
    /// rest may come at any time.
    fn close_start(&mut self, view: &View) {
        let is_late = self.first.last().is_some_and(|last| view.end.since_s(last.end) > START_PAUSE_S);
        let may_wait = self.settings.drift == DriftModel::Stationary && !is_moving(view);
        if is_late && !may_wait && self.running.is_some() {
            self.first = Vec::new();
        }
    }

    /// Holds views of a moving arm back, unless there are no others.
    fn hold_back(&mut self, view: View) -> bool {
        if self.running.is_some() {
            return false;
        }
        self.moving.push(view);
        if self.moving.len() < MOVING_FOR_START {
            return false;
        }
        self.first = std::mem::take(&mut self.moving);
        self.running = self.start();
        self.first = Vec::new();
        self.running.is_some()
    }

    /// Makes the batch of the initial views.
    fn start_with(&mut self, view: View) -> bool {
        self.moving = Vec::new();
        let n = self.first.len() + 1;
        let starts = match self.settings.drift {
            DriftModel::Stationary => &START_AT[..],
            DriftModel::Tuned => &START_AT[..N_STARTS_OF_DRIFTING],
        };
        if !starts.contains(&n) {
            self.first.push(view.clone());
            return self.carry_on(&view).is_some();
        }
        self.first.push(view);
        let started = self.start();
        if started.is_some() {
            self.running = started;
        }
        if starts.last() == Some(&n) {
            self.first = Vec::new();
        }
        self.running.is_some()
    }

    fn start(&self) -> Option<Running> {
        let reference = self.first[0].conditions;
        let (scales, evidence) = match &self.settings.scales {
            Some(scales) => (scales.clone(), HyperparameterMode::Given),
            None if self.first.len() < MIN_VIEWS_FOR_EVIDENCE => (dive_scales(&self.robot), HyperparameterMode::Given),
            None => (dive_scales(&self.robot), HyperparameterMode::Fitted),
        };
        let input = BundleInput {
            robot: &self.robot,
            views: &self.first,
            model: self.settings.model.clone().unwrap_or_else(|| online_model(&self.robot)),
            scales,
            guess: self.settings.guess.unwrap_or(JointParameters { reference, ..JointParameters::default() }),
            joint_prior: None,
            evidence,
        };
        let first_scales = input.scales.clone();
        let mut estimate = estimate(&input)?;
        if evidence == HyperparameterMode::Fitted {
            estimate.take_mean_scales(&first_scales);
        }
        let mut filter = Filter::of_estimate(&estimate, &self.robot)?;
        let is_untold = |joint: &usize| self.first.iter().all(|view| view.approach[*joint] == 0.0);
        if evidence == HyperparameterMode::Fitted {
            let untold = (0..self.robot.n_joints()).filter(is_untold);
            untold.for_each(|joint| filter.expect_backlash(joint, first_scales.half_play_std_rad));
        }
        let noise = ProcessNoise::datasheet(&self.robot, &filter.scales);
        let errors = JointErrorSize::new(&filter.scales);
        let jitter = JitterSize::new(&filter.scales);
        let conditions = self.first.iter().max_by_key(|view| view.end)?.conditions;
        Some(Running {
            filter,
            race: None,
            recent: None,
            hindsight: Hindsight::default(),
            noise,
            errors,
            motion: MotionNoise::default(),
            jitter,
            conditions,
        })
    }

    fn carry_on(&mut self, view: &View) -> Option<ViewUpdate> {
        let running = self.running.as_mut()?;
        let is_searched = self.settings.faults == FaultSearch::On;
        if is_searched && running.race.is_none() {
            running.hindsight.begin(&running.filter);
        }
        let mut drift = None;
        if self.settings.drift == DriftModel::Tuned {
            let change = view.conditions.departure_from(&running.conditions);
            drift = Some((running.noise.clone(), change));
            running.conditions = view.conditions;
        }
        let step = Step { drift, view: view.clone() };
        if running.race.is_some() {
            self.go_on_with_race(step);
            return None;
        }
        if let Some((_, change)) = &step.drift {
            running.noise.widen(&mut running.filter, change);
        }
        let recent = running.recent.take().filter(|recent| !recent.is_past(view));
        let mut recent = recent.unwrap_or_else(|| RecentViews::new(running.filter.clone()));
        let nats_of_earlier = recent.nats;
        let update = running.filter.update(&self.robot, view);
        recent.add(view, update.as_ref());
        if is_searched {
            running.hindsight.add(step, update.as_ref().map(|update| update.scores.clone()).unwrap_or_default());
            // A view whose observations are all rejected changes nothing.
            let is_suspicious = update.as_ref().is_none_or(is_suspicious) || recent.show_a_step();
            let n_views = recent.views.len();
            let found = running.hindsight.found(&self.robot, &running.filter, n_views);
            if is_suspicious || !found.is_empty() {
                self.start_race(&recent, found, nats_of_earlier);
                return update;
            }
        }
        running.recent = Some(recent);
        let update = update?;
        self.nats = FORGETTING * self.nats + update.log_evidence;
        self.learn(&update, view);
        Some(update)
    }

    /// Starts a race of hypotheses about the last views, with those `found` in hindsight.
    fn start_race(&mut self, recent: &RecentViews, found: Vec<Branch>, nats_of_earlier: f64) {
        let Some(running) = &mut self.running else { return };
        let mut race = Race::start(&self.robot, recent);
        race.take_up(found);
        // The evidence is forgotten once per view, with or without a race, because it compares beliefs under other
        // lags.
        self.nats = FORGETTING * self.nats + race.nats() - nats_of_earlier;
        self.suspect_since = recent.views.first().map(|first| first.end);
        running.race = Some(race);
        if let Some(last) = recent.views.last() {
            self.settle_race(last.end);
        }
    }

    fn go_on_with_race(&mut self, step: Step) {
        let Some(running) = &mut self.running else { return };
        let Running { race: Some(race), hindsight, filter, .. } = running else { return };
        let (before, now) = (race.nats(), step.view.end);
        let scores = race.add(&self.robot, step.clone());
        hindsight.add(step, scores);
        race.take_up(hindsight.found(&self.robot, filter, race.n_views()));
        self.nats = FORGETTING * self.nats + race.nats() - before;
        self.settle_race(now);
    }

    /// Learns the noise of sensors and images.
    fn learn(&mut self, update: &ViewUpdate, view: &View) {
        let Some(running) = &mut self.running else { return };
        if self.settings.drift == DriftModel::Tuned {
            running.noise.learn(update);
        }
        if self.settings.scales.is_some() {
            return;
        }
        let scales = &mut running.filter.scales;
        if is_moving(view) {
            running.jitter.learn(update, scales);
            running.motion.learn(update);
            running.filter.noise_in_motion = running.motion.factor();
        } else {
            running.errors.learn(update, scales);
        }
    }

    /// Makes the best hypothesis the belief, and reports it once it is decided.
    fn settle_race(&mut self, now: Stamp) {
        let Some(running) = &mut self.running else { return };
        let Some(race) = &running.race else { return };
        if let Some(belief) = race.belief() {
            running.filter = belief.clone();
        }
        if !race.is_over() {
            return;
        }
        if let Some(verdict) = race.verdict() {
            if let Fault::Failed(joint) = verdict.fault {
                self.failed.push(joint);
            }
            let since = verdict.since.or(self.suspect_since.take()).unwrap_or(now);
            self.events.push(OnlineEvent::of_verdict(&self.robot, &verdict, since, now));
            running.hindsight = Hindsight::default();
        } else if race.best().is_some_and(|best| best.fault == Some(Fault::Drift)) {
            running.hindsight.has_drifted(race.n_views());
        }
        running.race = None;
    }

    /// Returns an oracle that follows each of `explanations` from now on; `None` before the first estimate.
    pub(crate) fn oracle(&self, explanations: &[Vec<Fault>]) -> Option<Oracle> {
        let Running { filter, noise, conditions, .. } = self.running.as_ref()?;
        let explained = |faults: &[Fault]| Explained::new(faults.to_vec(), filter, &self.robot);
        Some(Oracle {
            robot: self.robot.clone(),
            lag: self.lag,
            noise: noise.clone(),
            conditions: *conditions,
            failed: self.failed.clone(),
            nothing: explained(&[]),
            explanations: explanations.iter().map(|faults| explained(faults)).collect(),
        })
    }

    /// Returns the events since the last call, in the order of time.
    pub(crate) fn take_events(&mut self) -> Vec<OnlineEvent> {
        std::mem::take(&mut self.events)
    }

    /// Drops uncollected events for which `is_past` holds.
    pub(crate) fn forget_events(&mut self, is_past: impl Fn(&OnlineEvent) -> bool) {
        self.events.retain(|event| !is_past(event));
    }

    /// Returns state and information; `None` before the first view.
    pub(crate) fn filter(&self) -> Option<&Filter> {
        self.running.as_ref().map(|running| &running.filter)
    }

    /// Returns the believed sensor parameters; `None` before the first view.
    pub(crate) fn parameters(&self) -> Option<JointParameters> {
        self.running.as_ref().map(|running| running.filter.parameters())
    }

    /// Returns the covariance of the joints' parameters under `conditions`, including changes since the last view.
    pub(crate) fn covariance(&self, conditions: &Conditions) -> Option<ParameterCovariance> {
        let running = self.running.as_ref()?;
        let mut filter = running.filter.clone();
        if self.settings.drift == DriftModel::Tuned {
            let change = self.lagged(conditions).departure_from(&running.conditions);
            let widening = running.noise.widening(&filter, &change);
            filter.widen(&widening);
        }
        let parameters = filter.joint_parameters().to_vec();
        let matrix = filter.joint_covariance()?;
        let sensors = filter.parameters();
        let residual_std_rad = std::array::from_fn(|joint| match self.robot.sensors.get(joint) {
            // A failed sensor leaves the angle open.
            _ if self.failed.contains(&joint) => filter.scales.free_joint_std_rad.min(self.stands_within_rad[joint]),
            Some(spec) if filter.joint_columns(joint).is_empty() => spec.linearity_std_rad,
            _ => {
                // Rests do not show from which side a joint came, so their residuals include the backlash. The tool's
                // error adds the backlash itself.
                let half_backlash_rad = sensors.terms[joint].half_backlash_rad;
                (filter.scales.joint_std_rad[joint].powi(2) - half_backlash_rad.powi(2)).max(0.0).sqrt()
            }
        });
        Some(ParameterCovariance { parameters, matrix, residual_std_rad: Some(residual_std_rad) })
    }

    /// Returns the delay of the joint sensors' stamps against the camera's and its std, s.
    pub(crate) fn clock_offset_s(&self) -> Option<[f64; 2]> {
        let filter = &self.running.as_ref()?.filter;
        let (offset_s, at) = filter.clock_offset()?;
        Some([offset_s, filter.std_of(at)?])
    }

    pub(crate) fn lag_s(&self) -> f64 {
        self.lag.lag_s
    }

    /// Returns the ratios of estimated to datasheet std: of the offsets' random walk and of their lag.
    pub(crate) fn drift_factors(&self) -> Option<[f64; 2]> {
        self.running.as_ref().map(|running| running.noise.factors())
    }
}

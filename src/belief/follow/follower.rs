//! A belief that is fed messages, and what it says over time.

use crate::follow::constants::follower::AHEAD_H;
use crate::follow::doubts::Doubts;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::follow::estimator::OnlineEstimator;
use crate::follow::event::OnlineEvent;
use crate::follow::settings::OnlineSettings;
use crate::follow::view_stream::ViewStream;
use crate::judge::{ErrorDistribution, MAX_RISK};
use crate::say::doubt::Doubt;
use crate::solve::covariance::{JointAt, ParameterCovariance, task_angles};
use crate::views::view::{TaskRests, View};
use armcal_core::codes::{Code, Coded};
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, Conditions};
use armcal_core::stats::Summary;
use armcal_core::streams::{JointAngles, Mark, MarkKind, Message, ReachTask, Thermometer};
use armcal_core::time::Stamp;

/// Follows the messages of an arm: push messages, read belief, predicted tool error and events.
///
/// Memory and time a message are bounded whatever the length of the stream. The same messages give the same belief.
#[derive(Clone)]
pub struct Follower {
    settings: OnlineSettings,
    robot: Robot,
    views: ViewStream,
    estimator: OnlineEstimator,
    doubts: Doubts,
    conditions: Conditions,
    targets: Vec<JointAngles>,
    tolerance_m: Option<f64>,
}

/// What is believed at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BeliefRow {
    /// ns since the epoch, by the joint sensors' clock.
    pub stamp_nanos: i64,
    /// Views so far.
    pub views: usize,
    /// Expected error of the tool over the task, one sigma in space, m: now.
    pub tool_error_m: Summary,
    /// The same in an hour without any view.
    pub tool_error_in_an_hour_m: Summary,
    /// Of each joint: what its sensor is off at the middle of its range under the conditions of then, and one sigma,
    /// rad.
    pub offset_rad: Vec<[f64; 2]>,
    /// How much later the joint sensors' stamps are than the camera's, and one sigma, s.
    pub clock_offset_s: Option<[f64; 2]>,
    /// Lag of the sensors' temperature behind the oil's, s.
    pub temperature_lag_s: f64,
    /// Code of what speaks against all of it; absent where nothing does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub doubt: Option<Code>,
}

impl Follower {
    /// For `robot`; tags that a recorded survey names take the place of its own.
    #[must_use]
    pub fn new(robot: Robot, settings: OnlineSettings) -> Self {
        Self {
            views: ViewStream::new(robot.clone()),
            estimator: OnlineEstimator::new(robot.clone(), settings.clone()),
            doubts: Doubts::default(),
            targets: vec![robot.stowed],
            tolerance_m: None,
            robot,
            settings,
            conditions: Conditions::default(),
        }
    }

    /// Takes a message in; what it made known, in the order of time.
    pub fn push(&mut self, log_time: Stamp, message: &Message) -> Vec<OnlineEvent> {
        match message {
            // The first word counts, as in a calibration.
            Message::Survey(survey) if self.estimator.n_views() == 0 => {
                let robot = self.robot.clone().with_survey(survey.survey(&self.robot));
                let (targets, tolerance_m) = (std::mem::take(&mut self.targets), self.tolerance_m);
                *self = Self { targets, tolerance_m, ..Self::new(robot, self.settings.clone()) };
            }
            Message::Task(task) => self.set_task(task),
            Message::Mark(Mark { kind: MarkKind::Failed(failed), .. }) => self.estimator.leave_out(failed.joint),
            Message::JointSensors(sample) => self.conditions.stamp = Some(sample.stamp),
            Message::Pressure(sample) if sample.pressure_pa.is_finite() => {
                self.conditions.pressure_pa = Some(sample.pressure_pa)
            }
            Message::Temperature(sample)
                if sample.thermometer == Thermometer::Oil && sample.temperature_c.is_finite() =>
            {
                self.conditions.oil_c = Some(sample.temperature_c);
                self.estimator.hear_temperature(sample.stamp, sample.temperature_c);
            }
            _ => {}
        }
        let views = self.views.push(log_time, message);
        self.add(views)
    }

    /// What is complete when no more messages come.
    pub fn finish(&mut self) -> Vec<OnlineEvent> {
        let views = self.views.finish();
        self.add(views)
    }

    /// Takes views in that were made elsewhere, of an external recording for instance.
    pub fn add(&mut self, views: Vec<View>) -> Vec<OnlineEvent> {
        for view in views {
            let Conditions { oil_c, pressure_pa, stamp } = &mut self.conditions;
            if stamp.is_none_or(|latest| latest < view.end) {
                *stamp = Some(view.end);
                (*oil_c, *pressure_pa) =
                    (view.conditions.oil_c.or(*oil_c), view.conditions.pressure_pa.or(*pressure_pa));
            }
            if !self.doubts.repeats_image(&view, &self.robot) {
                self.estimator.add_view(&view);
            }
        }
        let events = self.estimator.take_events();
        self.doubts.hear(&events, self.estimator.n_views(), self.robot.reach_m());
        events
    }

    /// Reason not to rely on the belief as a whole, whatever its covariance says.
    #[must_use]
    pub fn doubt(&self) -> Option<Doubt> {
        self.doubts.now()
    }

    /// The targets that tool errors are predicted at; where none is within reach, the stowed posture stays.
    pub fn set_task(&mut self, task: &ReachTask) {
        let targets = task_angles(&self.robot, TaskRests { task, rests: &std::collections::BTreeMap::new() });
        self.tolerance_m = Some(task.tolerance_m);
        if !targets.is_empty() {
            self.targets = targets;
        }
    }

    /// Returns true where the decision rule accepts every target of the task, false under a [`Self::doubt`]; without a
    /// doubt `None` where there is no task or no estimate.
    #[must_use]
    pub fn is_good_enough(&self) -> Option<bool> {
        if self.doubt().is_some() {
            return Some(false);
        }
        let covariance = self.estimator.covariance(&self.conditions)?;
        let (sensors, tolerance_m) = (self.sensors(), self.tolerance_m?);
        let is_accepted = |angles: &JointAngles| {
            let covariance_m2 = self.tool_covariance_m2(&covariance, &sensors, angles, &self.conditions);
            ErrorDistribution::new(&covariance_m2, f64::INFINITY)
                .is_some_and(|error| error.beyond(tolerance_m) <= MAX_RISK)
        };
        Some(self.targets.iter().all(is_accepted))
    }

    /// A joint whose sensor is left out stands still where it is believed to stand, to one sigma, rad.
    pub fn stands_still(&mut self, joint: usize, std_rad: f64) {
        self.estimator.stands_still(joint, std_rad);
    }

    /// The estimator.
    #[must_use]
    pub fn estimator(&self) -> &OnlineEstimator {
        &self.estimator
    }

    /// The sensors as believed under the conditions of now; those of the datasheet before the first view.
    #[must_use]
    pub fn sensors(&self) -> ArmSensors {
        let Some(parameters) = self.estimator.parameters() else { return ArmSensors::nominal(&self.robot) };
        let mut sensors = parameters.sensors(&self.robot);
        // What the sensors are warmer than the oil, their reference is colder.
        let at_sensors = self.estimator.at_sensors(&self.conditions);
        if let (Some(reference_c), Some(oil_c), Some(sensor_c)) =
            (&mut sensors.reference.oil_c, self.conditions.oil_c, at_sensors.oil_c)
        {
            *reference_c += oil_c - sensor_c;
        }
        sensors
    }

    /// Latest temperatures, pressure and time.
    #[must_use]
    pub fn conditions(&self) -> &Conditions {
        &self.conditions
    }

    /// What is believed now; `None` before the first view.
    #[must_use]
    pub fn belief(&self) -> Option<BeliefRow> {
        let stamp = self.conditions.stamp?;
        let later = Conditions { stamp: Some(stamp.plus_s(3600.0 * AHEAD_H)), ..self.conditions };
        let parameters = self.estimator.parameters()?;
        let covariance = self.estimator.covariance(&self.conditions)?;
        let change = self.estimator.at_sensors(&self.conditions).departure_from(&parameters.reference);
        let offset = |joint: usize| {
            let spec = &self.robot.sensors[joint];
            let off_rad = parameters.correction(joint).angle_rad(spec, 0.0, &change, 0.0) - spec.center_rad;
            let is_estimated = covariance.parameters.iter().any(|p| p.joint == joint);
            let std_rad = covariance.angle_var_rad2(JointAt { spec, joint, travel_rad: 0.0 }, &change, 0.0).sqrt();
            [off_rad, if is_estimated { std_rad } else { spec.offset_std_rad }]
        };
        Some(BeliefRow {
            stamp_nanos: stamp.nanos,
            views: self.estimator.n_views(),
            tool_error_m: self.tool_error_under_m(&covariance, &self.conditions)?,
            tool_error_in_an_hour_m: self.tool_error_m(&later)?,
            clock_offset_s: self.estimator.clock_offset_s(),
            temperature_lag_s: self.estimator.temperature_lag_s(),
            doubt: self.doubt().map(|doubt| doubt.code()),
            offset_rad: (0..self.robot.n_joints()).map(offset).collect(),
        })
    }

    /// Expected error of the tool over the task under `conditions`, without further views until then.
    #[must_use]
    pub fn tool_error_m(&self, conditions: &Conditions) -> Option<Summary> {
        self.tool_error_under_m(&self.estimator.covariance(conditions)?, conditions)
    }

    /// U95 of the tool at estimated `angles`, now, m.
    #[must_use]
    pub fn u95_at_m(&self, angles: &JointAngles) -> Option<f64> {
        let covariance = self.estimator.covariance(&self.conditions)?;
        let covariance_m2 = self.tool_covariance_m2(&covariance, &self.sensors(), angles, &self.conditions);
        Some(ErrorDistribution::new(&covariance_m2, f64::INFINITY)?.u95_m())
    }

    fn tool_covariance_m2(
        &self,
        covariance: &ParameterCovariance,
        sensors: &ArmSensors,
        angles: &JointAngles,
        conditions: &Conditions,
    ) -> Matrix3<f64> {
        // What drifts is in the covariance already.
        let at = Conditions { stamp: sensors.reference.stamp, ..*conditions };
        covariance.tool_position_under_m2(&self.robot, sensors, angles, &at)
    }

    fn tool_error_under_m(&self, covariance: &ParameterCovariance, conditions: &Conditions) -> Option<Summary> {
        let sensors = self.sensors();
        let error_m =
            |angles| self.tool_covariance_m2(covariance, &sensors, angles, conditions).trace().max(0.0).sqrt();
        Summary::of(&self.targets.iter().map(error_m).collect::<Vec<_>>())
    }
}

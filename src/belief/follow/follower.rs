//! An online estimate that takes in messages, and its reports over time.

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
use crate::solve::covariance::{JointAt, ParameterCovariance};
use crate::solve::task_angles::task_angles;
use crate::views::view::{TaskRests, View};
use armcal_core::codes::{Code, Coded};
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, Conditions};
use armcal_core::stats::Summary;
use armcal_core::streams::{JointAngles, Mark, MarkKind, Message, ReachTask, Thermometer};
use armcal_core::time::Stamp;

/// Follows the messages of an arm: push messages, read estimate, predicted tool error and events.
///
/// Memory and time per message are bounded regardless of the length of the stream. The same messages give the same
/// estimate.
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

/// Online estimate at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BeliefRow {
    /// Stamp by the joint sensors' clock, ns since the epoch.
    pub stamp_nanos: i64,
    /// Number of views so far.
    pub views: usize,
    /// Expected tool error over the task now, one sigma in space, m.
    pub tool_error_m: Summary,
    /// Expected tool error over the task in an hour without any view, one sigma in space, m.
    pub tool_error_in_an_hour_m: Summary,
    /// Error of each joint's sensor at mid-range under the conditions at that time, and its std, rad.
    pub offset_rad: Vec<[f64; 2]>,
    /// Delay of the joint sensors' stamps against the camera's and its std, s.
    pub clock_offset_s: Option<[f64; 2]>,
    /// Lag of the sensors' temperature behind the oil's, s.
    pub temperature_lag_s: f64,
    /// Code of what speaks against all of it; absent where nothing does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub doubt: Option<Code>,
}

impl Follower {
    /// Returns a follower for `robot`; tags of a recorded survey replace the robot's own.
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

    /// Takes in a message. Returns the events that it revealed, in the order of time.
    pub fn push(&mut self, log_time: Stamp, message: &Message) -> Vec<OnlineEvent> {
        match message {
            // The first survey counts, as in a calibration.
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

    /// Takes in the views that are complete when no more messages come. Returns their events.
    pub fn finish(&mut self) -> Vec<OnlineEvent> {
        let views = self.views.finish();
        self.add(views)
    }

    /// Takes in views from elsewhere, for instance of an external recording. Returns their events.
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

    /// Sets the targets at which tool errors are predicted; if none is within reach, the stowed configuration stays.
    pub fn set_task(&mut self, task: &ReachTask) {
        let rests = std::collections::BTreeMap::new();
        let targets = task_angles(&self.robot, TaskRests { task, rests: &rests, views: &[] });
        self.tolerance_m = Some(task.tolerance_m);
        if !targets.is_empty() {
            self.targets = targets;
        }
    }

    /// Returns true if the decision rule accepts every target of the task, and false under a [`Self::doubt`]. Without a
    /// doubt it is `None` without a task or an estimate.
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

    /// Declares that a joint without a sensor stands still at its believed angle, with the std `std_rad`, rad.
    pub fn stands_still(&mut self, joint: usize, std_rad: f64) {
        self.estimator.stands_still(joint, std_rad);
    }

    /// Returns the estimator.
    #[must_use]
    pub fn estimator(&self) -> &OnlineEstimator {
        &self.estimator
    }

    /// Returns the estimated sensors under the present conditions; those of the datasheet before the first view.
    #[must_use]
    pub fn sensors(&self) -> ArmSensors {
        let Some(parameters) = self.estimator.parameters() else { return ArmSensors::nominal(&self.robot) };
        let mut sensors = parameters.sensors(&self.robot);
        // The reference is lowered by the excess of the sensors' temperature over the oil's.
        let at_sensors = self.estimator.at_sensors(&self.conditions);
        if let (Some(reference_c), Some(oil_c), Some(sensor_c)) =
            (&mut sensors.reference.oil_c, self.conditions.oil_c, at_sensors.oil_c)
        {
            *reference_c += oil_c - sensor_c;
        }
        sensors
    }

    /// Returns the latest temperatures, pressure and time.
    #[must_use]
    pub fn conditions(&self) -> &Conditions {
        &self.conditions
    }

    /// Returns the present estimate; `None` before the first view.
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

    /// Returns the expected tool error over the task under `conditions`, without further views until then, m.
    #[must_use]
    pub fn tool_error_m(&self, conditions: &Conditions) -> Option<Summary> {
        self.tool_error_under_m(&self.estimator.covariance(conditions)?, conditions)
    }

    /// Returns U95 of the tool at estimated `angles`, now, m.
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
        // The covariance already includes drift.
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

//! Measures an unknown sensor scale, counts per radian: first a small excursion that is safe for every scale, then a
//! larger one that is safe for the remaining scales.

use crate::plan::{JointErrorBounds, Path, UnknownScale};
use crate::session::SessionError;
use crate::session::constants::scale_identification::{DWELL_S, LEAST_SHARE, LOCAL_SLOPE, SHRINK, SIGMAS};
use crate::session::motion::MotionOutcome;
use crate::session::runner::ScriptRunner;
use crate::views::association::associate;
use crate::views::scale_identification::{IdentifiedScale, identify_scales};
use armcal_core::robot::Robot;
use armcal_core::routine::IdentifySettings;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointAngles, LogLevel, MarkKind, Phase};

impl ScriptRunner<'_, '_> {
    pub(crate) fn identify(&mut self, step: usize, settings: &IdentifySettings) -> Result<(), SessionError> {
        let joints = self.robot.joint_names();
        let Some(joint) = joints.iter().position(|name| *name == settings.joint) else {
            return Err(SessionError::UnknownJoint { step, joint: settings.joint.clone(), joints });
        };
        self.driver.phase(Phase::Capture)?;
        self.progress_at(Phase::Capture, 0, 2);
        // The arm lies at its stowed pose, regardless of this sensor.
        let rest_rad = self.robot.stowed[joint];
        let mut sensors = self.driver.sensors.clone();
        let model = &mut sensors.models[joint];
        let travel_rad = model.nominal_travel_rad(self.driver.counts()?[joint]);
        model.correction.offset_rad = rest_rad - model.spec.center_rad - travel_rad;
        self.driver.believe(sensors);

        let small_rad = settings.travel_counts / self.robot.sensors[joint].counts_per_rad.abs();
        let mut unknown = UnknownScale { joint, rest_rad, gain_max: settings.gain_max };
        let clear_rad = self.clear_excursion(step, &unknown, small_rad)?;
        self.excursion(joint, &[0.0, clear_rad, -clear_rad])?;
        let rough = self.measured(joint)?.0;

        let gain = 1.0 / rough.ratio.abs();
        unknown.gain_max = gain * (1.0 + SIGMAS * rough.relative_std + LOCAL_SLOPE);
        self.progress_at(Phase::Capture, 1, 2);
        let clear_rad = self.clear_excursion(step, &unknown, settings.swing_rad / gain)?;
        let last = f64::from(settings.views - 1);
        let offsets: Vec<f64> =
            (0..settings.views).map(|k| clear_rad * (2.0 * f64::from(k) / last - 1.0)).chain([0.0]).collect();
        self.excursion(joint, &offsets)?;
        let (scale, mut robot) = self.measured(joint)?;
        self.driver.log(
            LogLevel::Info,
            &format!(
                "{} has {:.4} times the datasheet's counts per radian (+- {:.2} %)",
                settings.joint,
                scale.ratio,
                100.0 * scale.relative_std
            ),
        )?;
        let spec = &mut robot.sensors[joint];
        spec.gain_bound = spec.gain_bound.max(SIGMAS * scale.relative_std + LOCAL_SLOPE);
        self.take_over(robot)
    }

    /// Returns the largest excursion up to `wanted_rad` (believed) that keeps clear for every possible scale.
    fn clear_excursion(&self, step: usize, unknown: &UnknownScale, wanted_rad: f64) -> Result<f64, SessionError> {
        let bounds = JointErrorBounds::with_unknown_scale(&self.robot, unknown);
        let at = self.driver.set_point();
        let mut excursion_rad = wanted_rad;
        let mut nearest = String::new();
        while excursion_rad > LEAST_SHARE * wanted_rad {
            // The error box at the end of the excursion contains every angle that the joint may pass on the way.
            let end = JointAngles::from_fn(at.len(), |j| {
                if j == unknown.joint { unknown.rest_rad + excursion_rad } else { at[j] }
            });
            let Some(found) = self.clearance.find_violation_arriving(&end, &bounds, self.margin_m()) else {
                return Ok(excursion_rad);
            };
            nearest = found.to_string();
            excursion_rad *= SHRINK;
        }
        let problem = format!("the joint cannot be moved far enough to measure its scale: {nearest} come too close");
        Err(SessionError::Step { step, problem })
    }

    /// Moves the joint to its rest plus each offset (believed, rad) and captures a view there.
    fn excursion(&mut self, joint: usize, offsets_rad: &[f64]) -> Result<(), SessionError> {
        let rest = JointAngles::from_fn(self.robot.n_joints(), |j| {
            if j == joint { self.robot.stowed[j] } else { self.driver.set_point()[j] }
        });
        for offset_rad in offsets_rad {
            let to = JointAngles::from_fn(rest.len(), |j| if j == joint { rest[j] + offset_rad } else { rest[j] });
            let from = self.driver.set_point();
            let is_there = self.driver.follow(&Path::slowly(vec![from, to]))? == MotionOutcome::Arrived;
            if is_there && self.driver.settle()? {
                self.driver.dwell(DWELL_S, MarkKind::Identify { joint_idx: joint as u32 })?;
            } else {
                self.driver.log(LogLevel::Warn, "a view is left out: the arm did not come there or did not settle")?;
            }
        }
        Ok(())
    }

    /// Returns the scale by all views so far, from the recording's bytes, and the robot with it.
    fn measured(&mut self, joint: usize) -> Result<(IdentifiedScale, Robot), SessionError> {
        let recording = self.driver.recorder.read_back()?;
        let (robot, scales) = identify_scales(&associate(&recording, self.setup.robot), self.setup.robot)?;
        let scale = scales.into_iter().find(|scale| scale.joint == joint).ok_or(SessionError::NoReadings)?;
        Ok((scale, robot))
    }

    /// Adopts the measured scale; from here on the sensor is an ordinary one.
    fn take_over(&mut self, robot: Robot) -> Result<(), SessionError> {
        let sensors = ArmSensors::nominal(&robot);
        self.bounds = JointErrorBounds::datasheet(&robot);
        self.robot = robot;
        self.driver.believe(sensors.clone());
        self.epochs[0].sensors = sensors;
        self.epochs[0].from = self.driver.now();
        if self.every_scale_is_known() { self.prepare() } else { Ok(()) }
    }

    fn every_scale_is_known(&self) -> bool {
        let steps = &self.setup.routine.steps;
        let to_measure = steps.iter().filter(|step| matches!(step, armcal_core::routine::Step::Identify(_))).count();
        self.scales_measured() == to_measure
    }

    /// Returns the number of sensors whose scale differs from the datasheet's by now.
    fn scales_measured(&self) -> usize {
        let differs = |(now, drawn): (&armcal_core::robot::JointSensorSpec, &armcal_core::robot::JointSensorSpec)| {
            now.counts_per_rad != drawn.counts_per_rad
        };
        self.robot.sensors.iter().zip(&self.setup.robot.sensors).filter(|pair| differs(*pair)).count()
    }
}

//! Interim estimates during a capture.
//!
//! After every few views the recording so far is estimated. Set-points, margins and the remaining poses then follow the
//! interim estimate. The final calibration replaces it; if that is refused, the belief before the capture returns.

use crate::batch::interim::interim_estimate;
use crate::file::calibration::Calibration;
use crate::plan::JointErrorBounds;
use crate::session::SessionError;
use crate::session::runner::{SavedBelief, ScriptRunner};
use crate::session::tool_belief::Certainty;
use armcal_core::routine::{CaptureSettings, Margins, Method};
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointAngles, LogLevel};

impl ScriptRunner<'_, '_> {
    /// True if this capture updates the estimate between views.
    pub(crate) fn replans(&self, capture: &CaptureSettings) -> bool {
        capture.replan_every > 0 && self.setup.routine.method == Method::Bundle
    }

    /// Returns the bounds for which clearance is kept.
    pub(crate) fn kept_clear(&self, bounds: JointErrorBounds) -> JointErrorBounds {
        match self.setup.routine.capture.margins {
            Margins::Belief => bounds,
            Margins::Off => JointErrorBounds::none(&self.robot),
        }
    }

    /// Estimates from the views captured since the last calibration and continues with the result. If nothing can be
    /// estimated yet, it keeps the belief before.
    pub(crate) fn update_estimate(&mut self) -> Result<Option<Calibration>, SessionError> {
        let recording = self.driver.recorder.read_back()?;
        let began_s = self.driver.progress.wall_s();
        let accepted = self.accepted.as_ref();
        let mut found = interim_estimate(&recording, self.setup.robot, self.views_since, accepted);
        if accepted.is_some() && found.is_err() {
            // The arm may have changed since the accepted calibration, so only the new views describe it.
            found = interim_estimate(&recording, self.setup.robot, self.views_since, None);
        }
        self.tally.calibration_wall_s += self.driver.progress.wall_s() - began_s;
        let calibration = match found {
            Ok(calibration) => calibration,
            Err(why) => {
                self.driver.log(LogLevel::Info, &format!("the views so far change nothing: {why}"))?;
                return Ok(None);
            }
        };
        let Ok(sensors) = calibration.sensors(self.setup.robot) else { return Ok(None) };
        if self.before_running.is_none() {
            let (sensors, bounds) = (self.driver.sensors.clone(), self.bounds.clone());
            self.before_running = Some(SavedBelief { sensors, bounds, fresh: self.fresh.take() });
        }
        self.bounds = self.kept_clear(self.bounds_of(&calibration, &sensors));
        self.locate_held(&calibration);
        self.hold_failed();
        self.driver.believe(sensors);
        self.note_belief(Certainty::Interim(Box::new(calibration.clone())));
        Ok(Some(calibration))
    }

    /// Restores the belief before the interim estimates, because the views gave no calibration.
    pub(crate) fn forget_running(&mut self) {
        let Some(SavedBelief { sensors, bounds, fresh }) = self.before_running.take() else { return };
        (self.bounds, self.fresh) = (bounds, fresh);
        self.hold_failed();
        self.driver.believe(sensors);
        let is_calibrated = self.epochs.last().is_some_and(|epoch| epoch.calibration.is_some());
        self.note_belief(if is_calibrated { Certainty::Calibration } else { Certainty::Datasheet });
    }

    pub(crate) fn bounds_of(&self, calibration: &Calibration, sensors: &ArmSensors) -> JointErrorBounds {
        JointErrorBounds::believed(&calibration.scaled_robot(self.setup.robot), calibration, sensors)
    }

    /// Returns the expected root mean square tool error of `calibration` over the task, m; `None` without a task.
    pub(crate) fn expected_tool_error_m(&self, calibration: &Calibration) -> Option<f64> {
        if !self.driver.held.is_empty() {
            return calibration.predicted_tool_error_m.map(|summary| summary.median);
        }
        let targets: &[JointAngles] = &self.planned.as_ref()?.targets;
        let robot = calibration.scaled_robot(self.setup.robot);
        let sensors = calibration.sensors(&robot).ok()?;
        let covariance = calibration.parameter_covariance(&robot);
        let sum: f64 = targets.iter().map(|at| covariance.tool_position_m2(&robot, &sensors, at).trace()).sum();
        let mean = sum / targets.len() as f64;
        (!targets.is_empty() && mean.is_finite()).then(|| mean.max(0.0).sqrt())
    }
}

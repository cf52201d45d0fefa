//! Works with the online estimate, and requests a calibration pose or two if the next task would miss its tolerance.

use crate::plan::JointErrorBounds;
use crate::say::finding::FindingKind;
use crate::session::SessionError;
use crate::session::constants::keeping_up::LOCATING_POSES;
use crate::session::held_joint::{HeldJoint, StandingJoint};
use crate::session::online_belief::{AskedPoses, OnlineBelief, OnlineOutcome};
use crate::session::outcome::Epoch;
use crate::session::reach::OrReason;
use crate::session::runner::ScriptRunner;
use crate::session::tool_belief::Certainty;
use armcal_core::robot::FailedKind;
use armcal_core::routine::{CalibrateSettings, CalibrateViews, CaptureSettings, OnRefusal, WorkSettings};
use armcal_core::streams::{JointAngles, LogLevel, PriorSource};

impl ScriptRunner<'_, '_> {
    /// Follows the recording from its start and all later messages, for the arm with its believed links and scales.
    pub(crate) fn begin_online(&mut self) -> Result<(), SessionError> {
        let so_far = self.driver.recorder.read_back()?;
        let mut online = OnlineBelief::of(self.robot.clone(), &so_far);
        // The calibration includes earlier events.
        online.take_events();
        self.driver.recorder.online = Some(online);
        if self.accepted.is_none() {
            let text = "no calibration was accepted: the online belief is told of, and not worked by";
            self.driver.log(LogLevel::Warn, text)?;
        }
        Ok(())
    }

    /// Prepares a task: reports events, updates the belief, and requests views if they are needed. Returns the reason
    /// if the tool is still not known well enough for the task.
    pub(crate) fn keep_up(
        &mut self,
        settings: &WorkSettings,
        number: u32,
        rest: &JointAngles,
    ) -> Result<OrReason<()>, SessionError> {
        self.take_up_news()?;
        if self.accepted.is_none() {
            return Ok(Ok(()));
        }
        if settings.poses > 0 {
            self.locate_given_up()?;
        }
        if let Some(held) = self.driver.held.iter().find(|held| self.is_needed_and_lost(held)) {
            let joint = &self.robot.sensors[held.joint].joint;
            return Ok(Err(format!("{joint} was given up, and nobody knows where it stands")));
        }
        let Ok(posture) = self.postures_near(&[settings.target_of(number)], &[*rest])?.remove(0) else {
            // The motion itself reports why the target is out of reach.
            return Ok(Ok(()));
        };
        if settings.poses > 0 {
            self.ask_for_poses(settings.poses, &posture)?;
        }
        let tolerance_m = self.setup.routine.task.tolerance_m;
        Ok(match self.u95_m(&posture).filter(|error_m| *error_m > tolerance_m) {
            Some(error_m) => Err(format!(
                "the tool may be off by up to {:.1} mm (95 %), {:.1} are allowed",
                1e3 * error_m,
                1e3 * tolerance_m
            )),
            None => Ok(()),
        })
    }

    /// Requests calibration poses if the tool would miss its tolerance at `posture`. Joints without a sensor that were
    /// located long ago are located again first.
    fn ask_for_poses(&mut self, poses: u32, posture: &JointAngles) -> Result<(), SessionError> {
        let (now, tolerance_m) = (self.driver.now(), self.setup.routine.task.tolerance_m);
        let mut error_m = self.u95_m(posture).unwrap_or(0.0);
        if error_m > tolerance_m && self.standing.iter().any(|stands| stands.is_old(now)) {
            self.locate()?;
            self.take_up_news()?;
            error_m = self.u95_m(posture).unwrap_or(0.0);
        }
        if error_m <= tolerance_m {
            return Ok(());
        }
        let [off_mm, allowed_mm] = [error_m, tolerance_m].map(|error_m| 1e3 * error_m);
        let text = format!(
            "the tool would be off by up to {off_mm:.1} mm (95 %), {allowed_mm:.1} are allowed: {poses} \
             calibration poses"
        );
        self.driver.log(LogLevel::Info, &text)?;
        self.known = self.driver.recorder.online.as_ref().and_then(OnlineBelief::covariance);
        let (time_s, views) = self.capture_between(poses)?;
        self.known = None;
        self.take_up_news()?;
        let after_m = self.u95_m(posture).unwrap_or(error_m);
        self.note_asked(time_s, views, Some([error_m, after_m]));
        Ok(())
    }

    fn note_asked(&mut self, time_s: f64, views: usize, u95_m: Option<[f64; 2]>) {
        let arm_time_s = self.driver.elapsed_s() - time_s;
        self.asked.push(AskedPoses { time_s, views, arm_time_s, u95_m });
    }

    /// True if the joint is proximal to the tool, and was not found standing still.
    fn is_needed_and_lost(&self, held: &HeldJoint) -> bool {
        let is_found = self.standing.iter().any(|stands| stands.joint == held.joint);
        held.joint < self.robot.tool.mount.n_joints && !is_found && held.locked_std_rad().is_none()
    }

    /// Locates held joints by views, because no sensor does.
    fn locate_given_up(&mut self) -> Result<(), SessionError> {
        let n_held = self.driver.held.len();
        if self.unlocated().is_none() || n_held <= self.n_looked_for {
            return Ok(());
        }
        self.n_looked_for = n_held;
        self.locate()
    }

    /// Captures as many views as a calibration needs, and calibrates.
    fn locate(&mut self) -> Result<(), SessionError> {
        self.driver.log(LogLevel::Info, "calibrates to find where the joints stand that were given up")?;
        self.standing.clear();
        let (time_s, views) = self.capture_between(LOCATING_POSES)?;
        if views > 0 {
            let links = self.epochs.last().map(Epoch::links);
            // An earlier calibration may be hours old.
            let prior = PriorSource::Fresh;
            let settings = CalibrateSettings { prior, views: CalibrateViews::New, on_refusal: OnRefusal::Continue };
            match self.try_calibrate(&settings) {
                Ok(None) => self.note_standing(),
                // Views of a creeping joint contradict each other.
                Ok(Some(_refused)) => {}
                // Too few views show tags; the arm continues without that joint.
                Err(SessionError::Calib(why)) => {
                    self.driver.log(LogLevel::Warn, &format!("where they stand is not known: {why}"))?;
                }
                Err(other) => return Err(other),
            }
            if self.epochs.last().map(Epoch::links) != links {
                self.begin_online()?;
            }
        }
        self.note_asked(time_s, views, None);
        Ok(())
    }

    /// Notes the angles of the held joints that the last calibration saw.
    fn note_standing(&mut self) {
        let since = self.driver.now();
        let located = self.driver.held.iter().filter(|held| held.is_located);
        self.standing = located.map(|held| StandingJoint::new(held, since)).collect();
    }

    /// Captures views between two tasks, and logs a failure. Returns the start, s since the start of the run, and the
    /// number of views.
    fn capture_between(&mut self, poses: u32) -> Result<(f64, usize), SessionError> {
        let (time_s, n_views) = (self.driver.elapsed_s(), self.tally.poses);
        let general = self.setup.routine.capture;
        let capture_ended = self.capture_ended.take();
        let captured = self.capture(&CaptureSettings { poses, held_out: 0, replan_every: 0, ..general });
        self.capture_ended = capture_ended;
        match captured {
            Err(
                why @ (SessionError::Plan(_) | SessionError::TooFewViews { .. } | SessionError::NothingSeen { .. }),
            ) => {
                self.driver.log(LogLevel::Warn, &format!("no calibration pose: {why}"))?;
            }
            other => other?,
        }
        Ok((time_s, self.tally.poses - n_views))
    }

    /// Reports events and updates the belief from the online estimate, if there is one.
    pub(crate) fn take_up_news(&mut self) -> Result<(), SessionError> {
        self.tell_events()?;
        let now = self.driver.now();
        let locked = self.driver.held.iter().filter_map(|held| Some((held.joint, held.locked_std_rad()?)));
        let found = self.standing.iter().map(|stands| (stands.joint, stands.std_rad(now)));
        if let Some(online) = &mut self.driver.recorder.online {
            online.hold(locked.chain(found));
        }
        self.work_by_online();
        Ok(())
    }

    fn u95_m(&self, at: &JointAngles) -> Option<f64> {
        self.driver.recorder.online.as_ref()?.u95_at_m(at)
    }

    /// Reports events, and holds a joint whose sensor has failed.
    fn tell_events(&mut self) -> Result<(), SessionError> {
        let events = self.driver.recorder.online.as_mut().map(OnlineBelief::take_events);
        for event in events.unwrap_or_default() {
            self.driver.log(LogLevel::Warn, &format!("online: {}", event.to_line()))?;
            let joint = self.robot.sensors.iter().position(|spec| spec.joint == event.finding.name);
            let is_held = |joint: &usize| self.driver.held.iter().any(|held| held.joint == *joint);
            if event.finding.kind == FindingKind::SensorFailed
                && let Some(joint) = joint.filter(|joint| !is_held(joint))
            {
                self.driver.hold_joint(joint, FailedKind::Dead)?;
            }
        }
        self.take_up_failures();
        Ok(())
    }

    /// Adopts the online estimate as the belief, once a calibration was accepted.
    fn work_by_online(&mut self) {
        let Some(online) = self.driver.recorder.online.as_ref().filter(|_| self.accepted.is_some()) else { return };
        let Some(covariance) = online.covariance() else { return };
        let sensors = online.sensors();
        let bounds = JointErrorBounds::by_covariance(&self.robot, &covariance, &sensors);
        // The covariance includes the effects of time and temperature since then.
        self.fresh = None;
        self.bounds = self.kept_clear(bounds);
        self.hold_failed();
        self.driver.believe(sensors);
        self.note_belief(Certainty::Online(covariance));
    }

    /// Returns the outcome of the online estimate at the end.
    pub(crate) fn end_online(&mut self) -> Option<OnlineOutcome> {
        let asked = std::mem::take(&mut self.asked);
        Some(self.driver.recorder.online.take()?.end(asked))
    }
}

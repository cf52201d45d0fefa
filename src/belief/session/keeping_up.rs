//! Works by the online belief, and asks for a calibration pose or two where the next task would miss its tolerance.

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
    /// Follows the recording from its start, and what comes from now on: as the arm is believed to be by its links and
    /// scales.
    pub(crate) fn begin_online(&mut self) -> Result<(), SessionError> {
        let so_far = self.driver.recorder.read_back()?;
        let mut online = OnlineBelief::of(self.robot.clone(), &so_far);
        // What happened before is in the calibration.
        online.take_events();
        self.driver.recorder.online = Some(online);
        if self.accepted.is_none() {
            let text = "no calibration was accepted: the online belief is told of, and not worked by";
            self.driver.log(LogLevel::Warn, text)?;
        }
        Ok(())
    }

    /// Before a task: what happened is told, the belief of now is worked by, and views are asked for where they are
    /// needed. Gives the reason where the tool is still not known well enough for the task.
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
            // Why it is out of reach is told where it is gone to.
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

    /// Calibration poses, where the tool would miss its tolerance at `posture`. What was found of joints without a
    /// sensor long ago is looked for again first.
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

    /// A joint before the tool that was given up and was not found standing still.
    fn is_needed_and_lost(&self, held: &HeldJoint) -> bool {
        let is_found = self.standing.iter().any(|stands| stands.joint == held.joint);
        held.joint < self.robot.tool.mount.n_joints && !is_found && held.locked_std_rad().is_none()
    }

    /// Where a joint that was given up stands, only views can tell.
    fn locate_given_up(&mut self) -> Result<(), SessionError> {
        let n_held = self.driver.held.len();
        if self.unlocated().is_none() || n_held <= self.n_looked_for {
            return Ok(());
        }
        self.n_looked_for = n_held;
        self.locate()
    }

    /// A capture and a calibration of its views, as many as one needs.
    fn locate(&mut self) -> Result<(), SessionError> {
        self.driver.log(LogLevel::Info, "calibrates to find where the joints stand that were given up")?;
        self.standing.clear();
        let (time_s, views) = self.capture_between(LOCATING_POSES)?;
        if views > 0 {
            let links = self.epochs.last().map(Epoch::links);
            // What was accepted before may be hours old.
            let prior = PriorSource::Fresh;
            let settings = CalibrateSettings { prior, views: CalibrateViews::New, on_refusal: OnRefusal::Continue };
            match self.try_calibrate(&settings) {
                Ok(None) => self.note_standing(),
                // Views of a joint that creeps contradict each other.
                Ok(Some(_refused)) => {}
                // Too few of them show tags; the arm does what it can do without that joint.
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

    /// Notes where the joints stand that were given up and that the last calibration saw.
    fn note_standing(&mut self) {
        let since = self.driver.now();
        let located = self.driver.held.iter().filter(|held| held.is_located);
        self.standing = located.map(|held| StandingJoint::new(held, since)).collect();
    }

    /// A capture between two tasks; one that comes to nothing is told of. When it began, s since the start, and its
    /// views.
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

    /// What happened is told, and the belief of now is worked by; nothing where none is followed.
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

    /// A joint whose sensor says nothing any more is given up.
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

    /// From now on the arm is believed to be as it is believed online, once a calibration was accepted.
    fn work_by_online(&mut self) {
        let Some(online) = self.driver.recorder.online.as_ref().filter(|_| self.accepted.is_some()) else { return };
        let Some(covariance) = online.covariance() else { return };
        let sensors = online.sensors();
        let bounds = JointErrorBounds::by_covariance(&self.robot, &covariance, &sensors);
        // What time and temperature may have done since is in the covariance.
        self.fresh = None;
        self.bounds = self.kept_clear(bounds);
        self.hold_failed();
        self.driver.believe(sensors);
        self.note_belief(Certainty::Online(covariance));
    }

    /// What is left of it at the end.
    pub(crate) fn end_online(&mut self) -> Option<OnlineOutcome> {
        let asked = std::mem::take(&mut self.asked);
        Some(self.driver.recorder.online.take()?.end(asked))
    }
}

//! Drives an arm along believed angles and waits until its own sensors show that it stands, or has made contact.

use crate::session::constants::motion::{BACK_OUT_SLOWNESS, BELIEF_EVERY, REST_S, SETTLE_LIMIT_S, WAIT_STRIDE_S};
use nalgebra::Vector3;

use crate::plan::{Edge, Path, Timing};
use crate::session::contact::{ContactDetector, ContactEvent};
use crate::session::flow::FlowWatch;
use crate::session::following::{FollowWatch, Unmoved};
use crate::session::held_joint::{HeldJoint, holding_counts, holding_sensors, with_held};
use crate::session::settling::{NEAR_RAD, SettlingDetector};
use crate::session::{MotionAhead, Progress, Recorder, SessionError};
use armcal_core::robot::{FailedJoint, FailedKind, Robot, Vehicle};
use armcal_core::routine::TaskSettings;
use armcal_core::sensor::{ArmSensors, Conditions};
use armcal_core::streams::{
    Arm, ArmError, ImageDemand, JointAngles, JointCommand, JointCounts, JointStateBelief, LogLevel, LogLine, Mark,
    MarkKind, Message, Phase, ReachTask, RecordedSurvey, Sink,
};
use armcal_core::time::Stamp;
use armcal_core::units::Unit;

/// The arm, its recorder, and the presently believed sensors.
pub(crate) struct Driver<'b> {
    robot: &'b Robot,
    pub(crate) arm: &'b mut dyn Arm,
    pub recorder: &'b mut Recorder,
    pub sensors: ArmSensors,
    pub progress: &'b mut dyn Progress,
    start: Stamp,
    /// Last commanded set-point, believed angles.
    set_point: JointAngles,
    ticks: u64,
    pub motion_s: f64,
    pub waited_s: f64,
    timing: Timing,
    bumps: ContactDetector,
    following: FollowWatch,
    pub flow: FlowWatch,
    /// Number of contacts so far.
    pub n_met: usize,
    /// Reason why there was no path the last time.
    pub why_blocked: Option<String>,
    /// Failed joints that are held in place.
    pub held: Vec<HeldJoint>,
    /// Waypoints of the last motion, for the way back.
    came: Vec<JointAngles>,
}

/// Outcome of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub enum MotionOutcome {
    Arrived,
    /// The joint was held up or pushed off; the arm has backed out along its path.
    Bumped {
        joint: usize,
        /// Believed angles when the arm stopped.
        at: JointAngles,
    },
}

/// Contact monitoring during a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ContactMonitoring {
    Bumps,
    Nothing,
}

/// Outcome of waiting for rest.
enum SettleOutcome {
    Still,
    PushedOff(ContactEvent),
}

impl<'b> Driver<'b> {
    pub fn new(
        robot: &'b Robot,
        arm: &'b mut dyn Arm,
        recorder: &'b mut Recorder,
        sensors: ArmSensors,
        progress: &'b mut dyn Progress,
    ) -> Result<Self, SessionError> {
        let start = arm.now();
        // One period gives the first readings.
        arm.step(recorder)?;
        let counts = recorder.latest_counts.ok_or(SessionError::NoReadings)?;
        // Initial sensors are the datasheet's, the same under all conditions.
        let set_point = sensors.angles(&counts);
        let (timing, bumps) = (Timing::new(robot), ContactDetector::new(robot, arm.period_s()));
        let following = FollowWatch::new(robot, arm.period_s());
        let flow = FlowWatch::new(robot, arm.period_s());
        let mut driver = Self {
            robot,
            arm,
            recorder,
            sensors,
            progress,
            start,
            set_point,
            ticks: 0,
            motion_s: 0.0,
            waited_s: 0.0,
            timing,
            bumps,
            following,
            flow,
            n_met: 0,
            why_blocked: None,
            held: Vec::new(),
            came: vec![set_point],
        };
        driver.command()?;
        Ok(driver)
    }

    /// Returns the message about a joint whose reading stands still although it was commanded to move, if there is one.
    pub fn unmoved_joint(&self) -> Option<String> {
        let Unmoved { joint, still_s, asked_rad } = self.following.unmoved()?;
        let spec = &self.robot.sensors[joint];
        let unit = if spec.moves.is_slide() { Unit::Metres } else { Unit::Radians };
        Some(format!(
            "the reading of {} has not moved for {still_s:.0} s, though it was commanded {} away: its sensor is stuck \
             or not connected, or the joint is blocked",
            spec.joint,
            unit.shown(asked_rad, 0)
        ))
    }

    pub fn elapsed_s(&self) -> f64 {
        self.arm.now().since_s(self.start)
    }

    pub fn now(&self) -> Stamp {
        self.arm.now()
    }

    pub fn set_point(&self) -> JointAngles {
        self.set_point
    }

    /// Returns the believed angles by the latest readings.
    pub fn believed_angles(&self) -> Result<JointAngles, SessionError> {
        Ok(self.sensors.angles_under(&self.counts()?, &self.conditions()))
    }

    /// Returns the latest measured conditions.
    pub fn conditions(&self) -> Conditions {
        let Recorder { oil_c, pressure_pa, .. } = *self.recorder;
        Conditions { oil_c, pressure_pa, stamp: Some(self.arm.now()) }
    }

    /// Returns the readings at the set-point by the present sensors.
    fn set_point_counts(&self) -> JointCounts {
        holding_counts(&self.held, self.sensors.counts_under(&self.set_point, &self.conditions()))
    }

    /// Returns the latest raw readings.
    pub fn counts(&self) -> Result<JointCounts, SessionError> {
        self.recorder.latest_counts.ok_or(SessionError::NoReadings)
    }

    /// Lets time pass with the arm at rest.
    pub fn wait(&mut self, seconds: f64) -> Result<(), SessionError> {
        let before = self.arm.now();
        let until = before.plus_s(seconds);
        while self.arm.now() < until {
            if self.progress.stop_requested() {
                return Err(self.interrupt()?);
            }
            self.arm.idle(until.since_s(self.arm.now()).min(WAIT_STRIDE_S), self.recorder)?;
        }
        self.waited_s += self.arm.now().since_s(before);
        Ok(())
    }

    pub fn fault(&mut self, number: usize) -> Result<(), SessionError> {
        Ok(self.arm.fault(number)?)
    }

    /// Replaces the believed sensors; the arm does not move, only its believed angles change.
    pub fn believe(&mut self, sensors: ArmSensors) {
        let sensors = holding_sensors(&self.held, sensors);
        self.set_point = sensors.angles_under(&self.set_point_counts(), &self.conditions());
        self.sensors = sensors;
    }

    /// Declares a joint failed: it is held in place, and the recording says so.
    pub fn hold_joint(&mut self, joint: usize, kind: FailedKind) -> Result<(), SessionError> {
        let counts = self.counts()?[joint];
        let read_rad = self.believed_angles()?[joint];
        // The reading of a broken wire gives no information: the joint was near its set-point before.
        let angle_rad = if kind == FailedKind::Dead { self.set_point[joint] } else { read_rad };
        let (since, astray_rad) = (self.arm.now(), HeldJoint::astray_rad(self.robot, joint, kind));
        let is_located = kind == FailedKind::Locked;
        self.held.push(HeldJoint { joint, kind, since, counts, angle_rad, bound_rad: astray_rad, is_located });
        self.believe(self.sensors.clone());
        self.command()?;
        // A lost sensor is one thing; that the joint stands at one angle from now on is another.
        let lost = Some(kind).filter(|kind| matches!(kind, FailedKind::Dead | FailedKind::Stuck));
        let marks: Vec<FailedJoint> =
            lost.into_iter().chain([FailedKind::Locked]).map(|kind| FailedJoint { joint, kind }).collect();
        self.record_failed(&marks)?;
        let what = match kind {
            FailedKind::Stuck => "its reading stands still to the count while its set-point moves",
            FailedKind::Dead => "its reading jumped farther than a joint can move, and stayed there",
            FailedKind::Locked | FailedKind::NotMoved => "it does not leave the place where it rested",
            FailedKind::Jumps => "its readings jump",
        };
        let name = &self.robot.sensors[joint].joint;
        let text =
            format!("{name} does not follow its set-points: {what}. It is held where it is, and plans do without it");
        self.log(LogLevel::Warn, &text)
    }

    /// Holds the joints that have stayed at rest while their set-points left.
    fn hold_unmoved(&mut self, is_suspect: impl Fn(usize, f64) -> bool) -> Result<bool, SessionError> {
        let believed = self.believed_angles()?;
        let n_held = self.held.len();
        for joint in 0..believed.len() {
            let off_rad = (self.set_point[joint] - believed[joint]).abs();
            if is_suspect(joint, off_rad) && !self.is_held(joint) && self.following.is_locked(joint) {
                self.hold_joint(joint, FailedKind::Locked)?;
            }
        }
        Ok(self.held.len() > n_held)
    }

    /// Stops at the present angles; motion that still decays then is no contact.
    fn stop_here(&mut self) -> Result<(), SessionError> {
        self.set_point = self.believed_angles()?;
        self.command()?;
        self.hold(REST_S)?;
        self.came = vec![self.set_point];
        self.bumps.forget();
        let _ = self.stand()?;
        Ok(())
    }

    /// Limits every joint's rate from now on; `None` restores the limits of the robot's file.
    pub(crate) fn limit_rates(&mut self, rate_rad_s: Option<f64>) {
        let full = Timing::new(self.robot);
        self.timing = rate_rad_s.map_or(full.clone(), |rate| full.limited_to(rate));
    }

    pub fn record(&mut self, message: &Message) -> Result<(), SessionError> {
        let now = self.arm.now();
        self.recorder.record(now, message).map_err(ArmError::Sink)?;
        Ok(())
    }

    pub fn record_task(&mut self, task: &TaskSettings) -> Result<(), SessionError> {
        let stamp = self.arm.now();
        let (targets_m, tolerance_m) = (task.targets_m.clone(), task.tolerance_m);
        self.record(&Message::Task(ReachTask { stamp, targets_m, tolerance_m, poses: Vec::new() }))
    }

    /// Records the survey if the vehicle has its own: the estimator has only the recording and the robot's file.
    pub fn record_survey(&mut self, vehicle: &Vehicle) -> Result<(), SessionError> {
        let Some(survey) = &vehicle.survey else { return Ok(()) };
        self.record(&Message::Survey(RecordedSurvey::new(self.arm.now(), survey, self.robot.tag_link())))
    }

    /// The operator's declarations are recorded, because the estimator has only the recording.
    pub fn record_failed(&mut self, failed: &[FailedJoint]) -> Result<(), SessionError> {
        let now = self.arm.now();
        failed.iter().try_for_each(|failed| {
            self.record(&Message::Mark(Mark { start: now, end: now, kind: MarkKind::Failed(*failed) }))
        })
    }

    pub fn phase(&mut self, phase: Phase) -> Result<(), SessionError> {
        let now = self.arm.now();
        self.record(&Message::Mark(Mark { start: now, end: now, kind: MarkKind::Phase(phase) }))
    }

    pub fn log(&mut self, level: LogLevel, text: &str) -> Result<(), SessionError> {
        let stamp = self.arm.now();
        self.record(&Message::Log(LogLine { stamp, level, name: "session".to_owned(), text: text.to_owned() }))
    }

    fn command(&mut self) -> Result<(), SessionError> {
        let counts = self.set_point_counts();
        self.arm.command(&counts)?;
        Ok(())
    }

    pub(crate) fn step(&mut self) -> Result<(), SessionError> {
        if self.progress.stop_requested() {
            return Err(self.interrupt()?);
        }
        self.arm.step(self.recorder)?;
        let (counts, set_counts) = (self.counts()?, self.set_point_counts());
        if let Some((joint, kind)) = self.following.update(&set_counts, &counts)
            && self.held.iter().all(|held| held.joint != joint)
        {
            self.hold_joint(joint, kind)?;
        }
        self.ticks += 1;
        if self.flow.is_due(self.ticks) {
            self.flow.update([self.set_point, self.believed_angles()?]);
        }
        if self.ticks.is_multiple_of(BELIEF_EVERY) {
            let stamp = self.arm.now();
            let angles = self.believed_angles()?;
            self.record(&Message::JointStates(JointStateBelief { stamp, angles }))?;
            let counts = self.set_point_counts();
            self.record(&Message::JointCommand(JointCommand { stamp, counts }))?;
        }
        Ok(())
    }

    /// Commands the arm to stay at its last set-point, and records why it ends here.
    pub(crate) fn interrupt(&mut self) -> Result<SessionError, SessionError> {
        self.command()?;
        let (stamp, at_s) = (self.arm.now(), self.elapsed_s());
        let counts = self.set_point_counts();
        self.record(&Message::JointCommand(JointCommand { stamp, counts }))?;
        self.log(LogLevel::Warn, "stopped on request; the arm holds its last set-point")?;
        Ok(SessionError::Interrupted { at_s })
    }

    /// Returns the motion that [`Self::follow`] would make.
    pub(crate) fn ahead(&self, path: &Path, clearance_m: Option<f64>) -> MotionAhead {
        MotionAhead {
            joints: self.robot.joint_names(),
            from: self.set_point,
            to: path.waypoints.last().copied().unwrap_or(self.set_point),
            edges: path.n_edges(),
            duration_s: self.timing.path_duration_s(path),
            clearance_m,
        }
    }

    /// Stays at the set-point for `seconds`.
    pub(crate) fn hold(&mut self, seconds: f64) -> Result<(), SessionError> {
        let until = self.arm.now().plus_s(seconds);
        while self.arm.now() < until {
            self.step()?;
        }
        Ok(())
    }

    /// Moves along the path, from rest to rest on each edge. On contact it stops and backs out.
    pub fn follow(&mut self, path: &Path) -> Result<MotionOutcome, SessionError> {
        self.follow_told(path, None)
    }

    /// Moves along the path as [`Self::follow`] does, with the path's clearance for an operator who is asked.
    pub fn follow_told(&mut self, path: &Path, clearance_m: Option<f64>) -> Result<MotionOutcome, SessionError> {
        self.ask(path, clearance_m)?;
        for (n, edge) in path.edges().enumerate() {
            if let Some(bump) = self.follow_edge(&edge, ContactMonitoring::Bumps)? {
                if self.hold_unmoved(|joint, _| joint == bump.joint)? || self.is_held(bump.joint) {
                    self.stop_here()?;
                    return Ok(MotionOutcome::Bumped { joint: bump.joint, at: self.set_point });
                }
                self.following.suspect(bump.joint);
                self.came = path.waypoints[..=n].to_vec();
                return self.retreat(bump);
            }
            self.bumps.learn();
        }
        self.came.clone_from(&path.waypoints);
        Ok(MotionOutcome::Arrived)
    }

    /// Moves along the path without contact monitoring: a joint is driven against its stop, or comes from there.
    pub fn follow_unmonitored(&mut self, path: &Path) -> Result<(), SessionError> {
        self.ask(path, None)?;
        for edge in path.edges() {
            self.follow_edge(&edge, ContactMonitoring::Nothing)?;
        }
        self.bumps.forget();
        self.came.clone_from(&path.waypoints);
        Ok(())
    }

    fn is_held(&self, joint: usize) -> bool {
        self.held.iter().any(|held| held.joint == joint)
    }

    /// Makes one control period towards a set-point near the last one, without contact monitoring.
    pub(crate) fn follow_point(&mut self, to: &JointAngles) -> Result<(), SessionError> {
        self.set_point = *to;
        self.command()?;
        self.step()?;
        self.motion_s += self.arm.period_s();
        Ok(())
    }

    /// Ends an intended contact.
    pub(crate) fn forget_contact(&mut self) {
        self.bumps.forget();
        self.came = vec![self.set_point];
    }

    /// Returns the tool position by the latest readings, base frame, m.
    pub(crate) fn believed_tool_m(&self) -> Result<Vector3<f64>, SessionError> {
        Ok(self.tool_m(&self.believed_angles()?))
    }

    /// Returns the tool position at the last set-point, base frame, m.
    pub(crate) fn set_tool_m(&self) -> Vector3<f64> {
        self.tool_m(&self.set_point)
    }

    fn tool_m(&self, angles: &JointAngles) -> Vector3<f64> {
        self.robot.chain.link_poses(angles).frame(&self.robot.tool.mount).translation.vector
    }

    fn follow_edge(&mut self, edge: &Edge, heed: ContactMonitoring) -> Result<Option<ContactEvent>, SessionError> {
        let steps = (self.timing.edge_duration_s(edge) / self.arm.period_s()).ceil().max(1.0);
        for k in 1..=steps as u64 {
            let n_held = self.held.len();
            self.set_point = with_held(&self.held, &Timing::set_point(&edge.from, &edge.to, k as f64 / steps));
            self.command()?;
            self.step()?;
            if heed == ContactMonitoring::Bumps
                && let Some(failed) = self.held.get(n_held)
            {
                return Ok(Some(ContactEvent { joint: failed.joint, behind_rad: 0.0, allowed_rad: 0.0 }));
            }
            if heed == ContactMonitoring::Bumps
                && let Some(bump) = self.bumps.update(&self.set_point, &self.believed_angles()?)
                && !self.following.is_probed(bump.joint)
            {
                self.motion_s += k as f64 * self.arm.period_s();
                return Ok(Some(bump));
            }
        }
        self.motion_s += steps * self.arm.period_s();
        Ok(None)
    }

    /// Stops at the present angles and backs out slowly along the path.
    fn retreat(&mut self, bump: ContactEvent) -> Result<MotionOutcome, SessionError> {
        self.n_met += 1;
        let ContactEvent { joint, behind_rad, allowed_rad } = bump;
        let at = self.believed_angles()?;
        self.set_point = at;
        self.command()?;
        let text = format!(
            "bump: {} is {behind_rad:.3} rad from its set-point, {allowed_rad:.3} rad would still be usual; the arm \
             stops and \
             backs out along the path it came",
            self.robot.sensors[joint].joint
        );
        self.log(LogLevel::Warn, &text)?;
        let mut from = at;
        for to in std::mem::take(&mut self.came).into_iter().rev() {
            self.follow_edge(&Edge { from, to, time_scale: BACK_OUT_SLOWNESS }, ContactMonitoring::Nothing)?;
            from = to;
        }
        self.came = vec![from];
        self.bumps.forget();
        if self.stand()?.is_none() {
            self.log(LogLevel::Warn, "the arm did not settle after it had backed out")?;
        }
        Ok(MotionOutcome::Bumped { joint, at })
    }

    /// Waits until the arm stands at its set-point. Returns false if it does not within the limit, or is pushed off;
    /// then it backs out.
    pub fn settle(&mut self) -> Result<bool, SessionError> {
        match self.stand()? {
            Some(SettleOutcome::Still) => Ok(true),
            Some(SettleOutcome::PushedOff(bump)) => {
                if self.hold_unmoved(|joint, _| joint == bump.joint)? {
                    self.stop_here()?;
                } else {
                    let _ = self.retreat(bump)?;
                }
                Ok(false)
            }
            None => {
                if self.hold_unmoved(|_, off_rad| off_rad > 2.0 * NEAR_RAD)? {
                    self.stop_here()?;
                }
                Ok(false)
            }
        }
    }

    /// Waits until the arm stands at its set-point, or is pushed off it; `None` if neither happens within the limit.
    fn stand(&mut self) -> Result<Option<SettleOutcome>, SessionError> {
        let mut stillness = SettlingDetector::new(self.believed_angles()?);
        let mut waited_s = 0.0;
        while waited_s < SETTLE_LIMIT_S {
            self.step()?;
            waited_s += self.arm.period_s();
            let now = self.believed_angles()?;
            if let Some(bump) = self.bumps.update(&self.set_point, &now)
                && !self.following.is_probed(bump.joint)
            {
                return Ok(Some(SettleOutcome::PushedOff(bump)));
            }
            if stillness.update(&now, &self.set_point, self.arm.period_s()) >= REST_S {
                self.bumps.learn();
                return Ok(Some(SettleOutcome::Still));
            }
        }
        Ok(None)
    }

    /// Waits until the arm stands while `joint` is pressed against something; returns false if it does not within the
    /// limit.
    pub fn press(&mut self, joint: usize) -> Result<bool, SessionError> {
        let mut stillness = SettlingDetector::new(self.believed_angles()?);
        let mut waited_s = 0.0;
        while waited_s < SETTLE_LIMIT_S {
            self.step()?;
            waited_s += self.arm.period_s();
            let now = self.believed_angles()?;
            // The pressed joint stands at its reading, not at its set-point.
            let there = JointAngles::from_fn(now.len(), |j| if j == joint { now[j] } else { self.set_point[j] });
            if stillness.update(&now, &there, self.arm.period_s()) >= REST_S {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Stands for `seconds` and marks the span. Returns the number of tags detected in it.
    pub fn dwell(&mut self, seconds: f64, kind: MarkKind) -> Result<usize, SessionError> {
        let start = self.arm.now();
        self.recorder.begin_count()?;
        let steps = (seconds / self.arm.period_s()).ceil() as u64;
        self.arm.request_images(ImageDemand::All);
        for _ in 0..steps {
            self.step()?;
        }
        self.arm.request_images(ImageDemand::Few);
        let end = self.arm.now();
        self.record(&Message::Mark(Mark { start, end, kind }))?;
        Ok(self.recorder.tags_seen()?.n)
    }
}

#[cfg(test)]
mod tests;

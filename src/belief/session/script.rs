//! Runs the steps of a routine's script in order.

use crate::session::constants::script::{LINK_REACH_M, START_SHARES};
use std::rc::Rc;

use crate::batch::marked_calibrations::calibrate;
use crate::file::calibration::{Calibration, Status};
use crate::file::file_error::CalibrationFileError;
use crate::plan::{ClearanceModel, Elapsed, JointErrorBounds, LeastClearance, PathError, PathPlanner};
use crate::session::held_joint::with_held;
use crate::session::inputs::SessionInputs;
use crate::session::motion::{Driver, MotionOutcome};
use crate::session::outcome::{AssertResult, Epoch, Outcome, ReachStep};
use crate::session::runner::{FreshBounds, Jaws, ScriptRunner, Tally};
use crate::session::tool_belief::Certainty;
use crate::session::{Progress, Recorder, SessionError};
use armcal_core::kinematics::LinkCorrection;
use armcal_core::log::Recording;
use armcal_core::routine::{AssertFigure, AssertLimits, CalibrateSettings, CalibrateViews, MoveGoal, OnRefusal, Step};
use armcal_core::sensor::ArmSensors;
use armcal_core::stats::stream_rng;
use armcal_core::streams::{Arm, JointAngles, LogLevel, Mark, MarkKind, Message, Phase, ReachAttempt};

/// Runs the routine's script.
///
/// # Errors
/// [`SessionError`]; the recording up to then stays readable.
pub fn run(
    setup: &SessionInputs<'_>,
    arm: &mut dyn Arm,
    recorder: &mut Recorder,
    progress: &mut dyn Progress,
) -> Result<Outcome, SessionError> {
    let jaws = Jaws::new(setup, &setup.robot.chain);
    let sensors = ArmSensors::nominal(setup.robot);
    let mut driver = Driver::new(setup.robot, arm, recorder, sensors.clone(), progress)?;
    driver.record_survey(setup.vehicle)?;
    driver.phase(Phase::Plan)?;
    let began = driver.now();
    let mut run = ScriptRunner {
        setup,
        robot: setup.robot.clone(),
        bounds: JointErrorBounds::datasheet(setup.robot),
        fresh: None,
        before_running: None,
        rng: stream_rng(setup.seed, "plan"),
        clearance: Rc::clone(&jaws.at_rest),
        jaws,
        planned: None,
        began,
        views_since: began,
        touched: Vec::new(),
        poses_marked: 0,
        calibration: None,
        accepted: None,
        visits: Vec::new(),
        renewals: Vec::new(),
        capture_ended: None,
        tally: Tally::default(),
        epochs: vec![Epoch { from: began, sensors, calibration: None, certainty: Certainty::Datasheet }],
        reaches: Vec::new(),
        asserts: Vec::new(),
        n_held: 0,
        still_reachable: None,
        n_looked_for: 0,
        known: None,
        standing: Vec::new(),
        asked: Vec::new(),
        driver,
    };
    run.bounds = run.kept_clear(JointErrorBounds::datasheet(setup.robot));
    // A script that begins with a sensor's scale cannot plan before it is measured.
    if !setup.routine.steps.iter().any(|step| matches!(step, Step::Identify(_))) {
        run.prepare()?;
    }
    let stopped = run.steps()?;
    run.driver.phase(Phase::Done)?;
    run.driver.recorder.settle()?;
    run.finish(stopped)
}

impl ScriptRunner<'_, '_> {
    pub fn progress_at(&mut self, phase: Phase, done: usize, total: usize) {
        let elapsed_s = self.driver.elapsed_s();
        self.driver.progress.update(phase, done, total, elapsed_s);
    }

    /// Returns the clearance to keep, m. It includes the deviation of links from the nominal model, because clearances
    /// are computed with nominal bodies.
    pub fn margin_m(&self) -> f64 {
        let links = self.epochs.last().map(Epoch::links).unwrap_or_default();
        let by_link = |link: &LinkCorrection| link.shift_m.norm() + LINK_REACH_M * link.turn_rad.norm();
        let by_links_m: f64 = links.places.iter().map(by_link).sum();
        self.setup.routine.capture.clearance_m + by_links_m
    }

    /// Returns the calibration state of the belief: before or after a calibration.
    pub fn attempt(&self) -> ReachAttempt {
        match self.epochs.last().and_then(|epoch| epoch.calibration.as_ref()) {
            None => ReachAttempt::Before,
            Some(_) => ReachAttempt::After,
        }
    }

    /// Runs the steps. Returns the reason if it stopped before the last.
    fn steps(&mut self) -> Result<Option<String>, SessionError> {
        let routine = self.setup.routine;
        for (index, step) in routine.steps.iter().enumerate() {
            let number = index + 1;
            self.age();
            self.take_up_failures();
            match step {
                Step::Move(goal) => self.move_to(number, goal)?,
                Step::Reach(_) | Step::Work(_) => self.reach_or_work(number, step)?,
                Step::Capture(capture) => self.capture(capture).map_err(|error| after_motion(number, error))?,
                Step::Identify(settings) => {
                    self.identify(number, settings).map_err(|error| after_motion(number, error))?;
                }
                Step::Stops(settings) => self.stops(number, settings)?,
                Step::Touch(settings) => self.touch_surface(number, settings)?,
                Step::Calibrate(settings) => {
                    let refusal = self.calibrate(settings)?;
                    if let (Some(why), OnRefusal::Stop) = (refusal, settings.on_refusal) {
                        self.pass_over(&routine.steps[index + 1..], number);
                        return Ok(Some(format!("step {number}: the calibration was refused: {why}")));
                    }
                }
                Step::Grip { opening } => self.grip(number, *opening)?,
                Step::Wait { seconds } => {
                    self.driver.phase(Phase::Wait)?;
                    self.progress_at(Phase::Wait, 0, 1);
                    self.driver.wait(*seconds)?;
                }
                Step::Fault { number } => self.driver.fault(*number)?,
                Step::Assert(limits) => self.assert(number, limits),
            }
        }
        Ok(None)
    }

    fn reach_or_work(&mut self, number: usize, step: &Step) -> Result<(), SessionError> {
        let (start, attempt) = (self.driver.now(), self.attempt());
        let targets = match step {
            Step::Reach(reach) => self.reach(number, reach).map(|()| reach.targets.len())?,
            Step::Work(work) => self.work(number, work).map(|()| work.tasks as usize)?,
            _ => return Ok(()),
        };
        let (is_work, end) = (matches!(step, Step::Work(_)), self.driver.now());
        self.reaches.push(ReachStep { step: number, is_work, targets, attempt, start, end });
        Ok(())
    }

    fn finish(mut self, stopped: Option<String>) -> Result<Outcome, SessionError> {
        let online = self.end_online();
        let calibration = self
            .calibration
            .ok_or_else(|| SessionError::Step { step: 0, problem: "the script calibrated nothing".to_owned() })?;
        Ok(Outcome {
            calibration,
            poses: self.tally.poses,
            poses_skipped: self.tally.poses_skipped,
            skipped_targets: self.tally.skipped_targets,
            duration_s: self.driver.elapsed_s(),
            motion_s: self.driver.motion_s,
            waited_s: self.driver.waited_s,
            calibration_wall_s: self.tally.calibration_wall_s,
            epochs: self.epochs,
            visits: self.visits,
            renewals: self.renewals,
            capture_ended: self.capture_ended,
            reaches: self.reaches,
            asserts: self.asserts,
            stopped,
            held: self.driver.held,
            still_reachable: self.still_reachable,
            online,
        })
    }

    /// Moves to believed angles by a certified path; returns false if there is none.
    pub fn go(&mut self, to: &JointAngles) -> Result<bool, SessionError> {
        let to = &with_held(&self.driver.held, to);
        let limits = self.bounds.safe_limits(&self.robot);
        let from = self.driver.set_point();
        let (clearance, bounds, margin_m) = (&self.clearance, &self.bounds, self.margin_m());
        let mut planner = PathPlanner { clearance, bounds, limits: &limits, margin_m };
        let mut outcome = planner.plan(&from, to, &mut self.rng);
        for share in START_SHARES {
            // After a new calibration, or with open jaws, the arm may be nearer to something than it believed. It must
            // be able to leave.
            let is_stuck = match &outcome {
                Err(PathError::StartTooNear { .. }) => true,
                // It is clear at rest, but not with the tracking error of a motion.
                Err(PathError::Blocked { is_stuck, .. }) => *is_stuck || !planner.is_free_to_arrive(&from),
                _ => false,
            };
            if !is_stuck {
                break;
            }
            planner.margin_m = share * self.margin_m();
            outcome = planner.plan(&from, to, &mut self.rng);
        }
        if planner.margin_m < self.margin_m() && outcome.is_ok() {
            let text = format!("starts with {:.3} m of clearance only, and keeps as much on the way", planner.margin_m);
            self.driver.log(LogLevel::Warn, &text)?;
        }
        match outcome {
            Ok(path) => {
                let asks = self.driver.progress.wants_to_approve();
                let least = || LeastClearance::along(&self.clearance, &self.bounds, &path, planner.margin_m);
                let clearance_m = asks.then(|| least().proven_m);
                Ok(self.driver.follow_told(&path, clearance_m)? == MotionOutcome::Arrived)
            }
            Err(blocked) => {
                self.driver.log(LogLevel::Warn, &format!("a pose is left out: {blocked}"))?;
                self.driver.why_blocked = Some(blocked.to_string());
                Ok(false)
            }
        }
    }

    /// True if a path leads from here to the stowed pose, with the clearance of `clearance`.
    pub fn can_leave(&mut self, clearance: &ClearanceModel<'_>) -> bool {
        let limits = self.bounds.safe_limits(&self.robot);
        let planner = PathPlanner { clearance, bounds: &self.bounds, limits: &limits, margin_m: self.margin_m() };
        planner.plan(&self.driver.set_point(), &self.robot.stowed, &mut self.rng).is_ok()
    }

    /// Returns the believed angles of the goal.
    pub fn goal(&self, goal: &MoveGoal) -> Result<JointAngles, String> {
        match goal {
            MoveGoal::Stowed => Ok(self.robot.stowed),
            MoveGoal::Angles(angles) if angles.len() == self.robot.n_joints() => Ok(JointAngles::from_slice(angles)),
            MoveGoal::Angles(angles) => {
                Err(format!("to_rad has {} angles, the arm {} joints", angles.len(), self.robot.n_joints()))
            }
        }
    }

    fn move_to(&mut self, step: usize, goal: &MoveGoal) -> Result<(), SessionError> {
        let wrong = |problem: String| SessionError::Step { step, problem };
        let to = self.goal(goal).map_err(wrong)?;
        let to = with_held(&self.driver.held, &to);
        self.driver.phase(Phase::Move)?;
        self.progress_at(Phase::Move, 0, 1);
        if let Some(nearest) = self.clearance.find_violation_arriving(&to, &self.bounds, self.margin_m()) {
            return Err(wrong(format!(
                "the pose comes within {:.3} m of clearance between {nearest} for an arm within the sensors' error; \
                 {:.3} m are needed",
                nearest.true_distance_m(),
                nearest.needed_m(self.margin_m())
            )));
        }
        if !self.go(&to)? {
            return Err(wrong("no path leads there, or the arm met something on its way".to_owned()));
        }
        self.driver.phase(Phase::Settle)?;
        if !self.driver.settle()? {
            self.driver.log(LogLevel::Warn, "the arm did not settle after a move")?;
        }
        Ok(())
    }

    /// Calibrates from the recording's bytes. Returns the reason if the calibration was refused.
    pub(crate) fn calibrate(&mut self, settings: &CalibrateSettings) -> Result<Option<String>, SessionError> {
        let mark = self.begin_calibration(settings)?;
        self.driver.record(&mark)?;
        let recording = self.driver.recorder.read_back()?;
        self.calibrate_marked(&recording)
    }

    /// Calibrates if the views may not be enough. The recording is marked only if a calibration results, so that other
    /// readers of it do not fail there.
    pub(crate) fn try_calibrate(&mut self, settings: &CalibrateSettings) -> Result<Option<String>, SessionError> {
        let mark = self.begin_calibration(settings)?;
        let mut recording = self.driver.recorder.read_back()?;
        recording.messages.push((self.driver.now(), mark.clone()));
        let refusal = self.calibrate_marked(&recording)?;
        self.driver.record(&mark)?;
        Ok(refusal)
    }

    /// Returns the mark of the calibration's views.
    fn begin_calibration(&mut self, settings: &CalibrateSettings) -> Result<Message, SessionError> {
        self.driver.phase(Phase::Calibrate)?;
        self.progress_at(Phase::Calibrate, 0, 1);
        let end = self.driver.now();
        let start = match settings.views {
            CalibrateViews::New => self.views_since,
            CalibrateViews::All => self.began,
        };
        self.views_since = end;
        Ok(Message::Mark(Mark { start, end, kind: MarkKind::Calibrate(settings.prior) }))
    }

    fn calibrate_marked(&mut self, recording: &Recording) -> Result<Option<String>, SessionError> {
        let began_s = self.driver.progress.wall_s();
        let calibrated = calibrate(recording, self.setup.robot, self.setup.method);
        self.tally.calibration_wall_s += self.driver.progress.wall_s() - began_s;
        let calibration = calibrated?;
        self.driver.log(LogLevel::Info, &verdict_line(&calibration))?;
        if calibration.status == Status::Accepted {
            self.believe(&calibration)?;
            self.before_running = None;
            self.accepted = Some(calibration.clone());
        } else {
            self.forget_running();
        }
        self.hold_found(&calibration)?;
        let refusal = calibration.refusal.clone();
        self.calibration = Some(calibration);
        Ok(refusal)
    }

    /// Widens the bounds by the effects of time and temperature on the sensors since the calibration.
    pub fn age(&mut self) {
        let Some(fresh) = &self.fresh else { return };
        let warmed_k = self.driver.recorder.oil_c.zip(fresh.oil_c).map_or(0.0, |(now, then)| now - then);
        let age = Elapsed { seconds: self.driver.now().since_s(fresh.at), warmed_k };
        self.bounds = fresh.bounds.widened(&self.robot, age);
        self.hold_failed();
    }

    fn believe(&mut self, calibration: &Calibration) -> Result<(), SessionError> {
        let wrong = |error: CalibrationFileError| SessionError::Step { step: 0, problem: error.to_string() };
        let sensors = calibration.sensors(self.setup.robot).map_err(wrong)?;
        self.robot.chain = self.setup.robot.chain.corrected(&calibration.link_corrections());
        let are_open = Rc::ptr_eq(&self.clearance, &self.jaws.open);
        self.jaws = Jaws::new(self.setup, &self.robot.chain);
        self.clearance = Rc::clone(if are_open { &self.jaws.open } else { &self.jaws.at_rest });
        self.bounds = self.kept_clear(self.bounds_of(calibration, &sensors));
        self.locate_held(calibration);
        self.hold_failed();
        let (bounds, at, oil_c) = (self.bounds.clone(), self.driver.now(), self.driver.recorder.oil_c);
        self.fresh = Some(FreshBounds { bounds, at, oil_c });
        self.driver.believe(sensors);
        self.driver.recorder.settle()?;
        if let Some(frames) = &mut self.driver.recorder.frames {
            frames.believe(&calibration.applied_to(self.setup.robot));
        }
        self.begin_epoch(Some(calibration.clone()), Certainty::Calibration);
        Ok(())
    }

    fn assert(&mut self, step: usize, limits: &AssertLimits) {
        let at = Some(self.driver.now());
        let last_reach = self.reaches.len().checked_sub(1);
        for (figure, limit) in limits.each() {
            let value = self.known(figure);
            self.asserts.push(AssertResult { step, figure, limit, value, at, last_reach });
        }
    }

    /// Returns a figure that the arm itself can know.
    fn known(&self, figure: AssertFigure) -> Option<f64> {
        let calibration = self.calibration.as_ref();
        match figure {
            AssertFigure::HeldOutRms => calibration?.held_out.rms_m,
            AssertFigure::HeldOutReprojection => calibration?.held_out.rms_px,
            AssertFigure::PredictedToolError => calibration?.predicted_tool_error_m.map(|summary| summary.p95),
            AssertFigure::SimulatedTime => Some(self.driver.elapsed_s()),
            AssertFigure::TargetsSkipped => Some(self.tally.skipped_targets.len() as f64),
            AssertFigure::Poses => Some(self.tally.poses as f64),
            AssertFigure::PosesSkipped => Some(self.tally.poses_skipped as f64),
            AssertFigure::ToolError
            | AssertFigure::ReachError
            | AssertFigure::WorstReachError
            | AssertFigure::Hits
            | AssertFigure::Clearance
            | AssertFigure::Contacts => None,
        }
    }

    /// Notes the limits that the script did not reach.
    fn pass_over(&mut self, rest: &[Step], before: usize) {
        for (offset, step) in rest.iter().enumerate() {
            if let Step::Assert(limits) = step {
                let step = before + 1 + offset;
                let never =
                    |(figure, limit)| AssertResult { step, figure, limit, value: None, at: None, last_reach: None };
                self.asserts.extend(limits.each().map(never));
            }
        }
    }
}

/// Converts a planning error in the middle of a script, which is no longer a wrong input: there is a recording to keep.
fn after_motion(step: usize, error: SessionError) -> SessionError {
    match error {
        error @ (SessionError::Plan(_) | SessionError::NothingSeen { .. }) => {
            SessionError::Step { step, problem: error.to_string() }
        }
        error => error,
    }
}

fn verdict_line(calibration: &Calibration) -> String {
    match &calibration.refusal {
        None => "calibration accepted".to_owned(),
        Some(why) => format!("calibration refused: {why}"),
    }
}

//! Plans views, visits them, and replans as views are captured.

use crate::batch::marked_calibrations::MIN_VIEWS;
use crate::checks::refusal_conditions::fewest_views;
use crate::file::calibration::Calibration;
use crate::plan::{
    ArmEnsemble, CaptureState, CapturedView, PlanError, PlannedPose, PosePlan, PoseRequest, StopReason,
    VisibilityModel, choose_poses,
};
use crate::session::SessionError;
use crate::session::constants::capture::{FIRST_RENEWAL, MOST_IN_VAIN, SPARE_TRIES, TRUST_IN_ADVANCE};
use crate::session::outcome::{EstimateUpdate, Visit};
use crate::session::runner::ScriptRunner;
use armcal_core::robot::Robot;
use armcal_core::routine::CaptureSettings;
use armcal_core::stats::stream_rng;
use armcal_core::streams::{CaptureSet, JointAngles, JointCounts, LogLevel, MarkKind, Phase};
use armcal_core::time::Stamp;

/// State of a capture.
struct CaptureRun<'a> {
    settings: &'a CaptureSettings,
    began: Stamp,
    n_fit: usize,
    n_held_out: usize,
    /// Number of fitted views below which a calibration is refused, regardless of its quality.
    n_for_verdict: usize,
    tried: usize,
    blocked: usize,
    /// Number of poses with a contact on the path to them, and number of poses at which the arm did not settle.
    met: usize,
    restless: usize,
    /// Number of consecutive failures among these at the end.
    in_vain: usize,
    /// Number of consecutive views without a tag at the end.
    blind: usize,
    /// Readings at the captured views, and the detected tags (index).
    taken: Vec<(JointCounts, Vec<usize>)>,
    /// Poses that were tried without a captured view.
    failed: Vec<JointAngles>,
    /// Predicted number of detections of each tag, and in `seen` the observed part of it.
    expected: Vec<f64>,
    seen: Vec<f64>,
    /// The interim estimate, and the number of views captured before its last update.
    belief: Option<Calibration>,
    renewed_at: usize,
    /// Number of fitted views after which the plan predicts a sufficiently small tool error.
    enough_at: Option<usize>,
    expected_tool_error_m: Option<f64>,
    /// Arms sampled from the present belief.
    ensemble: Option<ArmEnsemble>,
}

impl<'a> CaptureRun<'a> {
    fn new(settings: &'a CaptureSettings, robot: &Robot, began: Stamp) -> Self {
        let none = vec![0.0; robot.tags.len()];
        Self {
            settings,
            began,
            n_fit: 0,
            n_held_out: 0,
            n_for_verdict: fewest_views(robot),
            tried: 0,
            blocked: 0,
            met: 0,
            restless: 0,
            in_vain: 0,
            blind: 0,
            taken: Vec::new(),
            failed: Vec::new(),
            expected: none.clone(),
            seen: none,
            belief: None,
            renewed_at: 0,
            enough_at: None,
            expected_tool_error_m: None,
            ensemble: None,
        }
    }

    /// Restarts from the first view, because a failed joint has changed the arm.
    fn anew(&self, robot: &Robot, began: Stamp) -> Self {
        let Self { tried, blocked, met, restless, .. } = *self;
        Self { tried, blocked, met, restless, ..Self::new(self.settings, robot, began) }
    }

    fn captured(&self) -> usize {
        self.n_fit + self.n_held_out
    }

    fn wanted(&self) -> [usize; 2] {
        let CaptureSettings { poses, held_out, .. } = self.settings;
        [(*poses as usize).saturating_sub(self.n_fit), (*held_out as usize).saturating_sub(self.n_held_out)]
    }

    fn trust(&self) -> Vec<f64> {
        let share = |(expected, seen): (&f64, &f64)| {
            ((TRUST_IN_ADVANCE + seen) / (TRUST_IN_ADVANCE + expected)).clamp(0.0, 1.0)
        };
        self.expected.iter().zip(&self.seen).map(share).collect()
    }

    fn is_renewal_due(&self) -> bool {
        let every = self.settings.replan_every as usize;
        every > 0
            && (self.captured() - self.renewed_at >= every
                || (self.captured() >= FIRST_RENEWAL && self.renewed_at < FIRST_RENEWAL)
                || (self.captured() > 0 && self.renewed_at == 0)
                || (self.captured() > self.renewed_at && self.enough_at.is_some_and(|n| self.n_fit >= n)))
    }

    /// Returns the reason to end the capture after too many consecutive failures.
    fn is_in_vain(&self) -> Option<String> {
        let Self { met, restless, in_vain, .. } = *self;
        (in_vain >= MOST_IN_VAIN).then(|| {
            format!(
                "{in_vain} poses in a row were in vain (over all, the arm met something on the way to {met}, and did \
                 not come to rest at {restless})"
            )
        })
    }

    /// Returns the reason why no more views are wanted.
    fn enough(&self, now: Stamp) -> Option<String> {
        let CaptureSettings { poses, held_out, .. } = self.settings;
        let most = (poses + held_out) as usize + SPARE_TRIES;
        let state = CaptureState {
            captured: self.n_fit,
            left: most.saturating_sub(self.tried),
            elapsed_s: now.since_s(self.began),
            predicted_tool_error_m: self.expected_tool_error_m.filter(|_| self.n_fit >= self.n_for_verdict),
        };
        if let Some(why) = self.is_in_vain() {
            return Some(why);
        }
        let stop = StopReason::decide(self.settings, &state)?;
        // Held-out views are wanted regardless of the fit.
        (stop != StopReason::Poses || self.wanted() == [0, 0]).then(|| stop.to_string())
    }
}

/// Outcome of a visit.
enum Visited {
    Captured,
    Failed,
}

impl ScriptRunner<'_, '_> {
    /// Chooses views under the present belief.
    pub(crate) fn plan_views(&mut self, capture: &CaptureSettings) -> Result<PosePlan, SessionError> {
        let views = CaptureRun::new(capture, &self.robot, self.driver.now());
        Ok(self.choose(&views)?)
    }

    /// Returns the views captured so far, under the present belief.
    fn taken(&self, views: &CaptureRun<'_>) -> Vec<CapturedView> {
        let conditions = self.driver.conditions();
        let view = |(counts, tags): &(JointCounts, Vec<usize>)| CapturedView {
            angles: self.driver.sensors.angles_under(counts, &conditions),
            tags: tags.clone(),
        };
        views.taken.iter().map(view).collect()
    }

    fn choose(&mut self, views: &CaptureRun<'_>) -> Result<PosePlan, PlanError> {
        let targets = self.planned.as_ref().map(|planned| planned.targets.as_slice()).unwrap_or_default();
        let [n_fit, n_held_out] = views.wanted();
        choose_poses(
            &PoseRequest {
                robot: &self.robot,
                clearance: &self.clearance,
                bounds: &self.bounds,
                visibility: &VisibilityModel::default(),
                capture: views.settings,
                n_fit,
                n_held_out,
                belief: views.belief.as_ref(),
                taken: &self.taken(views),
                prior: self.accepted.as_ref(),
                known: self.known.as_ref(),
                detection_rate: &views.trust(),
                failed: &views.failed,
                task: targets,
                targets_m: &self.setup.routine.task.targets_m,
                start: &self.driver.set_point(),
            },
            &mut self.rng,
        )
    }

    /// Visits views and records them until there are enough.
    pub(crate) fn capture(&mut self, capture: &CaptureSettings) -> Result<(), SessionError> {
        let mut views = CaptureRun::new(capture, &self.robot, self.driver.now());
        let replans = self.replans(capture);
        let ready = self.planned.as_mut().and_then(|planned| planned.first_capture.take());
        // This plan was made before any motion; the belief is still the same unless a calibration came in between.
        let mut plan = ready.filter(|_| self.epochs.len() == 1);
        if replans {
            self.capture_at_start(&mut views)?;
        }
        let why = loop {
            if self.take_up_failures() {
                (plan, views) = (None, views.anew(&self.robot, self.driver.now()));
                if replans {
                    self.capture_at_start(&mut views)?;
                }
            }
            if let Some(why) = views.enough(self.driver.now()) {
                break why;
            }
            let renewed = replans && views.is_renewal_due() && self.renew_views(&mut views)?;
            if renewed {
                plan = None;
                continue;
            }
            let chosen = match plan.take() {
                Some(plan) => plan,
                None => {
                    self.driver.phase(Phase::Plan)?;
                    match self.choose(&views) {
                        Ok(plan) => plan,
                        Err(why) if views.n_fit >= MIN_VIEWS && replans => break why.to_string(),
                        Err(why) if views.blind > 0 => {
                            return Err(SessionError::NothingSeen { poses: views.blind, why: why.to_string() });
                        }
                        Err(why) => return Err(why.into()),
                    }
                }
            };
            if chosen.poses.is_empty() {
                break StopReason::NoPoseLeft.to_string();
            }
            self.log_plan(&chosen)?;
            views.enough_at = chosen.needed.map(|needed| (views.n_fit + needed).max(views.n_for_verdict));
            self.visit_some(&chosen, &mut views)?;
            if !replans {
                break views.is_in_vain().unwrap_or_else(|| format!("{} poses were visited", views.tried));
            }
        };
        self.end_capture(&views, why)
    }

    /// Logs why there are no more views. Returns an error if there are too few for any calibration.
    fn end_capture(&mut self, views: &CaptureRun<'_>, why: String) -> Result<(), SessionError> {
        let CaptureRun { tried, blocked, met, restless, .. } = *views;
        let why = match self.driver.unmoved_joint().or_else(|| self.driver.flow.weak_pump()) {
            Some(cause) if met + restless > 0 => format!("{why}; {cause}"),
            _ => why,
        };
        self.driver.log(LogLevel::Info, &format!("no more views: {why}"))?;
        self.capture_ended = Some(why.clone());
        let captured = views.captured();
        self.tally.poses += captured;
        let are_too_few = views.wanted() != [0, 0] && (self.poses_marked as usize) < MIN_VIEWS;
        if captured > 0 && !are_too_few {
            return Ok(());
        }
        let why = match self.driver.why_blocked.take() {
            Some(last) => format!("{why}; to the last without a path: {last}"),
            None => why,
        };
        Err(SessionError::TooFewViews { captured, tried, blocked, met, restless, why })
    }

    fn log_plan(&mut self, plan: &PosePlan) -> Result<(), SessionError> {
        let text = format!(
            "planned {} poses out of {} that see enough tags and keep clear ({} drawn); predicted tool error {:.1} mm",
            plan.poses.len(),
            plan.candidates,
            plan.tried,
            plan.predicted_tool_error_m * 1e3
        );
        self.driver.log(LogLevel::Info, &text)
    }

    /// Updates belief and margins. Returns true if anything changed.
    fn renew_views(&mut self, views: &mut CaptureRun<'_>) -> Result<bool, SessionError> {
        views.renewed_at = views.captured();
        self.driver.phase(Phase::Plan)?;
        let Some(calibration) = self.update_estimate()? else { return Ok(false) };
        views.expected_tool_error_m = self.expected_tool_error_m(&calibration);
        if let Some(expected_m) = views.expected_tool_error_m {
            let text = format!("after {} views: predicted tool error {:.2} mm", views.captured(), expected_m * 1e3);
            self.driver.log(LogLevel::Info, &text)?;
            let elapsed_s = self.driver.now().since_s(views.began);
            self.renewals.push(EstimateUpdate {
                views: views.captured(),
                elapsed_s,
                expected_tool_error_m: expected_m,
            });
        }
        views.belief = Some(calibration);
        views.ensemble = None;
        Ok(true)
    }

    /// Captures a view where the arm stands: no motion is needed, and the visible tags locate the arm.
    fn capture_at_start(&mut self, views: &mut CaptureRun<'_>) -> Result<(), SessionError> {
        let here = self.driver.set_point();
        let tags = VisibilityModel::default().visible(&self.robot, &self.clearance, &here);
        // Only a view can locate a joint that no view has shown yet.
        if tags.is_empty() && self.unlocated().is_none() {
            return Ok(());
        }
        let pose = PlannedPose {
            set: CaptureSet::Fit,
            angles: here,
            tags: tags.into_iter().map(|tag| (tag, 1.0)).collect(),
            predicted_tool_error_m: f64::NAN,
        };
        if let Visited::Failed = self.stand_and_look(&pose, views)? {
            self.driver.log(LogLevel::Warn, "nothing was seen from where the arm started")?;
        }
        Ok(())
    }

    /// Visits the poses of a plan in their order, until the next update is due.
    fn visit_some(&mut self, plan: &PosePlan, views: &mut CaptureRun<'_>) -> Result<(), SessionError> {
        let replans = self.replans(views.settings);
        for pose in &plan.poses {
            if self.driver.held.len() > self.n_held {
                return Ok(());
            }
            if views.is_in_vain().is_some() {
                return Ok(());
            }
            if replans && (views.is_renewal_due() || views.enough(self.driver.now()).is_some()) {
                return Ok(());
            }
            self.progress_at(Phase::Capture, views.captured(), views.captured() + views.wanted().iter().sum::<usize>());
            self.driver.phase(Phase::Move)?;
            let n_met = self.driver.n_met;
            if !self.go(&pose.angles)? {
                views.tried += 1;
                if self.driver.n_met > n_met {
                    views.met += 1;
                    views.in_vain += 1;
                } else {
                    views.blocked += 1;
                }
                views.failed.push(pose.angles);
                self.tally.poses_skipped += 1;
                continue;
            }
            if let Visited::Failed = self.stand_and_look(pose, views)?
                && replans
            {
                // The failure may change the plan before the next pose.
                return Ok(());
            }
        }
        Ok(())
    }

    fn stand_and_look(&mut self, pose: &PlannedPose, views: &mut CaptureRun<'_>) -> Result<Visited, SessionError> {
        views.tried += 1;
        self.driver.phase(Phase::Settle)?;
        let pose_idx = self.poses_marked;
        let number = pose_idx + 1;
        if !self.driver.settle()? {
            self.driver.log(LogLevel::Warn, &format!("pose {number} is left out: the arm did not settle"))?;
            self.tally.poses_skipped += 1;
            views.restless += 1;
            views.in_vain += 1;
            views.failed.push(pose.angles);
            return Ok(Visited::Failed);
        }
        views.in_vain = 0;
        self.driver.phase(Phase::Capture)?;
        self.note_visit(pose, views)?;
        let kind = MarkKind::Capture { set: pose.set, pose_idx };
        self.poses_marked += 1;
        let tags = self.driver.dwell(views.settings.dwell_s, kind)?;
        self.learn(pose, views)?;
        views.blind = if tags == 0 { views.blind + 1 } else { 0 };
        if tags == 0 {
            self.driver.log(LogLevel::Warn, &format!("pose {number} saw no tag"))?;
            views.failed.push(pose.angles);
            if self.replans(views.settings) {
                return Ok(Visited::Failed);
            }
        }
        match pose.set {
            CaptureSet::Fit => views.n_fit += 1,
            CaptureSet::HeldOut => views.n_held_out += 1,
        }
        Ok(Visited::Captured)
    }

    /// Compares the detected tags with the predicted ones.
    fn learn(&mut self, pose: &PlannedPose, views: &mut CaptureRun<'_>) -> Result<(), SessionError> {
        let counts = self.driver.counts()?;
        let ids_seen = &self.driver.recorder.tags_seen()?.ids;
        let seen = |&tag: &usize| ids_seen.contains(&self.robot.tags[tag].id);
        views.taken.push((counts, (0..self.robot.tags.len()).filter(seen).collect()));
        for &(tag, probability) in &pose.tags {
            let was_seen = seen(&tag);
            views.expected[tag] += probability;
            views.seen[tag] += if was_seen { probability } else { 0.0 };
        }
        Ok(())
    }

    /// Records the predicted displacement of each link, for comparison with the truth where that is known.
    fn note_visit(&mut self, pose: &PlannedPose, views: &mut CaptureRun<'_>) -> Result<(), SessionError> {
        let believed = self.driver.believed_angles()?;
        let ensemble = match views.ensemble.take() {
            Some(ensemble) => ensemble,
            None => self.ensemble(views),
        };
        self.visits.push(Visit {
            at: self.driver.now(),
            believed,
            belief_views: if views.belief.is_some() { views.renewed_at } else { 0 },
            link_q99_m: ensemble.link_displacement_quantiles_m(&self.robot, &believed, 0.99),
            expected_tool_error_m: views.expected_tool_error_m,
            tags_expected: pose.tags.iter().map(|(_, probability)| probability).sum(),
        });
        views.ensemble = Some(ensemble);
        Ok(())
    }

    fn ensemble(&self, views: &CaptureRun<'_>) -> ArmEnsemble {
        let mut rng = stream_rng(self.setup.seed, "ensemble");
        match views.belief.as_ref().or(self.accepted.as_ref()) {
            Some(calibration) => {
                ArmEnsemble::believed(self.setup.robot, calibration, &self.driver.conditions(), &mut rng)
            }
            None => ArmEnsemble::datasheet(self.setup.robot, &mut rng),
        }
    }
}

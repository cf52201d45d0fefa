//! Reaches for the task's targets under the believed sensors.

use crate::plan::{TargetRequest, plan_targets};
use crate::session::SessionError;
pub(crate) use crate::session::constants::reach::REACH_DWELL_S;
use crate::session::outcome::SkippedTarget;
use crate::session::runner::ScriptRunner;
use armcal_core::routine::ReachSettings;
use armcal_core::streams::{JointAngles, LogLevel, MarkKind, Phase, ReachAttempt};

/// A value, such as a target configuration, or the reason why there is none.
pub(crate) type OrReason<T> = Result<T, String>;

impl ScriptRunner<'_, '_> {
    /// Moves to each target and rests there for a moment. A target to be touched is approached with open jaws, which
    /// then close on it.
    pub(crate) fn reach(&mut self, step: usize, settings: &ReachSettings) -> Result<(), SessionError> {
        let ReachSettings { targets, touch } = settings;
        if *touch {
            self.grip(step, 1.0)?;
        }
        let attempt = self.attempt();
        let mut postures = self.postures(targets, attempt)?;
        self.warn_beyond(&postures)?;
        self.driver.phase(Phase::Reach)?;
        for (n, &target) in targets.iter().enumerate() {
            self.progress_at(Phase::Reach, n, targets.len());
            let mut arrived = self.arrive(&postures[n])?;
            while arrived.is_err() && self.take_up_failures() {
                postures = self.postures(targets, attempt)?;
                arrived = self.arrive(&postures[n])?;
            }
            if let Err(reason) = arrived {
                if let Some(still) = self.still_reachable.as_mut().filter(|_| postures[n].is_ok()) {
                    still.reachable -= 1;
                    still.no_path.push(target);
                }
                self.skip(SkippedTarget { step, target, reason })?;
                continue;
            }
            let kind = MarkKind::Reach { attempt, target_idx: target as u32 };
            self.driver.dwell(REACH_DWELL_S, kind)?;
            if *touch {
                self.touch(step, target)?;
            }
        }
        if *touch {
            self.rest_jaws(step)?;
        }
        match &self.still_reachable {
            Some(still) => self.driver.log(LogLevel::Warn, &still.to_string()),
            None => Ok(()),
        }
    }

    pub(crate) fn arrive(&mut self, at: &OrReason<JointAngles>) -> Result<OrReason<()>, SessionError> {
        let angles = match at {
            Ok(angles) => angles,
            Err(reason) => return Ok(Err(reason.clone())),
        };
        let n_met = self.driver.n_met;
        self.driver.why_blocked = None;
        if !self.go(angles)? {
            return Ok(Err(match &self.driver.why_blocked {
                Some(blocked) => blocked.clone(),
                None if self.driver.n_met > n_met => "the arm met something on its way".to_owned(),
                None => "the arm did not follow its path to the end".to_owned(),
            }));
        }
        let is_at_rest = self.driver.settle()?;
        Ok(is_at_rest.then_some(()).ok_or_else(|| "the arm did not come to rest".to_owned()))
    }

    pub(crate) fn skip(&mut self, skipped: SkippedTarget) -> Result<(), SessionError> {
        self.driver.log(LogLevel::Warn, &format!("a target is left out: {skipped}"))?;
        self.tally.skipped_targets.push(skipped);
        Ok(())
    }

    /// Warns once if the targets need more than the calibrated ranges, unless only straight lines were fitted: a fitted
    /// shape is worthless where there were no views.
    pub(crate) fn warn_beyond(&mut self, postures: &[OrReason<JointAngles>]) -> Result<(), SessionError> {
        let calibration = self.epochs.last().and_then(|epoch| epoch.calibration.as_ref());
        let Some(calibration) = calibration.filter(|c| c.reference.is_some()) else { return Ok(()) };
        let conditions = self.driver.conditions();
        let mut words: Vec<String> = Vec::new();
        for word in postures.iter().flatten().flat_map(|angles| calibration.beyond(angles, &conditions)) {
            if !words.contains(&word) {
                words.push(word);
            }
        }
        if words.is_empty() {
            return Ok(());
        }
        let text = format!("beyond what the calibration is valid for: {}", words.join("; "));
        self.driver.log(LogLevel::Warn, &text)
    }

    /// Returns the believed angles at each target. A target that a calibration puts out of reach is logged and skipped,
    /// so that the rest is not lost.
    fn postures(
        &mut self,
        targets: &[usize],
        attempt: ReachAttempt,
    ) -> Result<Vec<OrReason<JointAngles>>, SessionError> {
        let planned = self.planned.as_ref().map(|planned| planned.targets.clone()).unwrap_or_default();
        let preferred: Vec<JointAngles> = targets.iter().filter_map(|&target| planned.get(target)).copied().collect();
        let has_failed = !self.driver.held.is_empty();
        if attempt == ReachAttempt::Before && preferred.len() == targets.len() && !has_failed {
            return Ok(preferred.into_iter().map(Ok).collect());
        }
        self.postures_near(targets, &preferred)
    }

    /// Returns the believed angles at each target, near preferred ones if given.
    pub(crate) fn postures_near(
        &mut self,
        targets: &[usize],
        preferred: &[JointAngles],
    ) -> Result<Vec<OrReason<JointAngles>>, SessionError> {
        if let Some(held) = self.unlocated() {
            let reason = format!("no view has shown yet where {} stands", self.robot.sensors[held.joint].joint);
            self.driver.log(LogLevel::Warn, &format!("all targets are left out: {reason}"))?;
            return Ok(vec![Err(reason); targets.len()]);
        }
        let targets_m: Vec<[f64; 3]> = targets.iter().map(|&t| self.setup.routine.task.targets_m[t]).collect();
        let request = TargetRequest { targets_m: &targets_m, preferred: Some(preferred), margin_m: self.margin_m() };
        let solved = plan_targets(&self.robot, &self.clearance, &self.bounds, &request, &mut self.rng);
        self.note_reachable(targets, &solved);
        let named = targets.iter().zip(solved);
        Ok(named.map(|(&target, plan)| plan.map_err(|why| why.of_target(target).to_string())).collect())
    }
}

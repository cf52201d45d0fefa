//! Planning before the first motion, so that an infeasible task is refused in time.

use std::collections::BTreeSet;

use crate::plan::{JointErrorBounds, PlanError, TargetRequest, VisibilityModel, plan_targets};
use crate::session::SessionError;
use crate::session::runner::{Planned, ScriptRunner};
use armcal_core::routine::{CaptureSettings, Step};
use armcal_core::streams::{JointAngles, Phase};

impl ScriptRunner<'_, '_> {
    /// Plans all that can be planned, so that a task that cannot be done is refused before anything moves.
    pub fn prepare(&mut self) -> Result<(), SessionError> {
        let routine = self.setup.routine;
        let margin_m = self.margin_m();
        let start = self.driver.believed_angles()?;
        self.progress_at(Phase::Plan, 0, 2);
        let capture = first_capture(&routine.steps);
        let looks_first = capture.is_some_and(|capture| self.replans(capture)) && self.sees_tags_from(&start);
        let nearest = self.clearance.nearest_under(&start, &self.bounds, margin_m);
        // An arm that can look before it moves will know better where it is by then.
        if nearest.distance_m < margin_m && !looks_first {
            let clearance_m = nearest.distance_m;
            return Err(
                PlanError::StartTooClose { clearance_m, nearest: nearest.to_string(), needed_m: margin_m }.into()
            );
        }
        let targets = self.plan_task()?;
        self.planned = Some(Planned { targets, first_capture: None });
        self.progress_at(Phase::Plan, 1, 2);
        if let Some(capture) = capture {
            match self.plan_views(capture) {
                Ok(plan) => {
                    self.planned = self.planned.take().map(|planned| Planned { first_capture: Some(plan), ..planned });
                }
                // No look finds more tags than there are.
                Err(why) if !looks_first || matches!(why, SessionError::Plan(PlanError::TooFewTags { .. })) => {
                    return Err(why);
                }
                Err(_) => {}
            }
        }
        self.driver.record_task(&routine.task)?;
        self.driver.record_failed(&self.setup.robot.failed)?;
        self.progress_at(Phase::Plan, 2, 2);
        Ok(())
    }

    fn sees_tags_from(&self, angles: &JointAngles) -> bool {
        !VisibilityModel::default().visible(&self.robot, self.clearance, angles).is_empty()
    }

    /// Believed angles at the task's targets. Those that are reached for before any calibration must be clear for every
    /// arm that the datasheet allows; for the others it is enough that the believed arm gets there.
    fn plan_task(&mut self) -> Result<Vec<JointAngles>, SessionError> {
        let routine = self.setup.routine;
        let margin_m = self.margin_m();
        let request = TargetRequest { targets_m: &routine.task.targets_m, preferred: None, margin_m };
        let clearance = self.clearance_at_targets();
        let planned = plan_targets(&self.robot, clearance, &self.bounds, &request, &mut self.rng);
        let at_first = reached_at_first(&routine.steps);
        if planned.iter().enumerate().all(|(target, planned)| planned.is_ok() || at_first.contains(&target)) {
            return Ok(planned.into_iter().collect::<Result<Vec<_>, _>>()?);
        }
        let believed = JointErrorBounds::none(&self.robot);
        let later = plan_targets(&self.robot, clearance, &believed, &request, &mut self.rng);
        let either = planned
            .into_iter()
            .zip(later)
            .enumerate()
            .map(|(target, (now, later))| if at_first.contains(&target) { now } else { now.or(later) });
        Ok(either.collect::<Result<Vec<_>, _>>()?)
    }
}

/// Targets that are reached for before any calibration.
fn reached_at_first(steps: &[Step]) -> BTreeSet<usize> {
    let before = steps.iter().take_while(|step| !matches!(step, Step::Calibrate(_)));
    let targets = before.filter_map(|step| match step {
        Step::Reach(reach) => Some(reach.targets.iter().copied()),
        _ => None,
    });
    targets.flatten().collect()
}

/// The first capture; no calibration can come before it.
fn first_capture(steps: &[Step]) -> Option<&CaptureSettings> {
    steps.iter().find_map(|step| match step {
        Step::Capture(capture) => Some(capture),
        _ => None,
    })
}

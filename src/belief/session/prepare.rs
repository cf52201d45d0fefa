//! Planning before the first motion, so that an infeasible task is refused in time.

use crate::plan::{JointErrorBounds, PlanError, VisibilityModel, plan_task};
use crate::session::SessionError;
use crate::session::runner::{Planned, ScriptRunner};
use armcal_core::routine::{CaptureSettings, Step};
use armcal_core::streams::{JointAngles, Phase};

impl ScriptRunner<'_, '_> {
    /// Plans as much as possible, so that an infeasible task is refused before any motion.
    pub fn prepare(&mut self) -> Result<(), SessionError> {
        let routine = self.setup.routine;
        let margin_m = self.margin_m();
        let start = self.driver.believed_angles()?;
        self.progress_at(Phase::Plan, 0, 2);
        let capture = first_capture(&routine.steps);
        let looks_first = capture.is_some_and(|capture| self.replans(capture)) && self.sees_tags_from(&start);
        let inside = self.clearance.overlaps(&start);
        if let Some(pair) = inside.first() {
            let (clearance_m, nearest, needed_m) = (0.0, pair.to_string(), pair.needed_m(margin_m));
            return Err(PlanError::StartTooClose { clearance_m, nearest, needed_m }.into());
        }
        let nearest = self.clearance.nearest_under(&start, &self.bounds, margin_m);
        // An arm with tags in view is located better before it moves.
        if nearest.distance_m < margin_m && !looks_first {
            let (clearance_m, needed_m) = (nearest.true_distance_m(), nearest.needed_m(margin_m));
            return Err(PlanError::StartTooClose { clearance_m, nearest: nearest.to_string(), needed_m }.into());
        }
        let bounds = &self.bounds;
        let targets = plan_task(&self.robot, &self.clearance_at_targets(), bounds, routine, &mut self.rng);
        let targets = targets.into_iter().collect::<Result<Vec<_>, _>>()?;
        self.planned = Some(Planned { targets, first_capture: None });
        self.progress_at(Phase::Plan, 1, 2);
        if let Some(capture) = capture {
            match self.plan_views(capture) {
                Ok(plan) => {
                    self.planned = self.planned.take().map(|planned| Planned { first_capture: Some(plan), ..planned });
                }
                Err(why) if !looks_first => return Err(why),
                // A view locates no arm better than one that is already known exactly.
                Err(_) => self.check_views_of_believed_arm(capture)?,
            }
        }
        self.driver.record_task(&routine.task)?;
        self.driver.record_failed(&self.setup.robot.failed)?;
        self.progress_at(Phase::Plan, 2, 2);
        Ok(())
    }

    /// Checks that an arm without errors has any view at all, with separate random draws.
    fn check_views_of_believed_arm(&mut self, capture: &CaptureSettings) -> Result<(), SessionError> {
        let (bounds, rng) = (JointErrorBounds::none(&self.robot), self.rng.clone());
        let bounds = std::mem::replace(&mut self.bounds, bounds);
        let plan = self.plan_views(capture);
        (self.bounds, self.rng) = (bounds, rng);
        plan.map(drop)
    }

    fn sees_tags_from(&self, angles: &JointAngles) -> bool {
        !VisibilityModel::default().visible(&self.robot, &self.clearance, angles).is_empty()
    }
}

/// Returns the first capture; no calibration can come before it.
fn first_capture(steps: &[Step]) -> Option<&CaptureSettings> {
    steps.iter().find_map(|step| match step {
        Step::Capture(capture) => Some(capture),
        _ => None,
    })
}

//! Plans views and visits them.

use super::SessionError;
use super::script::Run;
use crate::plan::{PosePlan, PoseRequest, VisibilityModel, choose_poses};
use crate::routine::CaptureSettings;
use crate::streams::{LogLevel, MarkKind, Phase};

impl Run<'_, '_> {
    /// Chooses views under the present belief.
    pub(super) fn plan_views(&mut self, capture: &CaptureSettings) -> Result<PosePlan, SessionError> {
        let targets = self.planned.as_ref().map(|planned| planned.targets.as_slice()).unwrap_or_default();
        let plan = choose_poses(
            &PoseRequest {
                robot: &self.robot,
                clearance: self.clearance,
                bounds: &self.bounds,
                visibility: &VisibilityModel::default(),
                capture,
                task: targets,
                targets_m: &self.setup.routine.task.targets_m,
                start: &self.driver.set_point(),
            },
            &mut self.rng,
        )?;
        self.driver.log(
            LogLevel::Info,
            &format!(
                "planned {} poses out of {} that see enough tags and keep clear ({} drawn); predicted tool error {:.1} mm",
                plan.poses.len(),
                plan.candidates,
                plan.tried,
                plan.predicted_tool_error_m * 1e3
            ),
        )?;
        Ok(plan)
    }

    /// Visits the views and records what is seen.
    pub(super) fn capture(&mut self, capture: &CaptureSettings) -> Result<(), SessionError> {
        let ready = self.planned.as_mut().and_then(|planned| planned.first_capture.take());
        let plan = match ready {
            // Planned before anything moved; the belief is still the same unless a calibration came in between.
            Some(plan) if self.epochs.len() == 1 => plan,
            _ => {
                self.driver.phase(Phase::Plan)?;
                self.progress_at(Phase::Plan, 0, 1);
                self.plan_views(capture)?
            }
        };
        let (mut captured, mut blocked) = (0, 0);
        for (n, (set, angles)) in plan.poses.iter().enumerate() {
            self.progress_at(Phase::Capture, n, plan.poses.len());
            self.driver.phase(Phase::Move)?;
            if !self.go(angles)? {
                blocked += 1;
                self.tally.poses_skipped += 1;
                continue;
            }
            self.driver.phase(Phase::Settle)?;
            if !self.driver.settle()? {
                self.driver.log(LogLevel::Warn, &format!("pose {n} is left out: the arm did not settle"))?;
                self.tally.poses_skipped += 1;
                continue;
            }
            self.driver.phase(Phase::Capture)?;
            let kind = MarkKind::Capture { set: *set, pose_idx: self.poses_marked + n as u32 };
            let tags = self.driver.dwell(capture.dwell_s, kind)?;
            if tags == 0 {
                self.driver.log(LogLevel::Warn, &format!("pose {n} saw no tag"))?;
            }
            captured += 1;
        }
        self.poses_marked += plan.poses.len() as u32;
        self.tally.poses += captured;
        if captured == 0 {
            let planned = plan.poses.len();
            return Err(SessionError::NothingCaptured { planned, blocked, restless: planned - blocked });
        }
        Ok(())
    }
}
